# SPDX-License-Identifier: Apache-2.0
"""Commands about bags: to make one of pictures or a simulated drive, to replay, record and view it.

Annotations are evaluated and written with Optional: the typer of Ubuntu 24.04 understands nothing newer.
"""

import sys
from pathlib import Path
from typing import Annotated, NoReturn, Optional

import typer

from robot_vision.commands.progress import progress_bar


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
    with progress_bar("pictures") as progress:
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
    with progress_bar("pictures") as progress:
        made = record(world, bag, seed, seconds, progress, split_settings(settings or []))
    typer.echo(f"{made.path}: {made.pictures} pictures, {made.size / 1e6:.1f} MB")


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


def record(
    output: Annotated[Path, typer.Argument(help="The bag to write (.mcap).")],
    topics: Annotated[Optional[list[str]], typer.Argument(help="Topics to record [all].")] = None,
    compression: Annotated[str, typer.Option(help="Of the bag: none, lz4 or zstd.")] = "none",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a bag of this name.")] = False,
) -> None:
    """Record topics of the graph until Ctrl-C (the node bag_recorder)."""
    settings = {"output": str(output), "compression": compression, "overwrite": overwrite}
    _become("bag_recorder", {**settings, **({"topics": topics} if topics else {})})


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
    with progress_bar("messages") as progress:
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
