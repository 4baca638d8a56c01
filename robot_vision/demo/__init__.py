# SPDX-License-Identifier: Apache-2.0
"""The demonstration: a recorded drive through the real nodes, and what they made of it against the truth."""

from __future__ import annotations

from robot_vision.demo.show import Mount, run_demo

__all__ = ["Mount", "run_demo"]
