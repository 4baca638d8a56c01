# SPDX-License-Identifier: Apache-2.0
"""Finds the files that come with the package (bags, config), in a clone and where it was installed."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).absolute().parent


class PlaceError(ValueError):
    """A file that comes with the package is not there; the text names it and where it was looked for."""


def source_tree() -> Path | None:
    """Return the root of the clone this package runs from; None if it was installed."""
    root = _PACKAGE.parent
    return root if (root / "setup.py").is_file() and (root / "package.xml").is_file() else None


def shared_file(name: str) -> Path:
    """Return a file of the package by its place in the clone, such as `bags/corridor.mcap`.

    In a clone it is there; pip and colcon put it into `share/robot_vision` of the prefix the package lies in
    (a virtual environment, `install/robot_vision`, `/usr/local`, …).

    Raises:
        PlaceError: it is in neither.
    """
    for prefix in _PACKAGE.parents:
        for candidate in (prefix / "share" / "robot_vision" / name, prefix / name):
            if candidate.is_file() and (candidate.parents[name.count("/")] / "package.xml").is_file():
                return candidate
    raise PlaceError(f"{name}, which comes with robot_vision, is missing; looked above {_PACKAGE}")
