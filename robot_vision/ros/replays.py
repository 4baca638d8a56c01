# SPDX-License-Identifier: Apache-2.0
"""Replays a bag in lockstep through the real nodes, each a process, and records what they say."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from robot_vision.bags import BagError
from robot_vision.ros.processes import Graph, NodeProcess, ProcessError

RECORDER = "bag_recorder"
START_S = 180.0  # until everybody is ready: the first time kernels are compiled
ANSWER_S = 5.0  # how long an answer to one picture is waited for
LOOK_S = 0.2  # how often it is looked whether all processes live
END = "]: end of "  # what bag_player logs when its bag is over


def replay(
    bag: Path,
    answers: Path,
    nodes: Sequence[str],
    lockstep: str,
    settings: dict[str, dict[str, Any]],
    duration_s: float = 0.0,
    exclude: Sequence[str] = ("lines/overlay",),
    answer_s: float = ANSWER_S,
) -> None:
    """Replay a bag and record what the nodes say.

    Args:
        bag: to replay.
        answers: the bag to write; an old one is replaced.
        nodes: executables.
        lockstep: the topic that must answer each picture.
        settings: parameters by node.
        duration_s: how much of the bag, s; 0: all.
        exclude: topics not to record.
        answer_s: how long an answer to one picture is waited for, s.

    Raises:
        BagError: the answers would take the place of the bag.
        ProcessError: a process ended too early or with a failure; the text ends with its log.
    """
    if answers.resolve() == bag.resolve():
        raise BagError(f"{answers} is the bag to replay: write the answers elsewhere")
    player_settings: dict[str, Any] = {
        "bag": bag,
        "lockstep": lockstep,
        "lockstep_timeout": answer_s,
        "wait_for_nodes": [*nodes, RECORDER],
        "wait_timeout": START_S,
        "duration": float(duration_s),
        "exit_at_end": False,
    }
    recorder_settings = {
        "output": answers,
        "overwrite": True,
        "exclude": list(exclude),
        "wait_for_nodes": list(nodes),
    }
    with Graph() as graph:
        recorder = graph.start(RECORDER, recorder_settings)
        recorder.wait_for_line("recording")
        started = [graph.start(node, {"use_sim_time": True, **settings.get(node, {})}) for node in nodes]
        player = graph.start("bag_player", player_settings)
        wait_for_end(player, [recorder, *started], END)
        # The player stays until all is written: without anybody who says the time, whoever steers stops, and
        # whether that word still got into the bag would be a matter of chance
        for process in (*started, recorder):
            process.stop()


def wait_for_end(player: NodeProcess, others: Sequence[NodeProcess], last_words: str = "") -> None:
    """Wait until the replay is over.

    Args:
        player: who ends the replay by its own end, or by its last words.
        others: must live until then.
        last_words: what the player logs when it has sent everything; empty: it ends.

    Raises:
        ProcessError: it failed, or one of the others ended before it.
    """
    while player.running and not (last_words and any(last_words in line for line in player.log)):
        with suppress(ProcessError):  # it still runs
            player.wait(LOOK_S)
        for node in others:
            if not node.running:
                raise ProcessError(_with_log(f"{node.node} ended before the replay", node))
    if player.returncode:
        raise ProcessError(_with_log(f"the replay failed with code {player.returncode}", player))


def _with_log(text: str, process: NodeProcess) -> str:
    return "\n".join([f"{text}; the log of {process.node} ends with:", *process.log[-20:]])
