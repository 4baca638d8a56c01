# SPDX-License-Identifier: Apache-2.0
"""Vanishing points: where lines that are parallel in space lead to, found, understood and followed over time."""

from robot_vision.perception.vanishing.estimator import VanishingPointEstimator
from robot_vision.perception.vanishing.points import Role, VanishingPoints
from robot_vision.perception.vanishing.tracker import VanishingPointTracker

__all__ = ["Role", "VanishingPointEstimator", "VanishingPointTracker", "VanishingPoints"]
