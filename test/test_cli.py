# SPDX-License-Identifier: Apache-2.0
"""The command line as a person meets it: what it lists, how it refuses, what it says about the machine."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from robot_vision import __version__, cli, doctor, places, simulation
from robot_vision.bags import BagReader, BagWriter, messages, score_heading
from robot_vision.ros.domains import FreeDomain

ROOT = Path(__file__).resolve().parents[1]
COMMANDS = {
    "demo",
    "run",
    "play",
    "record",
    "make-bag",
    "simulate",
    "calibrate",
    "centres",
    "bench",
    "doctor",
    "view",
}


def robot_vision(*arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run the command as a process of its own, as the console script does."""
    return subprocess.run(
        [sys.executable, "-c", "from robot_vision.cli import main; main()", *map(str, arguments)],
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


def refused(*arguments: str | Path) -> str:
    """The one line with which a command refuses; fails if it is anything else."""
    run = robot_vision(*arguments)
    assert run.returncode == 2, run.stderr
    assert "Traceback" not in run.stderr
    lines = run.stderr.strip().splitlines()
    assert len(lines) == 1, run.stderr
    assert lines[0].startswith("robot-vision: ")
    return lines[0]


def pictures(folder: Path, count: int) -> Path:
    folder.mkdir()
    for number in range(count):
        assert cv2.imwrite(str(folder / f"{number:03}.png"), np.full((48, 64, 3), 20 * number, np.uint8))
    return folder


def test_every_command_is_listed_and_explains_itself() -> None:
    runner = CliRunner()
    listed = {command.name or command.callback.__name__ for command in cli.app.registered_commands}  # type: ignore[union-attr]
    assert listed == COMMANDS
    for command in sorted(COMMANDS - {"bench"}):
        result = runner.invoke(cli.app, [command, "--help"])
        assert result.exit_code == 0, result.output
        assert "Usage" in result.output


def test_it_knows_its_version() -> None:
    run = robot_vision("--version")
    assert (run.returncode, run.stdout.strip()) == (0, f"robot_vision {__version__}")


def test_make_bag_makes_a_bag_that_can_be_read(tmp_path: Path) -> None:
    bag = tmp_path / "a.mcap"
    run = robot_vision(
        "make-bag", pictures(tmp_path / "in", 3), "-o", bag, "--calibration", "50,50,31.5,23.5", "--rate", "5"
    )
    assert run.returncode == 0, run.stderr
    assert "3 pictures 64 x 48" in run.stdout
    topics = BagReader(bag).topics
    assert {name: info.count for name, info in topics.items()} == {"/camera_info": 3, "/image/compressed": 3}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("make-bag", "no/such/folder", "-o", "x.mcap"), "no/such/folder"),
        (("simulate", "moon"), "'moon'"),
        (("simulate", "--set", "colour=3", "-o", "x.mcap"), "'colour'"),
        (("demo", "--bag", "no/such.mcap"), "no/such.mcap"),
        (("demo", "--live", "moon"), "there is no world 'moon'"),
        (("demo", "--height", "nan"), "the camera must be 0 m or more"),
        (("demo", "--pitch", "120"), "-90 to 90 degrees, not 120"),
        (("simulate", "-o", "no/such/folder/x.png"), "no/such/folder/x.png"),
        (("play", "no/such.mcap"), "no/such.mcap"),
        (("centres", "no/such.png"), "no/such.png"),
        (("centres", "setup.cfg", "--line", "0,0,1"), "no picture"),
        (("centres", "docs/worlds/plate.png", "--calibration", "460,460,319.5"), "calibration"),
        (("centres", "docs/worlds/plate.png", "--normal", "0,0"), "normal must be three numbers"),
    ],
)
def test_what_cannot_be_done_is_refused_in_one_line(arguments: tuple[str, ...], words: str) -> None:
    assert words in refused(*arguments)


def test_centres_of_a_plate_are_told_and_drawn(tmp_path: Path) -> None:
    plate, drawing = tmp_path / "plate.png", tmp_path / "centres.png"
    assert robot_vision("simulate", "plate", "--seconds", "2", "-o", plate).returncode == 0
    run = robot_vision("centres", plate, "--calibration", "460,460,319.5,239.5", "-o", drawing)
    assert run.returncode == 0, run.stderr
    plane, head, *rows, last = run.stdout.splitlines()
    assert "circles tell it" in plane and "shift" in head and last == f"{drawing}: 12 centres"
    assert len(rows) == 12
    assert max(float(row.split()[4]) for row in rows) > 0.5
    picture = cv2.imread(str(drawing))
    assert picture is not None and picture.shape == (960, 1280, 3)
    assert "nothing tells how the plane lies" in refused("centres", plate)
    run = robot_vision("centres", plate, "--line", "0,1,-240")
    assert run.returncode == 0, run.stderr
    assert "left out: the ellipse at" in run.stdout
    assert "'.xyz'" in refused("centres", plate, "--line", "0,0,1", "-o", tmp_path / "a.xyz")


