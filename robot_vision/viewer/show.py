# SPDX-License-Identifier: Apache-2.0
"""Brings what a bag holds to the Rerun viewer: to its window, to a browser, or into a file for later."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import Any

from robot_vision.bags import BagReader, decode
from robot_vision.bags.messages import header_stamp_ns

HOW_TO_INSTALL = "the viewer is not installed: pip install 'robot_vision[viewer]'"
TIMELINE = "stamp"


class ViewerError(RuntimeError):
    """Nothing can be shown."""


class Target(Enum):
    """Where a bag is shown."""

    WINDOW = "window"
    BROWSER = "browser"
    FILE = "file"


def view(
    bag: Path,
    target: Target = Target.WINDOW,
    file: Path | None = None,
    progress: Callable[[int, int | None], None] | None = None,
    complain: Callable[[str], None] | None = None,
) -> int:
    """Show a bag: pictures with lines and vanishing points, plans, and what changes over time as curves.

    Args:
        bag: to show.
        target: window, browser or file.
        file: to write (.rrd) when the target is one.
        progress: called with the messages done and their number.
        complain: called once for each topic of which a message could not be shown, with the first reason.

    Returns:
        The number of messages shown. With a browser the recording is served for as long as this process lives.

    Raises:
        BagError: the bag cannot be read.
        ViewerError: the viewer is not installed or cannot be opened, the file to write is the bag or cannot be
            written, or nothing in the bag can be shown.
    """
    try:
        import rerun as rr
    except ImportError as missing:
        raise ViewerError(HOW_TO_INSTALL) from missing
    from robot_vision.viewer.archetypes import KNOWN, shown

    reader = BagReader(bag)
    if file is not None and file.exists() and file.samefile(reader.path):
        raise ViewerError(f"{file} is the bag itself: write the recording elsewhere")
    topics = [name for name, info in reader.topics.items() if info.type_name in KNOWN]
    if not topics:
        raise ViewerError(f"nothing in {bag} can be shown: it holds {', '.join(reader.topics) or 'no topic'}")
    recording = rr.RecordingStream("robot_vision")
    try:
        _open(rr, recording, target, file)
    except RuntimeError as cause:
        raise ViewerError(f"the viewer cannot be opened: {str(cause).strip().splitlines()[0]}") from cause
    total = sum(reader.topics[name].count for name in topics)
    done = 0
    faults: dict[str, str] = {}
    for number, message in enumerate(reader.messages(topics)):
        try:
            content = decode(message.cdr, message.type_name)
            drawn = list(shown(message.topic.strip("/"), message.type_name, content))
        except ValueError as cause:  # one message that is none must not hide all others
            faults.setdefault(message.topic, str(cause))
        else:
            recording.set_time(TIMELINE, timestamp=1e-9 * header_stamp_ns(message.cdr))
            for path, archetype in drawn:
                recording.log(path, archetype)
            done += 1
        if progress is not None:
            progress(number + 1, total)
    if not done and faults:
        raise ViewerError(f"nothing in {bag} can be shown: {next(iter(faults.values()))}")
    recording.flush()
    if target is Target.FILE:
        recording.disconnect()
    if complain is not None:
        for topic, fault in faults.items():
            complain(f"{topic}: not all of it is shown: {fault}")
    return done


def _open(rr: Any, recording: Any, target: Target, file: Path | None) -> None:
    from robot_vision.viewer.layout import layout

    if target is Target.FILE:
        if file is None:
            raise ViewerError("a file to write is missing")
        recording.save(file, default_blueprint=layout())
    elif target is Target.BROWSER:
        rr.serve_web_viewer(connect_to=recording.serve_grpc(default_blueprint=layout()))
    else:
        recording.spawn(default_blueprint=layout())
