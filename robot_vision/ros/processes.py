# SPDX-License-Identifier: Apache-2.0
"""Starts nodes as processes, waits until they are ready, and ends them without leaving anything behind.

No ROS in here: what a node says of itself is read from its log.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from robot_vision.ros.domains import FreeDomain

STOP_TIMEOUT_S = 10.0
READY_TIMEOUT_S = 60.0
#: What `VisionNode` logs when it is warmed up, and when it is connected besides.
UP = "]: up"
READY = "]: ready"
_SHARED_MEMORY = Path("/dev/shm")
_KEPT_LINES = 2000


class ProcessError(RuntimeError):
    """A node did not do what was waited for; the text ends with the last lines of its log."""


class NodeProcess:
    """One node of this package, running.

    Args:
        node: its executable, such as `line_detector`.
        parameters: by name; texts, numbers, truth values or lists of texts.
        remaps: names by the names they replace; `__node` and `__ns` included.
        arguments: further ones, put before `--ros-args`.
        environment: variables to add to those of this process.
        nice: how far the process steps back for others, 0 to 19.
        on_line: called with each line of its log, in a thread of its own.
    """

    def __init__(
        self,
        node: str,
        parameters: Mapping[str, Any] | None = None,
        remaps: Mapping[str, str] | None = None,
        *,
        arguments: Sequence[str] = (),
        environment: Mapping[str, str] | None = None,
        nice: int = 0,
        on_line: Callable[[str], None] | None = None,
    ) -> None:
        self.node = node
        self._on_line = on_line
        self._lines: deque[str] = deque(maxlen=_KEPT_LINES)
        self._news = threading.Condition()
        self._ended = False
        self._segments: set[Path] = set()
        # The wheels of ROS find their libraries by variables set at start: the environment goes on whole
        variables = {
            **os.environ,
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "PYTHONUNBUFFERED": "1",
            **(environment or {}),
        }
        command = [sys.executable, "-m", f"robot_vision.nodes.{node}", *arguments]
        ros = ros_arguments(parameters or {}, remaps or {})
        self._process = subprocess.Popen(
            [*command, *ros],
            env=variables,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            start_new_session=True,  # Ctrl-C reaches who started the graph, who ends the nodes in order
        )
        if nice:
            os.setpriority(os.PRIO_PROCESS, self._process.pid, nice)
        self._reader = threading.Thread(target=self._read, name=f"log of {node}", daemon=True)
        self._reader.start()

    @property
    def pid(self) -> int:
        """The number of the process."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """Whether the process lives."""
        return self._process.poll() is None

    @property
    def returncode(self) -> int | None:
        """The exit code, None while it lives; negative: the signal that ended it."""
        return self._process.poll()

    @property
    def log(self) -> list[str]:
        """The last lines of what it printed."""
        with self._news:
            return list(self._lines)

    def wait_for_line(self, text: str, timeout_s: float = READY_TIMEOUT_S, count: int = 1) -> str:
        """Wait until the log has `count` lines that hold the text; returns the last of these.

        Raises:
            ProcessError: time is over, or the process has ended without.
        """

        def found() -> list[str]:
            return [line for line in self._lines if text in line]

        with self._news:
            self._news.wait_for(lambda: self._ended or len(found()) >= count, timeout_s)
            lines, ended = found(), self._ended
        if len(lines) >= count:
            return lines[count - 1]
        why = f"ended with code {self._process.wait()}" if ended else f"took longer than {timeout_s:g} s"
        raise ProcessError(self._with_log(f"{self.node} {why} before it said {text!r}"))

    def wait_until_up(self, timeout_s: float = READY_TIMEOUT_S) -> None:
        """Wait until the node is warmed up, whoever else is there.

        Raises:
            ProcessError: as for `wait_for_line`.
        """
        self.wait_for_line(UP, timeout_s)

    def wait_until_ready(self, timeout_s: float = READY_TIMEOUT_S) -> None:
        """Wait until the node is warmed up and connected.

        Raises:
            ProcessError: as for `wait_for_line`.
        """
        self.wait_for_line(READY, timeout_s)

    def wait(self, timeout_s: float) -> int:
        """Wait until the process ends by itself; returns its exit code.

        Raises:
            ProcessError: it still runs.
        """
        try:
            code = self._process.wait(timeout_s)
        except subprocess.TimeoutExpired as error:
            raise ProcessError(self._with_log(f"{self.node} still runs after {timeout_s:g} s")) from error
        self._reader.join()
        return code

    def interrupt(self) -> None:
        """Ask it to end, as Ctrl-C does."""
        if self.running:
            self._process.send_signal(signal.SIGINT)

    def stop(self, timeout_s: float = STOP_TIMEOUT_S) -> int:
        """End it, by force if it does not obey; returns its exit code."""
        self.interrupt()
        try:
            self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self.kill()
        self._reader.join()
        return self._process.wait()

    def kill(self) -> None:
        """End it by force; `remove_shared_memory` then removes what it could not."""
        self._segments |= _mapped_segments(self._process.pid)
        self._process.kill()
        self._process.wait()

    def remove_shared_memory(self) -> None:
        """Remove the shared memory (33 MB a node) of a killed process, but for what somebody still uses."""
        used = {segment for process in _processes() for segment in _mapped_segments(process)}
        for segment in self._segments - used:
            for name in (segment.name, f"{segment.name}_el", f"sem.{segment.name}_mutex"):
                (_SHARED_MEMORY / name).unlink(missing_ok=True)
        self._segments.clear()

    def _with_log(self, text: str) -> str:
        return "\n".join([f"{text}; its log ends with:", *self.log[-20:]])

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            with self._news:
                self._lines.append(line.rstrip("\n"))
                self._news.notify_all()
            if self._on_line is not None:
                self._on_line(line.rstrip("\n"))
        with self._news:
            self._ended = True
            self._news.notify_all()
        self._process.stdout.close()


class Graph:
    """Several nodes in a ROS domain of their own; a context manager that ends them all.

    Args:
        environment: variables for all nodes; with a ROS_DOMAIN_ID in it no other domain is looked for.
        on_line: called with the node's name and each line of its log.
    """

    def __init__(
        self,
        environment: Mapping[str, str] | None = None,
        on_line: Callable[[str, str], None] | None = None,
    ) -> None:
        self.environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", **(environment or {})}
        self._domain = None if "ROS_DOMAIN_ID" in self.environment else FreeDomain()
        if self._domain is not None:
            self.environment["ROS_DOMAIN_ID"] = str(self._domain.id)
        self._on_line = on_line
        #: In the order of their start.
        self.processes: list[NodeProcess] = []

    def start(
        self,
        node: str,
        parameters: Mapping[str, Any] | None = None,
        remaps: Mapping[str, str] | None = None,
        *,
        arguments: Sequence[str] = (),
        nice: int = 0,
    ) -> NodeProcess:
        """Start a node; the arguments are those of `NodeProcess`."""
        tell = self._on_line
        process = NodeProcess(
            node,
            parameters,
            remaps,
            arguments=arguments,
            environment=self.environment,
            nice=nice,
            on_line=None if tell is None else lambda line: tell(node, line),
        )
        self.processes.append(process)
        return process

    def wait_until_ready(self, timeout_s: float = READY_TIMEOUT_S) -> None:
        """Wait until every node is warmed up and connected.

        Raises:
            ProcessError: one of them is not within the time.
        """
        for process in self.processes:
            process.wait_until_ready(timeout_s)

    def stop(self, timeout_s: float = STOP_TIMEOUT_S) -> None:
        """End all nodes, the last started first told, and remove what killed ones have left behind."""
        for process in reversed(self.processes):
            process.interrupt()
        for process in reversed(self.processes):
            process.stop(timeout_s)
        for process in self.processes:
            process.remove_shared_memory()
        if self._domain is not None:
            self._domain.close()

    def __enter__(self) -> Graph:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()


def ros_arguments(parameters: Mapping[str, Any], remaps: Mapping[str, str]) -> list[str]:
    """Write parameters and remaps as command line arguments of a node."""
    if not parameters and not remaps:
        return []
    arguments = ["--ros-args"]
    for old, new in remaps.items():
        arguments += ["-r", f"{old}:={new}"]
    for name, value in parameters.items():
        arguments += ["-p", f"{name}:={_yaml(value)}"]
    return arguments


def _yaml(value: Any) -> str:
    """Write a value so that rcl reads back the same type."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        text = repr(value)
        # YAML 1.1 takes 1e-05 for a text
        return text if "e" not in text or "." in text else text.replace("e", ".0e")
    if isinstance(value, int):
        return str(value)
    if isinstance(value, str | Path):
        return "'" + str(value).replace("'", "''") + "'"
    return "[" + ", ".join(_yaml(item) for item in value) + "]"


def _processes() -> list[int]:
    return [int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdigit()]


def _mapped_segments(process: int) -> set[Path]:
    """The shared-memory segments of Fast DDS that a process has open; none of those of somebody else."""
    try:
        maps = Path(f"/proc/{process}/maps").read_text()
    except OSError:
        return set()
    names = {line.rpartition(" ")[2] for line in maps.splitlines() if f"{_SHARED_MEMORY}/fastrtps_" in line}
    return {Path(name) for name in names}
