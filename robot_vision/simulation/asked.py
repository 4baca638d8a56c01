# SPDX-License-Identifier: Apache-2.0
"""Turns what a person asked for, as name=value, into the settings of worlds, drives and recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

from robot_vision.simulation.errors import SimulationError

Value = bool | int | float | str
Settings = TypeVar("Settings")
_TRUTHS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}


def split_settings(texts: Sequence[str]) -> dict[str, Value]:
    """Split texts such as "width=2.4" at their first equals sign; empty texts are left out.

    Raises:
        SimulationError: one has none, or no name before it, or names a setting again.
    """
    found: dict[str, Value] = {}
    for text in texts:
        if not text.strip():
            continue
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not name:
            raise SimulationError(f"setting {text!r}: write it as name=value, for example width=2.4")
        if name in found:
            raise SimulationError(f"setting {name!r} is given twice")
        found[name] = value
    return found


def sort_out(whose: str, given: Mapping[str, Value], known: Sequence[type[Any]]) -> list[dict[str, Value]]:
    """Sort values by the first of several settings classes that has their name.

    Raises:
        SimulationError: a name that none of them has.
    """
    names = [{item.name for item in fields(kind)} for kind in known]
    sorted_out: list[dict[str, Value]] = [{} for _ in known]
    for name, value in given.items():
        owner = next((number for number, has in enumerate(names) if name in has), None)
        if owner is None:
            every = ", ".join(sorted(set().union(*names)))
            raise SimulationError(f"{whose} has no parameter {name!r}; it has: {every}")
        sorted_out[owner][name] = value
    return sorted_out


def settings_of(kind: type[Settings], given: Mapping[str, Value], usual: Settings | None = None) -> Settings:
    """Make settings from values or their texts; what is not given is as usual.

    Args:
        kind: a dataclass whose fields have defaults.
        given: by name of the field.
        usual: instead of the defaults.

    Raises:
        SimulationError: a text that is not of the field's type, or a value that `kind` refuses.
    """
    base: Any = kind() if usual is None else usual
    changes = {name: _converted(name, value, getattr(base, name)) for name, value in given.items()}
    changed: Settings = replace(base, **changes)
    return changed


def _converted(name: str, value: Value, usual: Any) -> Value:
    """A value of the type of the usual one."""
    if isinstance(usual, bool):
        return _truth(name, value)
    if isinstance(usual, int):
        return _whole(name, value)
    if isinstance(usual, float):
        return _number(name, value)
    return str(value)


def _truth(name: str, value: Value) -> bool:
    truth = _TRUTHS.get(str(value).lower())
    if truth is None:
        raise SimulationError(f"{name} must be true or false, not {value!r}")
    return truth


def _whole(name: str, value: Value) -> int:
    number = _number(name, value)
    if number != int(number):
        raise SimulationError(f"{name} must be a whole number, not {value!r}")
    return int(number)


def _number(name: str, value: Value) -> float:
    try:
        number = float(value)
    except ValueError:
        raise SimulationError(f"{name} must be a number, not {value!r}") from None
    if not -1e300 < number < 1e300:
        raise SimulationError(f"{name} must be a finite number, not {value!r}")
    return number