def test_the_demonstration_leaves_report_picture_film_and_bag(tmp_path: Path) -> None:
    drive, out = tmp_path / "drive.mcap", tmp_path / "out"
    count = simulation.record("corridor", drive, seconds=2.0).pictures
    run = robot_vision("demo", "--bag", drive, "--out", out)
    assert run.returncode == 0, run.stderr
    assert f"answered  {count} of {count} pictures" in run.stdout
    score = score_heading(out / "demo.mcap", drive)
    assert score.answers == count
    assert score.yaw_rms_deg < 0.3  # what the project asks of the corridor
    assert score.offset.rms < 0.05
    picture = cv2.imread(str(out / "demo.png"))
    assert picture is not None and picture.shape[1] > 1000
    film = cv2.VideoCapture(str(out / "demo.mp4"))
    assert int(film.get(cv2.CAP_PROP_FRAME_COUNT)) == count
    assert film.read()[0]


def test_the_answers_never_take_the_place_of_the_bag(tmp_path: Path) -> None:
    bag = tmp_path / "demo.mcap"
    simulation.record("corridor", bag, seconds=0.5)
    before = bag.read_bytes()
    assert "write the answers elsewhere" in refused("demo", "--bag", bag, "--out", tmp_path)
    assert bag.read_bytes() == before


def test_a_bag_without_pictures_is_no_demonstration(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "a.mcap") as bag:
        bag.write("/odom", "nav_msgs/msg/Odometry", 1, messages.odometry(1, (0, 0, 0), (0, 0, 0, 1)))
    assert "no pictures" in refused("demo", "--bag", tmp_path / "a.mcap", "--out", tmp_path / "out")


