# SPDX-License-Identifier: Apache-2.0
"""What launch files say stands elsewhere too, where nobody launches: both say the same. It needs no launch."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from bench.maze_drives import planner_settings  # noqa: E402  (the benchmarks are not installed)
from robot_vision.demo.maze_drive import drive_settings  # noqa: E402  (after them)
from robot_vision.simulation.maze import MazeSettings, maze  # noqa: E402  (after them)


class Said:
    """Whatever of launch is called, it keeps what it is called with."""

    def __init__(self, *what: Any, **more: Any) -> None:
        self.what, self.more = what, more


class Stand(ModuleType):
    """A module of launch, in which every name is a class of its own."""

    def __getattr__(self, name: str) -> type[Said]:
        if name.startswith("__"):
            raise AttributeError(name)
        made = type(name, (Said,), {})
        setattr(self, name, made)
        return made


MODULES = (
    "launch",
    "launch.actions",
    "launch.conditions",
    "launch.event_handlers",
    "launch.events",
    "launch.substitutions",
    "launch_ros",
    "launch_ros.actions",
    "launch_ros.parameter_descriptions",
)


def parameters(file: str, monkeypatch: pytest.MonkeyPatch, **given: str) -> dict[str, dict[str, Any]]:
    """Parameters by executable of a launch file that is given these arguments, the others as they are by default."""
    for name in MODULES:
        monkeypatch.setitem(sys.modules, name, Stand(name))
    launched = runpy.run_path(str(ROOT / "launch" / file))
    arguments = {name: default for name, default, _ in launched["ARGUMENTS"]} | given

    def value(said: Any) -> Any:
        kind = type(said).__name__
        if kind == "LaunchConfiguration":
            return arguments[said.what[0]]
        if kind == "PythonExpression":
            return eval("".join(str(value(part)) for part in said.what[0]))
        if kind == "ParameterValue":
            of, told = said.more["value_type"], value(said.what[0])
            return of(told) if of in (int, float) else told
        return said

    (description,) = launched["generate_launch_description"]().what
    return {
        entity.more["executable"]: {
            name: value(said) for part in entity.more["parameters"] for name, said in part.items()
        }
        for entity in description
        if type(entity).__name__ == "Node"
    }


def test_a_maze_by_camera_is_launched_as_it_is_demonstrated(monkeypatch: pytest.MonkeyPatch) -> None:
    cell = 0.5
    launched = parameters("maze_camera.launch.py", monkeypatch, cell=str(cell))
    world = maze(MazeSettings(rows=2, columns=2, cell=cell), 0)
    place = {"camera.height": world.camera.height_m, "camera.pitch": world.camera.pitch}
    place["camera.x"] = world.camera.x_m
    grows = ("speed", "lookahead", "most_acceleration")
    told = drive_settings("maze_runner")
    runner = {**told, **{name: told[name] * cell for name in grows}, **place}
    mapper = {**drive_settings("plan_view_mapper"), **place, "robot.width": world.robot_width}
    for node, expected in (("maze_runner", runner), ("plan_view_mapper", mapper), ("vp_estimator", place)):
        said = {name: launched[node][name] for name in expected}
        assert said == pytest.approx(expected, abs=1e-4)


def test_a_maze_by_its_plan_is_launched_as_the_benchmark_drives_it(monkeypatch: pytest.MonkeyPatch) -> None:
    launched = parameters("maze.launch.py", monkeypatch, cell="0.5")["maze_planner"]
    expected = planner_settings(0.5)
    assert {name: launched[name] for name in expected} == pytest.approx(expected)
