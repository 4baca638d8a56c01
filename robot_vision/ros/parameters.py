# SPDX-License-Identifier: Apache-2.0
"""Parameters declared once, with type, range and description; what makes no sense is refused in words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

Value = bool | int | float | str | Sequence[str]
Values = Mapping[str, Any]

_KINDS = {bool: "true or false", int: "a whole number", float: "a number such as 1.0", str: "a text"}


class ParameterError(ValueError):
    """A parameter has a value that makes no sense; the text names it and the reason."""


@dataclass(frozen=True)
class Setting:
    """A parameter of a node.

    Attributes:
        name: as in `-p name:=value`.
        default: also tells the type.
        description: one line, with the unit.
        low, high: limits that belong to the range; both are given, or neither.
        choices: the texts allowed; () for any.
        live: whether it may change while the node runs.
    """

    name: str
    default: Value
    description: str
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    live: bool = True

    @property
    def descriptor(self) -> ParameterDescriptor:
        """The ROS descriptor, which tools such as `ros2 param describe` show."""
        descriptor = ParameterDescriptor(description=self.description, read_only=not self.live)
        if self.choices:
            descriptor.additional_constraints = f"one of {', '.join(self.choices)}"
        if self.low is None or self.high is None:
            return descriptor
        if isinstance(self.default, float):
            limits = FloatingPointRange(from_value=float(self.low), to_value=float(self.high), step=0.0)
            descriptor.floating_point_range = [limits]
        else:
            descriptor.integer_range = [
                IntegerRange(from_value=int(self.low), to_value=int(self.high), step=0)
            ]
        return descriptor

    def check(self, value: Any) -> None:
        """Refuse a value that is not this parameter's.

        Raises:
            ParameterError: naming the parameter and the reason.
        """
        kind = type(self.default)
        if kind in _KINDS and type(value) is not kind:
            raise ParameterError(f"{self.name} must be {_KINDS[kind]}, not {value!r}")
        if kind is list and not (isinstance(value, list) and all(isinstance(each, str) for each in value)):
            raise ParameterError(f"{self.name} must be a list of texts such as ['a', 'b'], not {value!r}")
        if isinstance(value, float) and not math.isfinite(value):
            raise ParameterError(f"{self.name} must be a finite number, not {value}")
        if self.low is not None and self.high is not None and not self.low <= value <= self.high:
            limits = f"between {self.low:g} and {self.high:g}"
            raise ParameterError(f"{self.name} must lie {limits}, not {value:g}")
        if self.choices and value not in self.choices:
            raise ParameterError(f"{self.name} must be one of {', '.join(self.choices)}, not {value!r}")


#: Where the camera sits on the robot: the same four for every node that looks down at the floor.
CAMERA_PLACE = (
    Setting("camera.height", 0.0, "height of the camera over the ground, m; 0: not known", 0.0, 100.0),
    Setting("camera.pitch", 0.0, "pitch of the camera, rad; positive looks down", -1.6, 1.6),
    Setting("camera.roll", 0.0, "roll of the camera, rad; positive lifts its left side", -3.2, 3.2),
    Setting("camera.x", 0.0, "how far the camera sits ahead of base_link, m", -100.0, 100.0),
)


def camera_place(values: Values) -> dict[str, Any]:
    """Turn the four parameters of `CAMERA_PLACE` into keyword arguments of `Camera.from_camera_info`."""
    return {
        "height_m": values["camera.height"] or None,
        "pitch": values["camera.pitch"],
        "roll": values["camera.roll"],
        "x_m": values["camera.x"],
    }


def declare(node: Node, settings: Sequence[Setting]) -> dict[str, Any]:
    """Declare parameters on a node and read what the user gave for them.

    Returns:
        The value of each by its name.

    Raises:
        ParameterError: the user gave a value of the wrong type or outside its range.
    """
    values = {}
    for setting in settings:
        # asked for before rclpy refuses it in its own words; there is no public way to ask
        given = node._parameter_overrides.get(setting.name)
        if given is not None:
            setting.check(given.value)
        values[setting.name] = node.declare_parameter(setting.name, setting.default, setting.descriptor).value
    return values


def changed(settings: Sequence[Setting], values: Values, parameters: Sequence[Parameter]) -> dict[str, Any]:
    """Give the values after a change of some parameters; foreign ones, such as `use_sim_time`, are left out.

    Raises:
        ParameterError: a new value makes no sense.
    """
    known = {setting.name: setting for setting in settings}
    after = dict(values)
    for parameter in parameters:
        if parameter.name in known:
            known[parameter.name].check(parameter.value)
            after[parameter.name] = parameter.value
    return after
