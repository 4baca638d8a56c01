# SPDX-License-Identifier: Apache-2.0
"""A calibration in words: a table for the terminal, and the same as comments in the files."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from robot_vision.perception.calibration import CameraCalibration, Finding

if TYPE_CHECKING:
    from rich.console import Console


@dataclass(frozen=True)
class Line:
    """One quantity for people.

    Attributes:
        name: what it is.
        finding: in the library's unit.
        unit: for people.
        factor: from the library's unit to that.
        digits: after the point.
        given: what was given before, in the library's unit; None when nothing was.
    """

    name: str
    finding: Finding
    unit: str
    factor: float
    digits: int
    given: float | None

    @property
    def value(self) -> str:
        """The answer with its unit."""
        if self.finding.value is None:
            return "not told"
        return f"{self.finding.value * self.factor:.{self.digits}f}{self.unit}"

    @property
    def sigma(self) -> str:
        """How sure it is."""
        if not self.finding.known:
            return ""
        return f"± {self.finding.sigma * self.factor:.{self.digits}f}{self.unit}"

    @property
    def before(self) -> str:
        """What was given."""
        return "" if self.given is None else f"{self.given * self.factor:.{self.digits}f}{self.unit}"


def lines_of(calibration: CameraCalibration) -> Iterator[Line]:
    """Yield the four quantities in the order in which they are found."""
    given = calibration.given
    degrees = math.degrees(1.0)
    focal = given.fx if given.focal_known else None
    yield Line("focal length", calibration.focal, " px", 1.0, 1, focal)
    yield Line("roll", calibration.roll, "°", degrees, 2, None)
    yield Line("pitch", calibration.pitch, "°", degrees, 2, None)
    yield Line("height", calibration.height, " m", 1.0, 3, None)


def print_report(calibration: CameraCalibration, console: Console) -> None:
    """Print what was found, how sure it is, and why something was not."""
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=f"camera, as {calibration.pictures} pictures tell", title_justify="left")
    table.add_column("")
    for name in ("found", "how sure", "given", "told by"):
        table.add_column(name, justify="right", no_wrap=True)
    for line in lines_of(calibration):
        value = line.value if line.finding.known else f"[yellow]{line.value}[/]"
        table.add_row(line.name, value, line.sigma, line.before, str(line.finding.told_by))
    console.print(table)
    for line in lines_of(calibration):
        console.print(escape(f"{line.name}: {line.finding.reason}"))


def remarks_of(calibration: CameraCalibration, bag: str) -> list[str]:
    """Return the same as lines of comment for a file."""
    remarks = [f"robot-vision calibrate {bag}: {calibration.pictures} pictures"]
    for line in lines_of(calibration):
        if line.finding.known:
            remarks.append(f"{line.name} {line.value} {line.sigma}")
        else:
            remarks.append(f"{line.name} not told: {line.finding.reason}")
    return remarks
