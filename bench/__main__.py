# SPDX-License-Identifier: Apache-2.0
"""The command `python -m bench`: runs benchmarks, prints their tables, and writes out/bench.json."""

from __future__ import annotations

import argparse
import json
import os
import platform
from importlib import import_module
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from bench.sources import ROOT, MissingSetError

BENCHMARKS = {
    "york": "vanishing points of single real pictures",
    "folds": "the same with settings chosen on other pictures",
    "kitti": "the way ahead on a real road, through the real nodes",
    "corridor": "heading, offset and attitude in the recorded corridor, through the real nodes",
    "calibration": "focal length, mounting and height from a drive; what flagstones add",
    "closed_loop": "30 m of corridor driven by the graph itself, ten times",
    "centres": "true centres of holes on rendered plates",
    "crbd": "crop rows of single real pictures, beside the textbook's recipe",
    "row_folds": "the same with settings chosen on other pictures",
    "field": "crop rows of recorded drives through three simulated crops",
    "spray": "plants followed, weeds sprayed and crop spared in three simulated crops",
    "field_loop": "crop rows driven along at 1.6 m/s, to the headland and through a gap",
    "attention": "what looking where it matters saves, and what it does to every score",
    "attitude": "roll and pitch of a body that leans by up to 3 degrees",
    "road": "heading and curvature on a winding road, 500 m of bends driven ten times",
    "gaze": "a camera on a head that looks where look_at says, beside a fixed one",
    "plan_view": "plan and map of the floor: simulated drives, a real road, cost",
    "lines": "cost of finding lines, beside OpenCV's LSD",
    "costs": "cost against the number of lines and of pixels",
    "latency": "from picture to steering at 30 Hz, processes over DDS",
    "paths": "ways planned on the maps of MovingAI",
    "fields": "speed, memory and growth of the distance function",
    "first_call": "what the first distance function of a process costs",
    "mazes": "contest mazes explored, beside flood fill",
    "maze_drives": "contest mazes driven by their true plan",
    "maze_nodes": "the same by simulator and maze_planner, over DDS",
    "maze_camera": "mazes never seen before explored and run by one camera and odometry",
    "overload": "the same at 60 Hz: what is skipped, how old what is steered by",
}
SEEDED = ("field", "spray", "field_loop")
"""Those whose seeds can be chosen, so that many drives may be driven in parts."""
OUTPUT = ROOT / "out" / "bench.json"


def main(arguments: list[str] | None = None) -> None:
    """Run what the command line names, all when it names nothing."""
    options = _parse(arguments)
    names = list(dict.fromkeys(options.benchmarks)) or list(BENCHMARKS)
    console = Console(highlight=False)
    results: dict[str, Any] = {}
    verdicts: list[bool] = []
    skipped: list[str] = []
    for name in names:
        try:
            with console.status(f"{name}: {BENCHMARKS[name]}"):
                run = import_module(f"bench.{name}").run
                tables = run(options.quick, options.seeds) if name in SEEDED else run(options.quick)
        except MissingSetError as missing:
            console.print(f"[yellow]{name} is skipped:[/] {escape(str(missing))}")
            skipped.append(name)
            results[name] = {"skipped": str(missing)}
            continue
        for table in tables:
            table.print(console)
            verdicts += table.verdicts
        results[name] = [table.as_json() for table in tables]
    _write(options.out, {"quick": options.quick, "machine": _machine(), "benchmarks": results})
    left_out = f"; skipped: {', '.join(skipped)}" if skipped else ""
    console.print(f"{sum(verdicts)} of {len(verdicts)} marks reached{left_out}; {options.out}")


def _parse(arguments: list[str] | None) -> argparse.Namespace:
    about = "\n".join(f"  {name:<12}{text}" for name, text in BENCHMARKS.items())
    parser = argparse.ArgumentParser(
        "python -m bench",
        description="Measure accuracy and latency, beside the marks to reach.",
        epilog=f"benchmarks:\n{about}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("benchmarks", nargs="*", help="which ones [all]")
    parser.add_argument(
        "--quick", action="store_true", help="fewer pictures, one run: a look, no measurement"
    )
    parser.add_argument(
        "--seeds", type=seeds_of, help=f"such as 6-10 or 3,5: drive these ({', '.join(SEEDED)})"
    )
    parser.add_argument("--out", type=Path, default=OUTPUT, help="the JSON file to write [out/bench.json]")
    options = parser.parse_args(arguments)
    for name in options.benchmarks:
        if name not in BENCHMARKS:
            parser.error(f"there is no benchmark {name!r}; choose from {', '.join(BENCHMARKS)}")
        if options.seeds and name not in SEEDED:
            parser.error(f"the seeds of {name} are its own; --seeds is for {', '.join(SEEDED)}")
    if options.seeds and not options.benchmarks:
        parser.error(f"--seeds wants to know of what: {', '.join(SEEDED)}")
    return options


def seeds_of(text: str) -> tuple[int, ...]:
    """Seeds named on the command line: `6-10`, `3,5` or both.

    Raises:
        argparse.ArgumentTypeError: saying what seeds look like.
    """
    seeds: list[int] = []
    for part in text.split(","):
        first, dash, last = part.partition("-")
        if not (first.isdecimal() and (last if dash else first).isdecimal()):
            raise argparse.ArgumentTypeError(f"seeds look like 6-10 or 3,5, not {text!r}")
        if dash and int(last) < int(first):
            raise argparse.ArgumentTypeError(f"there is no seed in {part!r}")
        seeds += range(int(first), int(last or first) + 1)
    return tuple(dict.fromkeys(seeds))


def _machine() -> dict[str, Any]:
    return {"python": platform.python_version(), "system": platform.platform(), "cores": os.cpu_count()}


def _write(path: Path, results: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
