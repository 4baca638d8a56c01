# SPDX-License-Identifier: Apache-2.0
"""How the window of the viewer is divided."""

from __future__ import annotations

import rerun.blueprint as rrb


def layout() -> rrb.Blueprint:
    """Picture and plan side by side, the curves below them."""
    plans = rrb.Tabs(
        rrb.Spatial3DView(origin="odom", name="way in odom"),
        rrb.Spatial3DView(origin="base_link", name="before the robot"),
        rrb.Spatial2DView(origin="plan", name="plans"),
        rrb.Spatial2DView(origin="overlay", name="overlays"),
    )
    curves = [
        rrb.TimeSeriesView(origin=f"curves/{what}", name=f"{what} ({unit})")
        for what, unit in (("offset", "m"), ("angle", "degrees"), ("speed", "m/s"), ("clearance", "m"))
    ]
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(rrb.Spatial2DView(origin="camera", name="camera"), plans),
            rrb.Horizontal(*curves),
            row_shares=[2, 1],
        )
    )
