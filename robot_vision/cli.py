# SPDX-License-Identifier: Apache-2.0
"""The command `robot-vision`: everything a person does with the package without writing a program.

Commands import what they need when they run, so that `robot-vision --help` answers at once; those about bags and
cameras are in `commands/`. Annotations are evaluated and written with Optional: the typer of Ubuntu 24.04
understands nothing newer.
"""

import sys
from pathlib import Path
from typing import Annotated, Optional

import typer

from robot_vision import __version__
from robot_vision.commands import bags, cameras
from robot_vision.commands.progress import progress_bar

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


app.command("make-bag")(bags.make_bag)
app.command()(bags.simulate)
app.command()(cameras.calibrate)
app.command()(cameras.centres)
app.command()(bags.play)
app.command()(bags.record)
app.command()(bags.view)


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
        with progress_bar("compiling, kept for later") as progress:
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
