# SPDX-License-Identifier: Apache-2.0
"""The house rules that no type checker sees: who may import whom, what is declared, what an import costs."""

from __future__ import annotations

import ast
import configparser
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

import pytest

import robot_vision

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "robot_vision"

ROOMS = (
    "geometry",
    "perception",
    "mapping",
    "planning",
    "control",
    "bags",
    "simulation",
    "ros",
    "nodes",
    "cli",
)
FRONT_DOOR = {
    "calibrate": "cli",
    "commands": "cli",
    "demo": "cli",
    "doctor": "cli",
    "places": "cli",
    "viewer": "cli",
}  # modules beside the rooms that count as one of them
FOUNDATION = {"places"}  # modules beside the rooms that know nobody, and that everybody may know
WITH_ROS = {"ros", "nodes", "cli"}
ROS_PACKAGES = {
    "ament_index_python",
    "builtin_interfaces",
    "diagnostic_msgs",
    "geometry_msgs",
    "nav_msgs",
    "rcl_interfaces",
    "rclpy",
    "rosgraph_msgs",
    "rpyutils",
    "sensor_msgs",
    "std_msgs",
    "std_srvs",
}
VAGUE_NAMES = {"utils", "util", "helpers", "helper", "common", "misc", "tools"}
DISTRIBUTIONS = {
    "rerun": "rerun-sdk",
    "cv2": "opencv-python-headless",
    "ruamel": "ruamel.yaml",
}  # where the import and the requirement differ in name


def modules() -> list[Path]:
    """Every module of the package, tests and build output aside."""
    found = sorted(path for path in PACKAGE.rglob("*.py") if "__pycache__" not in path.parts)
    assert len(found) > 10, f"the package seems to be missing from {PACKAGE}"
    return found


def dotted(path: Path) -> str:
    """The name under which a file of the package is imported."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def room_of(module: str) -> str | None:
    """The room of a dotted module name; None for the package itself and its foundation."""
    parts = module.split(".")
    if len(parts) == 1 or parts[1] in FOUNDATION:
        return None
    return FRONT_DOOR.get(parts[1], parts[1])


def imports_of(path: Path) -> Iterator[tuple[int, str]]:
    """Line and absolute dotted name of every import in a file, those inside functions included."""
    here = dotted(path).split(".")
    package = here if path.name == "__init__.py" else here[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            name = ".".join([*base, *([node.module] if node.module else [])])
            if name == "robot_vision":
                for alias in node.names:
                    known = alias.name in ROOMS or alias.name in FRONT_DOOR
                    yield node.lineno, f"{name}.{alias.name}" if known else name
            else:
                yield node.lineno, name


def top(name: str) -> str:
    return name.partition(".")[0]


def where(path: Path, line: int) -> str:
    return f"{path.relative_to(ROOT)}:{line}"


def test_the_rooms_of_the_first_path_are_there() -> None:
    there = {room_of(dotted(path)) for path in modules()} - {None}
    assert there <= set(ROOMS), f"rooms the design does not know: {sorted(map(str, there - set(ROOMS)))}"
    assert there >= {"geometry", "perception", "control", "bags", "simulation", "ros", "nodes", "cli"}


def test_imports_point_one_way() -> None:
    against = []
    for path in modules():
        room = room_of(dotted(path))
        for line, name in imports_of(path):
            target = room_of(name) if top(name) == "robot_vision" else None
            if target is None or target == room:
                continue
            if room is None or ROOMS.index(target) > ROOMS.index(room):
                against.append(f"{where(path, line)} imports {name}")
    assert not against, "imports against the order of the rooms:\n" + "\n".join(against)


def test_geometry_needs_numpy_and_nothing_else() -> None:
    foreign = [
        f"{where(path, line)} imports {name}"
        for path in modules()
        if room_of(dotted(path)) == "geometry"
        for line, name in imports_of(path)
        if top(name) not in {"numpy", "robot_vision", *sys.stdlib_module_names}
    ]
    assert not foreign, "\n".join(foreign)


def test_only_the_doors_know_ros() -> None:
    leaks = [
        f"{where(path, line)} imports {name}"
        for path in modules()
        if room_of(dotted(path)) not in WITH_ROS
        for line, name in imports_of(path)
        if top(name) in ROS_PACKAGES
    ]
    assert not leaks, "\n".join(leaks)


def test_no_room_and_no_module_has_a_vague_name() -> None:
    vague = [path for path in modules() if VAGUE_NAMES & {path.stem, path.parent.name}]
    assert not vague


def run_python(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run code in a fresh interpreter with this one's environment (rclpy's wheels need it whole)."""
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


WITHOUT_ROS = """
import importlib, sys
ros = set(sys.argv[1].split(","))
class NoRos:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ros:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, NoRos())
try:
    import rclpy
except ModuleNotFoundError:
    pass
else:
    sys.exit("rclpy is not blocked")
for module in sys.argv[2:]:
    importlib.import_module(module)
"""


def test_the_library_and_the_command_line_import_without_ros() -> None:
    free = [dotted(path) for path in modules() if room_of(dotted(path)) not in {"ros", "nodes"}]
    free = [module for module in free if not module.endswith(".__main__")]
    run = run_python(WITHOUT_ROS, ",".join(sorted(ROS_PACKAGES)), *free)
    assert run.returncode == 0, run.stderr


