# SPDX-License-Identifier: Apache-2.0
"""Looks over a machine before it drives: what is needed, whether it is there, what to try if not."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum
from importlib import metadata
from pathlib import Path

OLDEST_PYTHON, NEWEST_PYTHON = (3, 10), (3, 13)
SHARED_MEMORY = Path("/dev/shm")
SEGMENT_MB = 33.0  # what one process of the graph takes in shared memory with the profile of config/
PROCESSES = 5  # of the demo
LIBRARIES = ("numpy", "scipy", "numba", "filterpy", "rosbags", "mcap", "typer", "rich")


class Level(Enum):
    """How a finding reads: fine, will work but look at it, will not work."""

    FINE = "fine"
    LOOK = "look"
    BROKEN = "broken"


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at.

    Attributes:
        level: how bad it is.
        subject: what was looked at, in a word or two.
        text: what was found.
        advice: what to try; empty when all is well.
    """

    level: Level
    subject: str
    text: str
    advice: str = ""


def examine() -> Iterator[Finding]:
    """Look at everything, one finding after the other; nothing is changed on the machine."""
    yield python_version()
    yield from libraries()
    yield opencv()
    yield ros()
    yield middleware()
    yield shared_memory()
    yield domain()
    yield kernel_cache()


def python_version() -> Finding:
    """Is this a Python the package was tried with?"""
    version = sys.version_info[:2]
    text = f"{sys.version.split()[0]} ({sys.executable})"
    if OLDEST_PYTHON <= version <= NEWEST_PYTHON:
        return Finding(Level.FINE, "Python", text)
    return Finding(Level.BROKEN, "Python", text, "use Python 3.10 to 3.13: make venv PYTHON=python3.12")


def libraries() -> Iterator[Finding]:
    """Are the libraries there? OpenCV goes by several names and has its own question."""
    for name in LIBRARIES:
        try:
            yield Finding(Level.FINE, name, metadata.version(name))
        except metadata.PackageNotFoundError:
            yield Finding(Level.BROKEN, name, "is not installed", f"pip install {name}")


def opencv() -> Finding:
    """Does OpenCV load, and is it one that was tried?"""
    try:
        import cv2
    except ImportError as error:
        return Finding(
            Level.BROKEN, "OpenCV", f"does not load: {error}", "pip install opencv-python-headless"
        )
    major, minor = (int(part) for part in cv2.__version__.split(".")[:2])
    if (4, 6) <= (major, minor) < (6, 0):
        return Finding(Level.FINE, "OpenCV", cv2.__version__)
    return Finding(Level.LOOK, "OpenCV", f"{cv2.__version__} was never tried", "4.6 to 5 were")


def ros() -> Finding:
    """Can this process speak ROS?"""
    try:
        import rclpy
        from diagnostic_msgs.msg import DiagnosticArray  # noqa: F401
        from sensor_msgs.msg import Image  # noqa: F401
    except ImportError as error:
        text = f"does not load: {error}"
        if "_ROS_WHEELS_BOOTSTRAP_COMPLETE" in os.environ and "LD_LIBRARY_PATH" not in os.environ:
            advice = (
                "the variable _ROS_WHEELS_BOOTSTRAP_COMPLETE was handed on without LD_LIBRARY_PATH: "
                "unset it, or hand on the whole environment"
            )
        else:
            advice = "pip install 'robot_vision[ros]', or source /opt/ros/jazzy/setup.bash first"
        return Finding(Level.BROKEN, "ROS 2", text, advice)
    return Finding(Level.FINE, "ROS 2", f"rclpy from {Path(rclpy.__file__).parent}")


def middleware() -> Finding:
    """Is the middleware the one whose shared memory the profile widens?"""
    chosen = os.environ.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp")
    if chosen != "rmw_fastrtps_cpp":
        return Finding(
            Level.LOOK,
            "middleware",
            f"{chosen}: the profile for large pictures is written for rmw_fastrtps_cpp",
            "unset RMW_IMPLEMENTATION, or see to it that pictures over 0.5 MB arrive",
        )
    names = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
    profile = next((os.environ[name] for name in names if name in os.environ), None)
    if profile is None:
        return Finding(
            Level.FINE, "middleware", "Fast DDS; demo and run give their nodes the profile of config/"
        )
    if not Path(profile).is_file():
        text = f"Fast DDS, but its profile {profile} is missing"
        return Finding(Level.BROKEN, "middleware", text, f"unset {' '.join(names)}")
    return Finding(Level.FINE, "middleware", f"Fast DDS with the profile {profile}")


