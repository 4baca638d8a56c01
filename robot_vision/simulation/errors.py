# SPDX-License-Identifier: Apache-2.0
"""One exception for everything a person can ask of the simulator that it cannot do."""

from __future__ import annotations


class SimulationError(ValueError):
    """An unknown world, an impossible parameter or an output that cannot be written, in one line."""
