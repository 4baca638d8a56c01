# SPDX-License-Identifier: Apache-2.0
"""From the lines of a drive to the camera that took it: focal length, roll, pitch and height."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.perception.calibration.findings import (
    CalibrationError,
    CameraCalibration,
    Finding,
    KnownLengths,
)
from robot_vision.perception.calibration.focal import SharedFocalLength, share_focal_length
from robot_vision.perception.calibration.height import height_from_corridor, height_from_stones
from robot_vision.perception.calibration.mounting import Mounting, find_mounting
from robot_vision.perception.calibration.rows import Plants, RowFinder, pitch_and_height_from_rows
from robot_vision.perception.segments import LineSegments
from robot_vision.perception.vanishing import VanishingPointEstimator
from robot_vision.perception.vanishing.bundle import Bundle

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

#: The mounting is searched again from where it was found when it lies farther from the guess than this, rad.
_FAR_FROM_GUESS = np.deg2rad(3.0)


@dataclass(frozen=True)
class CameraCalibrator:
    """Calibrates a camera from what is straight, upright and at right angles in front of it.

    1. The focal length on which the right angles of most pictures agree.
    2. With it (or with the one given, when the pictures do not tell) the vertical in every picture, and the
       mounting as their robust mean.
    3. With both, the height at which a known length on the ground has that length.

    What the pictures do not tell is said so, with the reason, and stays as it was given. The principal point and the
    lens are taken as given.

    Args:
        estimator: of the vanishing points of one picture.
        squareness: how far right angles and verticals of what was built are off, the same way in all pictures
            (standard deviation), rad.
        lean: how far the body leans about its mounting (standard deviation), rad.
        most_doubt: relative standard deviation of the focal length beyond which it is not told.
        most_lean_doubt: standard deviation of roll or pitch beyond which it is not told, rad.
        least_agreement: share of the pictures that must agree, each counted by how sure it is.
        least_share: share of the pictures that must say something of the focal length.
        least_level_share: share of the pictures that must say something of roll or pitch.
        rows: finder of crop rows.
    """

    estimator: VanishingPointEstimator = field(default_factory=VanishingPointEstimator)
    squareness: float = float(np.deg2rad(0.1))
    lean: float = float(np.deg2rad(1.0))
    most_doubt: float = 0.05
    most_lean_doubt: float = float(np.deg2rad(1.0))
    least_agreement: float = 0.7
    least_share: float = 0.15
    least_level_share: float = 0.5
    rows: RowFinder = field(default_factory=RowFinder)

    def calibrate(
        self,
        pictures: Sequence[LineSegments],
        camera: Camera,
        stamps_s: Sequence[float] | None = None,
        lengths: KnownLengths | None = None,
        plants: Sequence[Plants | None] | None = None,
        progress: Progress = lambda done, total: None,
    ) -> CameraCalibration:
        """Find what the pictures tell of their camera.

        Args:
            pictures: lines of N pictures of one camera, rectified px.
            camera: as far as it is known, `Camera.uncalibrated` when it is not at all. Its focal length is used
                only when the pictures do not tell; its roll and pitch say where the search begins.
            stamps_s: (N,) times of the pictures, s; needed for a corridor's width; 0.1 s apart when not given.
            lengths: known lengths on the ground.
            plants: (N,) what is green in the pictures, None where that was not looked for; needed for a row spacing,
                which also tells the pitch where nothing built does.
            progress: called with steps done and in all.

        Raises:
            CalibrationError: when there are no pictures, or not as many stamps or plants.
        """
        if not pictures:
            raise CalibrationError("there is no picture to calibrate from")
        stamps = [0.1 * k for k in range(len(pictures))] if stamps_s is None else list(stamps_s)
        if len(stamps) != len(pictures):
            raise CalibrationError(f"there are {len(stamps)} stamps for {len(pictures)} pictures")
        if plants is not None and len(plants) != len(pictures):
            raise CalibrationError(
                f"there are plants of {len(plants)} pictures, but lines of {len(pictures)}"
            )
        lengths = lengths or KnownLengths()
        camera = camera.rectified()
        count = len(pictures)
        focal, crooked = self._focal(pictures, camera, lambda done: progress(done, 2 * count))
        known = camera
        if focal.value is not None:
            stretch = focal.value / camera.fx
            known = replace(camera, fx=focal.value, fy=camera.fy * stretch, focal_known=True, projection=None)
        if not known.focal_known:
            waits = Finding.missing("without a focal length no angle is known", count)
            return CameraCalibration(camera, camera, count, focal, waits, waits, waits)
        found = self._mounting(pictures, known)
        progress(3 * count // 2, 2 * count)
        doubt = focal.sigma / focal.value if focal.value is not None else 0.0
        crooked &= found.upright < self.least_level_share * count
        roll, pitch = self._roll(found, crooked, count), self._pitch(found, doubt, crooked, count)
        known = replace(known, roll=camera.roll if roll.value is None else roll.value)
        heights = []
        if lengths.row_spacing is not None and plants is not None:
            by_rows, height = pitch_and_height_from_rows(plants, known, lengths.row_spacing, self.rows)
            pitch = pitch if pitch.known else by_rows
            heights.append(height)
        known = replace(known, pitch=camera.pitch if pitch.value is None else pitch.value)
        heights += self._heights(pictures, stamps, known, pitch, lengths, doubt)
        height = min(heights, key=lambda finding: finding.sigma)
        progress(2 * count, 2 * count)
        if height.value is not None:
            known = replace(known, height_m=height.value)
        return CameraCalibration(known, camera, count, focal, roll, pitch, height)

    def _focal(
        self, pictures: Sequence[LineSegments], camera: Camera, progress: Callable[[int], None]
    ) -> tuple[Finding, bool]:
        """The focal length, and whether what the pictures show is not built at right angles."""
        # Begin with the longer side of the picture, whatever was given: that is for comparison alone.
        longer = float(max(camera.width, camera.height))
        guess = replace(
            camera, fx=longer, fy=longer * camera.fy / camera.fx, projection=None, focal_known=False
        )
        bundles = [Bundle.of(lines, guess, self.estimator.most_lines) for lines in pictures]
        shared = share_focal_length(bundles, self.squareness, progress)
        fault = self._focal_fault(shared, len(pictures))
        own = longer * shared.own
        crooked = self._often_enough(shared, len(pictures)) and shared.agreement < self.least_agreement
        if fault:
            return Finding(None, float("inf"), shared.telling, fault, own), crooked
        value = longer * shared.ratio
        reason = f"from right angles on which {100 * shared.agreement:.0f} % of them agree"
        return Finding(value, value * shared.sigma, shared.telling, reason, own), crooked

    def _often_enough(self, shared: SharedFocalLength, count: int) -> bool:
        return shared.telling >= max(1.0, self.least_share * count)

    def _focal_fault(self, shared: SharedFocalLength, count: int) -> str:
        """Why the focal length is not told, empty when it is."""
        if not self._often_enough(shared, count):
            seen = "none" if not shared.telling else f"only {shared.telling}"
            return (
                f"{seen} of {count} pictures show two directions at right angles, both of them oblique; "
                "one vanishing point alone, or one looked at squarely, says nothing of the focal length"
            )
        if shared.agreement < self.least_agreement:
            return (
                f"the pictures contradict each other: {100 * shared.agreement:.0f} % agree on a focal length, "
                "so what they show is not built at right angles"
            )
        if not shared.sigma < self.most_doubt:
            return f"the pictures leave it open by {100 * shared.sigma:.0f} %"
        return ""

    def _mounting(self, pictures: Sequence[LineSegments], camera: Camera) -> Mounting:
        for _ in range(3):
            points = [self.estimator.estimate(lines, camera) for lines in pictures]
            found = find_mounting(points, camera.optical_to_base[2], self.lean)
            moved = max(abs(found.roll - camera.roll), abs(found.pitch - camera.pitch))
            camera = replace(camera, roll=found.roll, pitch=found.pitch)
            if moved < _FAR_FROM_GUESS:
                break
        return found

    def _roll(self, found: Mounting, crooked: bool, count: int) -> Finding:
        sigma = float(np.hypot(np.sqrt(found.covariance[0, 0]), self.squareness))
        return self._angle("roll", found.roll, sigma, found, crooked, count)

    def _pitch(self, found: Mounting, focal_doubt: float, crooked: bool, count: int) -> Finding:
        # A focal length longer by a share e moves a direction at angle p off the axis by e sin(2 p) / 2.
        sigma = float(np.sqrt(found.covariance[1, 1]))
        sigma = float(
            np.hypot(np.hypot(sigma, self.squareness), 0.5 * np.sin(2.0 * found.pitch) * focal_doubt)
        )
        return self._angle("pitch", found.pitch, sigma, found, crooked, count)

    def _angle(
        self, name: str, value: float, sigma: float, found: Mounting, crooked: bool, count: int
    ) -> Finding:
        axis = ("roll", "pitch").index(name)
        told = found.telling[axis]
        own = found.own[:, axis]
        fault = ""
        if crooked:
            fault = (
                f"{found.upright} of {count} pictures show upright lines, which is too few, "
                "and what else they show is not built at right angles"
            )
        elif told < self.least_level_share * count:
            needed = "upright lines" if name == "roll" else "upright lines or a level vanishing point ahead"
            fault = f"only {told} of {count} pictures tell of the {name}: it wants {needed}"
        elif found.agreement < self.least_agreement:
            share = 100 * found.agreement
            fault = f"the pictures contradict each other: {share:.0f} % agree on where upright is"
        elif not sigma < self.most_lean_doubt:
            open_by = np.degrees(min(sigma, np.pi))
            fault = f"the pictures leave it open by {open_by:.1f}°: it wants upright lines"
        if fault:
            return Finding(None, float("inf"), told, fault, own)
        return Finding(value, sigma, told, "the mean over the pictures, about which the body leans", own)

    def _heights(
        self,
        pictures: Sequence[LineSegments],
        stamps_s: Sequence[float],
        camera: Camera,
        pitch: Finding,
        lengths: KnownLengths,
        focal_doubt: float,
    ) -> list[Finding]:
        """One finding for each length of a corridor or of stones; without any, why there is no height."""
        built = (lengths.corridor_width, lengths.stone_width, lengths.stone_length)
        if not lengths.any:
            reason = "no length on the ground was given: a picture alone has no scale"
            return [Finding.missing(reason, len(pictures))]
        if not any(built):
            return [Finding.missing("the plants of the rows were not looked for", len(pictures))]
        if not pitch.known:
            return [Finding.missing("without the pitch no distance on the ground is known", len(pictures))]
        found = []
        if lengths.corridor_width is not None:
            found.append(height_from_corridor(pictures, stamps_s, camera, lengths.corridor_width))
        if lengths.stone_width is not None or lengths.stone_length is not None:
            found += height_from_stones(
                pictures, camera, self.estimator, lengths.stone_width, lengths.stone_length, focal_doubt
            )
        return found
