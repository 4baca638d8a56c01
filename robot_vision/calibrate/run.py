# SPDX-License-Identifier: Apache-2.0
"""Runs a calibration from the bag to its files, its table and its plot."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from robot_vision.bags import BagError
from robot_vision.bags.calibration_files import write_camera_yaml, write_parameters_yaml
from robot_vision.calibrate.drive import Drive, read_drive
from robot_vision.calibrate.report import print_report, remarks_of
from robot_vision.geometry import Camera
from robot_vision.perception.calibration import CameraCalibration, CameraCalibrator, KnownLengths
from robot_vision.perception.calibration.lens import with_focal_length

if TYPE_CHECKING:
    from rich.console import Console

#: Rows are looked for in so many pictures at most: it takes long, and they hardly differ.
_MOST_GREEN = 40
Show = Callable[[int, int | None], None]
Shown = Callable[[str], AbstractContextManager[Show]]


@dataclass(frozen=True)
class Asked:
    """What a person asks for.

    Attributes:
        bag: the drive.
        out: folder for the results.
        calibration: as `read_calibration` takes it; None: the bag's own, if it has one.
        lengths: known on the ground.
        pitch: rad, where the search begins.
        most: pictures looked at.
    """

    bag: Path
    out: Path
    calibration: str | None = None
    lengths: KnownLengths = field(default_factory=KnownLengths)
    pitch: float = 0.0
    most: int = 600


def run_calibration(asked: Asked, console: Console, shown: Shown) -> bool:
    """Calibrate from a bag; leaves camera.yaml, parameters.yaml and calibration.png in a folder.

    Args:
        asked: what for.
        console: where the report goes.
        shown: opens a bar that shows how far something has come.

    Returns:
        whether anything was found.

    Raises:
        BagError: the bag cannot be used, or a file not be written.
    """
    from robot_vision.calibrate.plot import write_plot

    with shown("lines") as progress:
        most_green = 0 if asked.lengths.row_spacing is None else _MOST_GREEN
        drive = read_drive(asked.bag, asked.calibration, asked.most, progress, most_green)
    for warning in drive.warnings:
        console.print(f"warning: {warning}", markup=False)
    with shown("calibrating") as progress:
        found = CameraCalibrator().calibrate(
            drive.lines,
            replace(drive.camera, pitch=asked.pitch),
            drive.stamps_s,
            asked.lengths,
            drive.plants,
            progress,
        )
    print_report(found, console)
    try:
        asked.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BagError(f"cannot make the folder {asked.out}: {error.strerror}") from error
    _write_camera(asked.out / "camera.yaml", drive, found, console)
    _write_parameters(asked.out / "parameters.yaml", drive, found, console)
    write_plot(found, drive, asked.out / "calibration.png")
    console.print(f"{asked.out / 'calibration.png'}: what each picture says", markup=False)
    return any(finding.known for finding in (found.focal, found.roll, found.pitch, found.height))


def _write_camera(path: Path, drive: Drive, found: CameraCalibration, console: Console) -> None:
    camera: Camera | None = drive.camera
    origin = "the focal length given, since the pictures do not tell"
    if found.focal.value is not None:
        origin = "for camera_info_manager, or make-bag --calibration"
        camera = with_focal_length(drive.camera, found.focal.value / found.given.fx)
        if camera is None:
            camera = drive.camera
            origin = "the focal length given, which goes with its lens; see how it compares"
    if camera is None or not camera.focal_known:
        path.unlink(missing_ok=True)  # one of an earlier drive would be taken for the answer
        console.print(f"{path} is not written: the focal length is not known", markup=False)
        return
    write_camera_yaml(path, camera, remarks=remarks_of(found, str(drive.bag)))
    console.print(f"{path}: {origin}", markup=False)


def _write_parameters(path: Path, drive: Drive, found: CameraCalibration, console: Console) -> None:
    findings = {"camera.height": found.height, "camera.pitch": found.pitch, "camera.roll": found.roll}
    values = {name: finding.value for name, finding in findings.items() if finding.value is not None}
    if not values:
        path.unlink(missing_ok=True)
        console.print(f"{path} is not written: neither height nor lean is known", markup=False)
        return
    write_parameters_yaml(path, values, remarks_of(found, str(drive.bag)))
    console.print(f"{path}: {', '.join(values)}, for --ros-args --params-file", markup=False)
