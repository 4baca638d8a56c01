# SPDX-License-Identifier: Apache-2.0
"""One camera is enough for a robot to find its direction, draw its floor, plan its way and steer."""

__version__ = "0.1.0"
