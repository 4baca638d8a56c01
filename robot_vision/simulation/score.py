# SPDX-License-Identifier: Apache-2.0
"""Keeps the score of a drive: what was touched, how closely things were passed, how well the lane was kept."""

from __future__ import annotations

import numpy as np

from robot_vision.simulation.floor_plan import Room


class DriveScore:
    """How a drive went so far.

    Attributes:
        contacts: how many times the robot has touched something.
        touched: what it touched last; empty: nothing.
        closest: least room to any object, metres.
        nearest: the name of that object.
    """

    def __init__(self, settling: float) -> None:
        self._settling = settling
        self.contacts = 0
        self.touched = ""
        self.closest, self.nearest = np.inf, "nothing"
        self._offsets: list[float] = []

    @property
    def offset_rms(self) -> float:
        """Root mean square of the offset from the lane's centre after settling, metres; nan before."""
        return float(np.sqrt(np.mean(np.square(self._offsets)))) if self._offsets else float("nan")

    @property
    def offset_worst(self) -> float:
        """Greatest distance from the lane's centre after settling, metres; nan before."""
        return float(np.max(np.abs(self._offsets))) if self._offsets else float("nan")

    def summary(self) -> dict[str, float | int | str | None]:
        """The numbers for a report."""
        return {
            "contacts": self.contacts,
            "touched": self.touched,
            "closest_m": known(self.closest),
            "nearest": self.nearest,
            "offset_rms_m": known(self.offset_rms),
            "offset_worst_m": known(self.offset_worst),
        }

    def see(self, room: Room) -> None:
        """Take note of the room about the robot."""
        if room.clearance < self.closest:
            self.closest, self.nearest = room.clearance, room.nearest

    def touch(self, room: Room) -> None:
        """Take note of a contact."""
        self.see(room)
        self.contacts += 1
        self.touched = room.nearest

    def follow(self, way: float, offset: float) -> None:
        """Take note of an offset after a way of so many metres."""
        if way >= self._settling:
            self._offsets.append(offset)


def known(value: float) -> float | None:
    """A number for a report, to a tenth of a millimetre; None if it is none."""
    return round(float(value), 4) if np.isfinite(value) else None
