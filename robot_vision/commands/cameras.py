# SPDX-License-Identifier: Apache-2.0
"""Commands about pictures: to calibrate a camera from its drive, to find the centres of what it sees on a plate.

Annotations are evaluated and written with Optional: the typer of Ubuntu 24.04 understands nothing newer.
"""

from pathlib import Path
from typing import Annotated, Optional

import typer

from robot_vision.commands.progress import progress_bar


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
    if not run_calibration(asked, Console(highlight=False, soft_wrap=True), progress_bar):
        raise typer.Exit(1)


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