HEAVY = """
import importlib, sys
heavy = sys.argv[1].split(",")
for module in sys.argv[2:]:
    importlib.import_module(module)
    loaded = [name for name in heavy if name in sys.modules]
    if loaded:
        sys.exit(f"importing {module} has loaded {', '.join(loaded)}")
"""


@pytest.mark.parametrize(
    "room", ["geometry", "perception", "planning", "mapping", "control", "bags", "simulation"]
)
def test_a_room_of_the_library_imports_fast(room: str) -> None:
    if not list((PACKAGE / room).glob("*.py")):
        assert room in {"mapping", "planning"}, f"{room} is empty"
        return
    run = run_python(HEAVY, "numba,matplotlib,rosbags,pandas,rich,typer,scipy", f"robot_vision.{room}")
    assert run.returncode == 0, run.stderr


def test_who_only_plans_need_not_load_what_sees() -> None:
    run = run_python(HEAVY, "robot_vision.perception,robot_vision.mapping", "robot_vision.planning")
    assert run.returncode == 0, run.stderr


def test_the_command_line_imports_fast() -> None:
    run = run_python(HEAVY, "numba,matplotlib,rosbags,cv2,scipy,numpy,rclpy", "robot_vision.cli")
    assert run.returncode == 0, run.stderr


def setup_cfg() -> configparser.ConfigParser:
    parser = configparser.ConfigParser()
    parser.optionxform = str  # type: ignore[method-assign,assignment]
    parser.read(ROOT / "setup.cfg", encoding="utf-8")
    return parser


def lines_of(option: str) -> list[str]:
    return [line.strip() for line in option.splitlines() if line.strip()]


def manifest() -> ElementTree.Element:
    return ElementTree.parse(ROOT / "package.xml").getroot()


def test_the_manifest_makes_this_an_ament_python_package() -> None:
    root = manifest()
    assert root.tag == "package"
    assert root.get("format") == "3"
    assert root.findtext("name") == "robot_vision" == setup_cfg()["metadata"]["name"]
    assert root.findtext("export/build_type") == "ament_python"
    assert root.findtext("description")
    maintainer = root.find("maintainer")
    assert maintainer is not None
    assert re.fullmatch(r"[\w.+-]+@[\w-]+(\.[\w-]+)+", maintainer.get("email", ""))
    assert root.findtext("license") == "Apache-2.0" == setup_cfg()["metadata"]["license"]
    for child in root:
        assert child.text is None or child.text == child.text.strip() or len(child), child.tag


def test_the_version_is_told_once() -> None:
    assert manifest().findtext("version") == robot_vision.__version__
    assert setup_cfg()["metadata"]["version"] == "attr: robot_vision.__version__"


def test_the_manifest_names_the_message_packages_that_are_used() -> None:
    declared = {element.text for element in manifest().iter("exec_depend")}
    used = {top(name) for path in modules() for _, name in imports_of(path)} & ROS_PACKAGES
    assert used <= declared, f"missing in package.xml: {sorted(used - declared)}"


def test_every_library_that_is_imported_is_declared() -> None:
    declared = [
        *lines_of(setup_cfg()["options"]["install_requires"]),
        *lines_of(setup_cfg()["options.extras_require"]["viewer"]),
    ]
    required = {re.split(r"[^\w.-]", line)[0] for line in declared}
    used = {
        DISTRIBUTIONS.get(top(name), top(name))
        for path in modules()
        for _, name in imports_of(path)
        if top(name) not in {"robot_vision", *sys.stdlib_module_names, *ROS_PACKAGES}
    }
    assert used == required, f"undeclared: {sorted(used - required)}, unused: {sorted(required - used)}"


def test_every_requirement_has_both_ends() -> None:
    for line in lines_of(setup_cfg()["options"]["install_requires"]):
        assert re.search(r">=[\d.]+,<[\d.]+$", line), line


def test_every_executable_has_its_module_and_every_node_its_executable() -> None:
    scripts = dict(
        re.split(r"\s*=\s*", line, maxsplit=1)
        for line in lines_of(setup_cfg()["options.entry_points"]["console_scripts"])
    )
    assert scripts.pop("robot-vision") == "robot_vision.cli:main"
    assert scripts == {name: f"robot_vision.nodes.{name}:main" for name in scripts}
    with_main = {
        path.stem
        for path in (PACKAGE / "nodes").glob("*.py")
        if any(
            isinstance(node, ast.FunctionDef) and node.name == "main"
            for node in ast.parse(path.read_text(encoding="utf-8")).body
        )
    }
    assert set(scripts) == with_main


def test_every_source_file_names_its_licence() -> None:
    folders = ("robot_vision", "test", "launch", "bench")
    files = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    without = [
        str(path.relative_to(ROOT))
        for path in [*files, ROOT / "setup.py"]
        if "SPDX-License-Identifier: Apache-2.0" not in path.read_text(encoding="utf-8")[:200]
    ]
    assert not without, "no SPDX line: " + ", ".join(without)
