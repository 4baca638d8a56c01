# SPDX-License-Identifier: Apache-2.0
"""What the README promises is so: its parameters are those of the nodes, its commands those of the command line."""

from __future__ import annotations

import importlib
import json
import re
import shlex
from pathlib import Path

import pytest
import typer

from robot_vision.cli import app

README = (Path(__file__).resolve().parents[1] / "README.md").read_text(encoding="utf-8")
CLASSES = {
    "line_detector": "LineDetectorNode",
    "vp_estimator": "VpEstimatorNode",
    "corridor_steering": "CorridorSteeringNode",
    "maze_planner": "MazePlannerNode",
    "maze_runner": "MazeRunnerNode",
    "crop_row_steering": "CropRowSteeringNode",
    "plan_view_mapper": "PlanViewMapperNode",
    "bag_player": "BagPlayer",
    "bag_recorder": "BagRecorder",
    "simulator": "Simulator",
}


def parameter_tables() -> dict[str, dict[str, tuple[str, bool]]]:
    """Default and whether it is read at start only, by node and parameter, as the README has them."""
    section = README.split("<!-- parameters")[1].split("<!-- end of parameters")[0]
    tables: dict[str, dict[str, tuple[str, bool]]] = {}
    node = ""
    for row in re.findall(r"^\| (.*) \|$", section, re.MULTILINE):
        name, default, _ = (cell.strip() for cell in row.split("|", 2))
        if default == "default":
            node = name.strip("`")
            tables[node] = {}
        else:
            tables[node][name.rstrip("* ").strip("`")] = (default.strip("`"), name.endswith("*"))
    return tables


@pytest.mark.parametrize("node", CLASSES)
def test_parameters_are_those_of_the_node(node: str) -> None:
    pytest.importorskip("rclpy", reason="the nodes' parameters cannot be read without rclpy")
    module = importlib.import_module(f"robot_vision.nodes.{node}")
    settings = {setting.name: setting for setting in getattr(module, CLASSES[node]).SETTINGS}
    told = parameter_tables()[node]
    assert set(told) == set(settings)
    for name, (default, at_start_only) in told.items():
        setting = settings[name]
        empty = setting.default in ("", [""])
        assert default == ("" if empty else str(json.dumps(setting.default)).strip('"')), name
        assert at_start_only == (not setting.live), name


def commands() -> list[str]:
    blocks = re.findall(r"```\n(.*?)```", README, re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines()]
    lines += re.findall(r"`(robot-vision [^`]+)`", README)
    return [line for line in lines if line.startswith("robot-vision ")]


@pytest.mark.parametrize("line", commands())
def test_commands_exist_with_their_options(line: str) -> None:
    words = shlex.split(line)[1:]
    command = typer.main.get_command(app).get_command(None, words[0])  # type: ignore[attr-defined, arg-type]
    assert command is not None, f"there is no command {words[0]}"
    known = {option for parameter in command.params for option in parameter.opts}
    assert {word for word in words[1:] if re.match(r"--?[a-z]", word)} <= known


@pytest.mark.parametrize("target", ["demo", "test", "bench", "venv"])
def test_make_targets_exist(target: str) -> None:
    makefile = (Path(__file__).resolve().parents[1] / "Makefile").read_text(encoding="utf-8")
    assert f"make {target}" in README
    assert re.search(rf"^{target}:", makefile, re.MULTILINE)


def test_pictures_are_there() -> None:
    root = Path(__file__).resolve().parents[1]
    pictures = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", README)
    assert pictures
    for picture in pictures:
        assert (root / picture).is_file()
