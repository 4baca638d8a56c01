# SPDX-License-Identifier: Apache-2.0
"""The parameters of the simulator, and the drive through a world that they ask for."""

from __future__ import annotations

from typing import Any

from robot_vision.ros.parameters import ParameterError, Setting
from robot_vision.simulation.asked import split_settings
from robot_vision.simulation.drive import VEHICLES
from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.head import HeadSettings
from robot_vision.simulation.live import LiveDrive, LiveSettings
from robot_vision.simulation.record import build_world
from robot_vision.simulation.vehicle import VehicleSettings

SIMULATOR_SETTINGS = (
    Setting("world", "corridor", "which world: corridor, path, road, field, maze, …", live=False),
    Setting("seed", 0, "of the world, of noise and leaning", 0, 2**31 - 1, live=False),
    Setting("settings", [""], "settings of the world, each as name=value", live=False),
    Setting("rate", 15, "pictures a second of simulated time; divides 600", 1, 60, live=False),
    Setting(
        "transport",
        "raw",
        "how pictures go out: raw or compressed",
        None,
        None,
        ("raw", "compressed"),
        False,
    ),
    Setting("quality", 90, "of compressed pictures", 1, 100, live=False),
    Setting("lockstep", False, "wait for the steering to each picture", live=False),
    Setting("lockstep_timeout", 2.0, "how long it is waited for, s", 0.001, 1e6, live=False),
    Setting("timeout", 0.5, "a steering older than this is not obeyed, simulated s", 0.01, 60.0, live=False),
    Setting("delay", 0.03, "from a picture until its steering takes effect, s", 0.0, 1.0, live=False),
    Setting("seconds", 0.0, "end after so long, simulated s; 0: with the lane", 0.0, 1e6, live=False),
    Setting("end_with_lane", True, "end where the lane is over, too", live=False),
    Setting("stand_limit", 0.0, "end after standing so long, simulated s; 0: never", 0.0, 1e6, live=False),
    Setting("start.offset", 0.0, "start so far left of the usual place, m", -100.0, 100.0, live=False),
    Setting("start.yaw", 0.0, "start turned by so much, rad, counter-clockwise", -3.2, 3.2, live=False),
    Setting("vehicle", "differential", "what is driven", None, None, VEHICLES, False),
    Setting("width", 0.0, "of the robot, m; 0: as the world has it", 0.0, 10.0, live=False),
    Setting("length", 0.0, "of the robot, m; 0: as the world has it", 0.0, 10.0, live=False),
    Setting("lean", 0.0, "greatest roll and pitch of the body while it drives, rad", 0.0, 0.5, live=False),
    Setting("roughness", 0.0, "standard deviation of the ground's height, m", 0.0, 0.2, live=False),
    Setting("noise", 1.0, "factor on the noise of camera and wheels; 0: none", 0.0, 20.0, live=False),
    Setting("head.on", False, "whether look_at turns the camera, on a pan-tilt head", live=False),
    Setting("head.most_pan", 1.2, "of that head to either side, rad", 0.01, 3.1, live=False),
    Setting("head.rate", 2.0, "greatest of its joints, rad/s", 0.01, 100.0, live=False),
    Setting("head.lag", 0.08, "time constant of its servos, s", 0.0, 5.0, live=False),
    Setting("settling", 5.0, "way that does not count for the offset's RMS, m", 0.0, 1e6, live=False),
    Setting("wait_for_nodes", [""], "nodes whose diagnostics must say that they are ready", live=False),
    Setting("wait_timeout", 10.0, "how long to wait for those who listen, s", 0.0, 1e6, live=False),
)


def drive_asked_for(given: dict[str, Any]) -> LiveDrive:
    """Build the world and put the vehicle into it.

    Args:
        given: value of each of `SIMULATOR_SETTINGS`, by name.

    Raises:
        ParameterError: the parameters ask for what cannot be.
    """
    try:
        world = build_world(given["world"], given["seed"], split_settings(given["settings"]))
        return LiveDrive(world, _live_settings(given, world.drive.speed), given["seed"])
    except SimulationError as refusal:
        raise ParameterError(str(refusal)) from refusal


def _live_settings(given: dict[str, Any], usual_speed: float) -> LiveSettings:
    able = VehicleSettings(kind=given["vehicle"], most_speed=max(3.0, 1.5 * usual_speed))
    return LiveSettings(
        rate=given["rate"],
        vehicle=able,
        offset=given["start.offset"],
        yaw=given["start.yaw"],
        lean=given["lean"],
        roughness=given["roughness"],
        noise=given["noise"],
        delay=given["delay"],
        timeout=given["timeout"],
        settling=given["settling"],
        width=given["width"] or None,
        length=given["length"] or None,
        head=HeadSettings(given["head.most_pan"], rate=given["head.rate"], lag=given["head.lag"])
        if given["head.on"]
        else None,
    )