def shared_memory() -> Finding:
    """Is there room in shared memory for the pictures between the processes?"""
    if not SHARED_MEMORY.is_dir():
        text = f"there is no {SHARED_MEMORY}: pictures go by UDP"
        return Finding(Level.LOOK, "shared memory", text, "use the transport `compressed`")
    free = shutil.disk_usage(SHARED_MEMORY).free / 2**20
    left = [path.stat().st_size for path in SHARED_MEMORY.glob("fastrtps_*") if path.is_file()]
    text = f"{free:.0f} MB free, {len(left)} segments of Fast DDS hold {sum(left) / 2**20:.0f} MB"
    if free < SEGMENT_MB * PROCESSES:
        return Finding(
            Level.LOOK,
            "shared memory",
            f"{text}; {PROCESSES} nodes want {SEGMENT_MB * PROCESSES:.0f} MB",
            "in a container: --shm-size=512m; else stop old nodes, then `fastdds shm clean`",
        )
    return Finding(Level.FINE, "shared memory", text)


def domain() -> Finding:
    """Who else may be heard?"""
    number = os.environ.get("ROS_DOMAIN_ID", "0")
    reach = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    if not number.isdigit() or int(number) > 232:
        return Finding(Level.BROKEN, "domain", f"ROS_DOMAIN_ID is {number!r}", "give a number from 0 to 101")
    return Finding(Level.FINE, "domain", f"ROS_DOMAIN_ID {number}, discovery {reach}")


def kernel_cache() -> Finding:
    """Can compiled kernels be kept, so that nodes start at once the next time?"""
    try:
        folder = cache_folder()
    except RuntimeError as error:
        return Finding(
            Level.BROKEN,
            "kernel cache",
            f"compiled kernels cannot be kept: {error}",
            "set NUMBA_CACHE_DIR to a folder that can be written to",
        )
    count = len(list(folder.glob("*.nbc")))
    if count == 0:
        text = f"{folder} holds no kernel yet"
        return Finding(Level.LOOK, "kernel cache", text, "robot-vision doctor --warm")
    return Finding(Level.FINE, "kernel cache", f"{count} compiled kernels in {folder}")


def cache_folder() -> Path:
    """Return where numba keeps the line detector's kernels.

    Raises:
        RuntimeError: numba finds no folder it may write to.
    """
    from robot_vision.perception import edges

    kernel = next(value for value in vars(edges).values() if hasattr(value, "py_func"))
    return Path(kernel.stats.cache_path)


def warm_steps() -> list[tuple[str, Callable[[], None]]]:
    """Return what there is to compile, each with its name; once run, it is kept on disk."""
    return [
        ("lines", _find_lines),
        ("vanishing points", _find_vanishing_points),
        ("plan view", _draw_plan),
        ("planning", _plan),
        ("mazes", _explore),
        ("crop rows", _find_crop_rows),
        ("plants", _find_plants),
    ]


def _find_lines() -> None:
    from robot_vision.perception import LineDetector

    LineDetector().warm_up()


def _draw_plan() -> None:
    from robot_vision.mapping import PlanViewMapper

    PlanViewMapper().warm_up()


def _find_crop_rows() -> None:
    from robot_vision.perception import CropRowDetector

    CropRowDetector().warm_up()


def _find_plants() -> None:
    from robot_vision.perception.crop_rows.plant_blobs import PlantSegmenter

    PlantSegmenter().warm_up()


def _explore() -> None:
    from robot_vision.planning import Maze, MazeExplorer

    MazeExplorer(Maze.parse("+---+---+\n| S   G |\n+---+---+\n")).explore()


def _find_vanishing_points() -> None:
    from robot_vision.perception import VanishingPointEstimator

    VanishingPointEstimator().warm_up()


def _plan() -> None:
    from robot_vision.planning.path import warm_up

    warm_up()
