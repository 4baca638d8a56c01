# SPDX-License-Identifier: Apache-2.0
"""The command `robot-vision`: everything a person does with the package without writing a program.

Commands import what they need when they run, so that `robot-vision --help` answers at once. Annotations are
evaluated and written with Optional: the typer of Ubuntu 24.04 understands nothing newer.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, NoReturn, Optional

import typer

from robot_vision import __version__

USAGE_ERROR = 2

app = typer.Typer(
    name="robot-vision",
    help="One camera tells a robot where it is heading.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def main() -> None:
    """Run the command line; a cause that can be told becomes one line and exit code 2."""
    try:
        app()
    except (ValueError, RuntimeError, OSError) as error:
        if not _can_be_told(error):
            raise
        sys.stderr.write(f"robot-vision: {error}\n")
        sys.exit(USAGE_ERROR)


def _can_be_told(error: Exception) -> bool:
    """Errors of the library are written for people; any other one is a defect and wants its traceback."""
    return isinstance(error, OSError) or type(error).__module__.startswith("robot_vision.")


@contextmanager
def _progress(what: str) -> Iterator[Callable[[int, Optional[int]], None]]:
    """Show a bar from the first step on; yields a function of things done and in all (None: not known)."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    bar = Progress(*columns, console=console, disable=not console.is_terminal)
    task = bar.add_task(what, total=None)

    def show(done: int, total: Optional[int] = None) -> None:
        bar.start()
        bar.update(task, completed=done, total=total)

    try:
        yield show
    finally:
        bar.stop()


def _say_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"robot_vision {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_say_version, is_eager=True, help="Say the version.")
    ] = False,
) -> None:
    """One camera tells a robot where it is heading."""


@app.command()
def demo(
    bag: Annotated[Optional[Path], typer.Option(help="Another recorded drive [the corridor].")] = None,
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("out"),
    height: Annotated[float, typer.Option(help="Of the camera over the ground, m.")] = 0.6,
    pitch: Annotated[float, typer.Option(help="Of the camera, degrees; down is positive.")] = 5.0,
    live: Annotated[
        Optional[str], typer.Option(help="A world to drive through live instead: corridor, road, maze, …")
    ] = None,
    seconds: Annotated[
        Optional[float], typer.Option(help="How long, of a live drive [20; a maze: 300].")
    ] = None,
    seed: Annotated[int, typer.Option(help="Of a live drive.")] = 1,
) -> None:
    """Replay a recorded drive through the real nodes, or let them drive, and show what they made of it."""
    import math

    from rich.console import Console

    from robot_vision.demo import Mount, run_demo
    from robot_vision.places import shared_file

    console = Console(highlight=False, soft_wrap=True)
    if live == "maze":
        from robot_vision.demo.maze_drive import run_maze

        run_maze(out, 300.0 if seconds is None else seconds, seed, console)
        return
    if live is not None:
        from robot_vision.demo.live_drive import run_live

        run_live(live, out, 20.0 if seconds is None else seconds, seed, console)
        return
    drive = shared_file("bags/corridor.mcap") if bag is None else bag
    run_demo(drive, out, Mount(height, math.radians(pitch)), console)


@app.command()
def run(
    transport: Annotated[str, typer.Option(help="How pictures come: raw or compressed.")] = "raw",
    height: Annotated[float, typer.Option(help="Of the camera over the ground, m; 0: not known.")] = 0.0,
    pitch: Annotated[float, typer.Option(help="Of the camera, degrees; down is positive.")] = 0.0,
    namespace: Annotated[str, typer.Option(help="Of all names, such as /front.")] = "/",
) -> None:
    """Run the graph from pictures to steering until Ctrl-C: one process a node."""
    import math

    from robot_vision.demo.live import run_graph

    run_graph(transport, height, math.radians(pitch), namespace, typer.echo)