def test_the_graph_runs_until_it_is_told_to_end(tmp_path: Path) -> None:
    with FreeDomain() as domain:
        process = subprocess.Popen(
            [sys.executable, "-c", "from robot_vision.cli import main; main()", "run"],
            cwd=ROOT,
            env={
                **os.environ,
                "ROS_DOMAIN_ID": str(domain.id),
                "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
                "PYTHONUNBUFFERED": "1",
            },
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        assert process.stdout is not None
        up: set[str] = set()
        for line in process.stdout:
            up |= {
                name
                for name in ("line_detector", "vp_estimator", "corridor_steering")
                if f"[{name}]: up" in line
            }
            if len(up) == 3:
                break
        assert len(up) == 3
        process.send_signal(signal.SIGINT)
        rest = process.communicate(timeout=60)[0]
    assert process.returncode == 0, rest


def test_bad_pictures_and_bad_transport_are_named(tmp_path: Path) -> None:
    folder = pictures(tmp_path / "in", 1)
    assert "'jpg'" in refused("make-bag", folder, "-o", tmp_path / "a.mcap", "--transport", "jpg")
    (folder / "000.png").write_bytes(b"no picture")
    assert "000.png" in refused("make-bag", folder, "-o", tmp_path / "a.mcap")
    assert not (tmp_path / "a.mcap").exists()


def test_the_live_demonstration_drives_and_leaves_the_same_things(tmp_path: Path) -> None:
    run = robot_vision("demo", "--live", "corridor", "--seconds", "2", "--out", tmp_path)
    assert run.returncode == 0, run.stderr
    assert "truth" in run.stdout and "touched" not in run.stdout
    assert {path.name for path in tmp_path.iterdir()} == {"demo.png", "demo.mp4", "demo.mcap"}
    topics = BagReader(tmp_path / "demo.mcap").topics
    assert topics["/image/compressed"].count >= 28
    assert {"/heading", "/steering", "/truth/heading", "/truth/map", "/odom"} <= set(topics)


def test_the_maze_demonstration_explores_and_draws_what_it_knows(tmp_path: Path) -> None:
    run = robot_vision("demo", "--live", "maze", "--seed", "5", "--seconds", "4", "--out", tmp_path)
    assert run.returncode == 0, run.stderr
    assert "looks for the goal" in run.stdout
    assert "not run to its end within 4 s" in run.stdout and "touched" not in run.stdout
    assert {path.name for path in tmp_path.iterdir()} == {"demo.png", "demo.mcap"}
    topics = BagReader(tmp_path / "demo.mcap").topics
    assert topics["/steering"].count >= 20
    assert {"/maze", "/pose", "/plan_view", "/truth/odom"} <= set(topics)
    drawn = cv2.imread(str(tmp_path / "demo.png"))
    assert drawn.shape[0] == 480 and drawn.shape[1] > 640 + 400


@pytest.mark.parametrize(
    ("setting", "words"), [("width", "width=2.4"), ("width=wide", "width must be a number, not 'wide'")]
)
def test_a_setting_that_is_none_is_explained(setting: str, words: str) -> None:
    assert words in refused("simulate", "--set", setting, "-o", "x.mcap")


def test_a_defect_keeps_its_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> None:
        raise ValueError("operands could not be broadcast together")

    monkeypatch.setattr(cli, "app", broken)
    with pytest.raises(ValueError, match="broadcast"):
        cli.main()


def test_the_doctor_finds_this_machine_fit() -> None:
    findings = list(doctor.examine())
    broken = [finding for finding in findings if finding.level is doctor.Level.BROKEN]
    assert not broken
    assert {"Python", "OpenCV", "ROS 2", "shared memory", "domain", "kernel cache"} <= {
        finding.subject for finding in findings
    }


def test_the_doctor_says_what_to_try(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "many")
    assert doctor.domain().level is doctor.Level.BROKEN
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp")
    assert "unset RMW_IMPLEMENTATION" in doctor.middleware().advice
    monkeypatch.delenv("RMW_IMPLEMENTATION")
    monkeypatch.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", str(tmp_path / "gone.xml"))
    assert "gone.xml" in doctor.middleware().text
    monkeypatch.setattr(doctor, "SEGMENT_MB", 1e9)
    assert "--shm-size" in doctor.shared_memory().advice
    monkeypatch.setattr(doctor, "NEWEST_PYTHON", (3, 9))
    assert "make venv" in doctor.python_version().advice


def test_the_doctor_knows_the_trap_of_the_wheels() -> None:
    """The guard variable handed on without the library path: rclpy cannot load, and the advice says why."""
    code = (
        "import os, sys\nos.environ.pop('LD_LIBRARY_PATH', None)\n"
        "os.environ['_ROS_WHEELS_BOOTSTRAP_COMPLETE'] = '1'\nsys.modules['rclpy'] = None\n"
        "from robot_vision import doctor; print(doctor.ros().advice)"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert "hand on the whole environment" in run.stdout


def test_a_doctor_with_bad_news_does_not_exit_well() -> None:
    run = robot_vision("doctor", ROS_DOMAIN_ID="many")
    assert run.returncode == 1
    assert "ROS_DOMAIN_ID is 'many'" in run.stdout


def test_files_of_the_package_are_found_in_the_clone_and_under_a_prefix(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert places.source_tree() == ROOT
    assert places.shared_file("bags/corridor.mcap") == ROOT / "bags" / "corridor.mcap"
    share = tmp_path / "share" / "robot_vision"
    (share / "bags").mkdir(parents=True)
    (share / "package.xml").touch()
    (share / "bags" / "corridor.mcap").touch()
    monkeypatch.setattr(places, "_PACKAGE", tmp_path / "lib" / "python3" / "site-packages" / "robot_vision")
    assert places.source_tree() is None
    assert places.shared_file("bags/corridor.mcap") == share / "bags" / "corridor.mcap"
    with pytest.raises(places.PlaceError, match=r"bags/moon\.mcap"):
        places.shared_file("bags/moon.mcap")


def test_pages_come_up_without_the_heavy_libraries() -> None:
    """`--help` of every command in a process that would notice numpy, OpenCV or ROS being loaded."""
    code = (
        "import sys\nfrom typer.testing import CliRunner\nfrom robot_vision import cli\n"
        "run = CliRunner().invoke\n"
        "for name in sys.argv[1:]: assert run(cli.app, [name, '--help']).exit_code == 0, name\n"
        "print([name for name in ('numpy', 'cv2', 'rclpy', 'numba', 'matplotlib') if name in sys.modules])"
    )
    names = sorted(COMMANDS - {"bench"})
    run = subprocess.run(
        [sys.executable, "-c", code, *names], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert run.stdout.strip() == "[]", run.stdout + run.stderr
