# SPDX-License-Identifier: Apache-2.0
"""How much of the machine our processes take, and how much others do, from Linux's own books in /proc."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

PROC = Path("/proc")


@dataclass(frozen=True)
class Ticks:
    """Clock ticks of all cores since the machine started, and those of some processes.

    Attributes:
        total: all that went by.
        busy: spent working, whoever did.
        stolen: taken by the machine that this one is a guest of.
        processes: spent by each process, in user and system mode.
    """

    total: int
    busy: int
    stolen: int
    processes: Mapping[str, int]


@dataclass(frozen=True)
class Load:
    """What happened between two looks.

    Attributes:
        cores: share of ONE core of each process, percent.
        others: share of the machine that others' processes took, percent.
        stolen: share of the machine its host took away, percent.
    """

    cores: Mapping[str, float]
    others: float
    stolen: float


def look(processes: Mapping[str, int]) -> Ticks:
    """Read the books now.

    Args:
        processes: their numbers by name; this process is added as `bench`.

    Raises:
        OSError: one of them has ended.
    """
    total, busy, stolen = machine_ticks((PROC / "stat").read_text())
    named = {**processes, "bench": os.getpid()}
    spent = {name: process_ticks((PROC / str(pid) / "stat").read_text()) for name, pid in named.items()}
    return Ticks(total, busy, stolen, spent)


def between(before: Ticks, after: Ticks, cores: int) -> Load:
    """Return the shares from one look to the next.

    Args:
        before: the first look.
        after: the second, at the same processes.
        cores: of the machine.
    """
    total = max(1, after.total - before.total)
    spent = {name: after.processes[name] - ticks for name, ticks in before.processes.items()}
    others = after.busy - before.busy - sum(spent.values())
    return Load(
        cores={name: 100.0 * cores * ticks / total for name, ticks in spent.items()},
        others=100.0 * max(0, others) / total,
        stolen=100.0 * (after.stolen - before.stolen) / total,
    )


def machine_ticks(text: str) -> tuple[int, int, int]:
    """Return total, busy and stolen ticks from the text of /proc/stat (proc_stat(5))."""
    user, nice, system, idle, waiting, irq, softirq, stolen = map(int, text.split()[1:9])
    busy = user + nice + system + irq + softirq
    return busy + idle + waiting + stolen, busy, stolen


def process_ticks(text: str) -> int:
    """Return user plus system ticks from the text of /proc/<pid>/stat (proc_pid_stat(5))."""
    fields = text.rpartition(")")[2].split()  # the name before it may hold blanks and brackets
    return int(fields[11]) + int(fields[12])
