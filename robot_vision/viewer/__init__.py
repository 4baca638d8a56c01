# SPDX-License-Identifier: Apache-2.0
"""Shows a bag in the Rerun viewer."""

from robot_vision.viewer.show import Target, ViewerError, view

__all__ = ["Target", "ViewerError", "view"]