@app.command("make-bag")
def make_bag(
    source: Annotated[Path, typer.Argument(help="A folder of pictures, a picture, or a video.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="The bag to write (.mcap).")],
    calibration: Annotated[
        Optional[str],
        typer.Option(
            help="A yaml of camera_calibration, a KITTI calib.txt, or fx,fy,cx,cy[,distortion] in px."
        ),
    ] = None,
    poses: Annotated[Optional[Path], typer.Option(help="KITTI poses.txt, one line a picture.")] = None,
    rate: Annotated[Optional[float], typer.Option(help="Pictures a second [the video's own, or 10].")] = None,
    transport: Annotated[str, typer.Option(help="raw, compressed (JPEG) or png (lossless).")] = "compressed",
    quality: Annotated[int, typer.Option(help="Of JPEG, 1 to 100.")] = 90,
    prefix: Annotated[str, typer.Option(help="Put before the topic names: front gives /front/image.")] = "",
) -> None:
    """Make a bag of a folder of pictures or a video, with its calibration and its way."""
    import logging

    from robot_vision.bags.make import make_bag as make

    logging.getLogger("robot_vision.bags").addHandler(logging.NullHandler())  # its warnings are told below
    with _progress("pictures") as progress:
        made = make(
            source,
            output,
            calibration=calibration,
            poses=poses,
            rate_hz=rate,
            transport=transport,  # type: ignore[arg-type]  # make_bag refuses others in words
            quality=quality,
            prefix=prefix,
            progress=progress,
        )
    for warning in made.warnings:
        typer.echo(f"warning: {warning}", err=True)
    typer.echo(f"{made.path}: {made.pictures} pictures {made.width} x {made.height}, {made.duration_s:.1f} s")


@app.command()
def simulate(
    world: Annotated[str, typer.Argument(help="Which one, such as corridor.")] = "corridor",
    output: Annotated[
        Optional[Path], typer.Option("-o", "--output", help="The bag to write [the world's name.mcap].")
    ] = None,
    seconds: Annotated[float, typer.Option(help="How long.")] = 15.0,
    seed: Annotated[int, typer.Option(help="Of the world, the drive and the noise.")] = 0,
    settings: Annotated[
        Optional[list[str]],
        typer.Option("--set", help="Of the world, its drive or the recording, as width=2.4."),
    ] = None,
) -> None:
    """Record the camera's view of a simulated drive, with the truth beside it; as .png only its last picture."""
    from robot_vision.simulation import record
    from robot_vision.simulation.asked import split_settings

    if output is not None and output.suffix.lower() == ".png":
        from robot_vision.simulation.snapshot import snapshot

        picture = snapshot(world, output, seed, seconds, split_settings(settings or []))
        typer.echo(f"{picture}: {picture.stat().st_size / 1e3:.0f} kB")
        return
    bag = output or Path(f"{world}.mcap")
    with _progress("pictures") as progress:
        made = record(world, bag, seed, seconds, progress, split_settings(settings or []))
    typer.echo(f"{made.path}: {made.pictures} pictures, {made.size / 1e6:.1f} MB")


@app.command()
def calibrate(
    bag: Annotated[Path, typer.Argument(help="A drive past walls, doors, houses or pavement.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the results.")] = Path("out"),
    calibration: Annotated[
        Optional[str],
        typer.Option(
            help="What is known of the camera, as make-bag takes it [the bag's camera_info]: its lens and "
            "centre are used, its focal length only where the pictures do not tell."
        ),
    ] = None,
    corridor_width: Annotated[
        Optional[float], typer.Option(help="Between the feet of the two walls, m; gives the height.")
    ] = None,
    stone_width: Annotated[
        Optional[float], typer.Option(help="Of flagstones across the way, joint to joint, m; likewise.")
    ] = None,
    stone_length: Annotated[
        Optional[float], typer.Option(help="Of flagstones along the way, joint to joint, m; likewise.")
    ] = None,
    row_spacing: Annotated[
        Optional[float],
        typer.Option(help="From crop row to crop row, m; gives the height over the leaves, and the pitch."),
    ] = None,
    pitch: Annotated[
        float, typer.Option(help="Roughly, degrees; where a camera looks down by more than 30.")
    ] = 0.0,
    most: Annotated[int, typer.Option(min=1, help="Pictures to look at, evenly chosen.")] = 600,
) -> None:
    """Find focal length, roll, pitch and height of a camera from its own drive, and how sure they are."""
    import math

    from rich.console import Console

    from robot_vision.calibrate import Asked, run_calibration
    from robot_vision.perception.calibration import KnownLengths

    lengths = KnownLengths(corridor_width, stone_width, stone_length, row_spacing)
    asked = Asked(bag, out, calibration, lengths, math.radians(pitch), most)
    if not run_calibration(asked, Console(highlight=False, soft_wrap=True), _progress):
        raise typer.Exit(1)


@app.command()
def centres(
    image: Annotated[Path, typer.Argument(help="The picture of a plate with holes, discs or dots.")],
    output: Annotated[
        Optional[Path],
        typer.Option(
            "-o", "--output", help="The picture to write, centres drawn on it [out/NAME_centres.png]."
        ),
    ] = None,
    calibration: Annotated[
        Optional[str],
        typer.Option(help="A yaml of camera_calibration, or fx,fy,cx,cy[,distortion] in px."),
    ] = None,
    normal: Annotated[
        Optional[str], typer.Option(help="Of the plate: x,y,z, right, down and ahead of the camera.")
    ] = None,
    line: Annotated[
        Optional[str], typer.Option(help="Vanishing line of the plate: a,b,c of a u + b v + c = 0, px.")
    ] = None,
    contrast: Annotated[
        float, typer.Option(min=0.5, max=255.0, help="Least gradient, grey levels a pixel.")
    ] = 6.0,
    gamma: Annotated[
        Optional[float],
        typer.Option(
            min=0.2, max=5.0, help="Of the grey levels, 1 for raw light; by default the edges tell it."
        ),
    ] = None,
) -> None:
    """Find the true centres of circles and ellipses on a plate, which perspective shifts from those seen."""
    from robot_vision.bags.calibration import read_calibration
    from robot_vision.perception import CentreFinder, EllipseDetector
    from robot_vision.perception.centres_report import inspect, numbers_of, table, write_drawing
    from robot_vision.perception.picture import picture_from_compressed

    picture = picture_from_compressed(image.read_bytes())
    height, width = picture.shape[:2]
    camera = None if calibration is None else read_calibration(calibration, width, height)
    finder = CentreFinder(EllipseDetector(contrast, gamma=gamma))
    plane = numbers_of("normal", normal), numbers_of("line", line)
    answer, drawing = inspect(picture, finder, camera, *plane)
    for row in table(answer):
        typer.echo(row)
    if not answer.found:
        typer.echo("no ellipse is found: a lower --contrast finds fainter ones", err=True)
        raise typer.Exit(1)
    if output is None:
        output = Path("out") / f"{image.stem}_centres.png"
        output.parent.mkdir(exist_ok=True)
    write_drawing(output, drawing)
    typer.echo(f"{output}: {len(answer.found)} centres")


@app.command()
def play(
    bag: Annotated[Path, typer.Argument(help="The bag to replay.")],
    rate: Annotated[float, typer.Option(help="Seconds of the bag in a second.")] = 1.0,
    start: Annotated[float, typer.Option(help="Seconds to leave out at the beginning.")] = 0.0,
    duration: Annotated[float, typer.Option(help="Seconds to replay; 0: to the end.")] = 0.0,
    loop: Annotated[bool, typer.Option("--loop", help="Begin again at the end.")] = False,
    paused: Annotated[
        bool, typer.Option("--paused", help="Begin held; the service resume lets it go.")
    ] = False,
    lockstep: Annotated[
        str,
        typer.Option(
            help="Topics, with commas between, that must answer a picture before the next goes out."
        ),
    ] = "",
) -> None:
    """Replay a bag into the graph (the node bag_player)."""
    from robot_vision.bags import BagReader

    BagReader(bag)  # refuses here, in one line, what the node would refuse in its log
    settings = {"bag": str(bag), "rate": rate, "start": start, "duration": duration, "loop": loop}
    _become("bag_player", {**settings, "paused": paused, "lockstep": lockstep})


@app.command()
def record(
    output: Annotated[Path, typer.Argument(help="The bag to write (.mcap).")],
    topics: Annotated[Optional[list[str]], typer.Argument(help="Topics to record [all].")] = None,
    compression: Annotated[str, typer.Option(help="Of the bag: none, lz4 or zstd.")] = "none",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a bag of this name.")] = False,
) -> None:
    """Record topics of the graph until Ctrl-C (the node bag_recorder)."""
    settings = {"output": str(output), "compression": compression, "overwrite": overwrite}
    _become("bag_recorder", {**settings, **({"topics": topics} if topics else {})})


@app.command()
def view(
    bag: Annotated[Path, typer.Argument(help="The bag to show.")],
    save: Annotated[
        Optional[Path], typer.Option(help="Write a recording (.rrd) for the viewer instead of opening it.")
    ] = None,
    web: Annotated[bool, typer.Option("--web", help="Show it in a browser, until Ctrl-C.")] = False,
) -> None:
    """Show a bag in the Rerun viewer: pictures, lines, plans, and what changes over time as curves."""
    import signal

    from robot_vision.viewer import Target, view

    def warn(text: str) -> None:
        typer.echo(f"warning: {text}", err=True)

    if web and save is not None:
        raise typer.BadParameter("a file is not shown in a browser: choose --save or --web")
    target = Target.BROWSER if web else Target.WINDOW if save is None else Target.FILE
    with _progress("messages") as progress:
        count = view(bag, target, save, progress, warn)
    typer.echo(f"{count} messages {f'in {save}' if save is not None else 'shown'}")
    if web:
        signal.sigwait({signal.SIGINT, signal.SIGTERM})


def _become(node: str, parameters: dict[str, object]) -> NoReturn:
    """Let a node take the place of this process: signals and the exit code are its own."""
    import json
    import os

    settings = [item for name, value in parameters.items() for item in ("-p", f"{name}:={json.dumps(value)}")]
    command = [sys.executable, "-m", f"robot_vision.nodes.{node}", "--ros-args", *settings]
    os.execve(sys.executable, command, dict(os.environ))


@app.command(context_settings={"allow_extra_args": True, "ignore_unknown_options": True})
def bench(context: typer.Context) -> None:
    """Measure accuracy and latency, in a clone of the project; arguments go to `python -m bench`."""
    import runpy

    from robot_vision.places import source_tree

    root = source_tree()
    if root is None or not (root / "bench" / "__main__.py").is_file():
        typer.echo(
            "robot-vision: the benchmarks are not installed; run `make bench` in a clone of the project",
            err=True,
        )
        raise typer.Exit(USAGE_ERROR)
    sys.path.insert(0, str(root))
    sys.argv = ["bench", *context.args]
    runpy.run_module("bench", run_name="__main__", alter_sys=True)


@app.command()
def doctor(
    warm: Annotated[
        bool, typer.Option("--warm", help="Compile what is compiled on first use, and keep it.")
    ] = False,
) -> None:
    """Look over this machine and say in plain words what to try."""
    from rich.console import Console
    from rich.markup import escape

    from robot_vision import doctor as surgery

    if warm:
        steps = surgery.warm_steps()
        with _progress("compiling, kept for later") as progress:
            for number, (_, compile_it) in enumerate(steps):
                progress(number, len(steps))
                compile_it()
            progress(len(steps), len(steps))
    console = Console(highlight=False, soft_wrap=True)
    marks = {
        surgery.Level.FINE: "[green]fine  [/]",
        surgery.Level.LOOK: "[yellow]look  [/]",
        surgery.Level.BROKEN: "[red]broken[/]",
    }
    broken = False
    for finding in surgery.examine():
        broken |= finding.level is surgery.Level.BROKEN
        console.print(f"{marks[finding.level]} {finding.subject:<14} {escape(finding.text)}")
        if finding.advice:
            console.print(f"       [bold]try:[/] {escape(finding.advice)}")
    if broken:
        raise typer.Exit(1)
