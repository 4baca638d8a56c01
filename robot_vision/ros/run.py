# SPDX-License-Identifier: Apache-2.0
"""Runs one node as a process: from its parameters to a clean end at Ctrl-C."""

from __future__ import annotations

import gc
import os
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from robot_vision.places import PlaceError, shared_file
from robot_vision.ros.node import VisionNode
from robot_vision.ros.parameters import ParameterError

PROFILE_VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"
PROFILE = "config/transport.xml"
EXIT_REFUSED = 2
EXIT_FAILED = 1


def run_node(make_node: Callable[[], VisionNode], args: list[str] | None = None) -> None:
    """Run a node until it ends itself, or SIGINT or SIGTERM ends it.

    Args:
        make_node: the class of the node.
        args: command line with `--ros-args`, None for that of the process.

    Raises:
        SystemExit: with 2 when a parameter or the command line makes no sense, 1 when the node cannot start,
            or the code by which the node ended itself; the reason stands in one line on stderr.
    """
    use_transport_profile()
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # how rclpy tells of arguments that rcl cannot read
        _print_line(str(error).partition(", at ")[0])
        raise SystemExit(EXIT_REFUSED) from error
    try:
        code = _spin(make_node)
    except ParameterError as refusal:
        code = EXIT_REFUSED
        _print_line(str(refusal))
    except (ValueError, OSError) as error:
        code = EXIT_FAILED
        _print_line(str(error))
    finally:
        rclpy.try_shutdown()
    if code:
        raise SystemExit(code)


def use_transport_profile() -> None:
    """Let Fast DDS use the profile of the package, unless the user has named one; before `rclpy.init`."""
    if os.environ.get(PROFILE_VARIABLE):
        return
    try:
        os.environ[PROFILE_VARIABLE] = str(shared_file(PROFILE))
    except PlaceError as error:
        _print_line(f"{error}; large pictures may get lost between processes")


def _spin(make_node: Callable[[], VisionNode]) -> int:
    executor = SingleThreadedExecutor()
    with _stopped_by_signals(executor.wake) as stopped:
        node = make_node()
        try:
            executor.add_node(node)
            node.get_warm()
            _use_one_thread()
            # What exists now lives as long as the node: the collector need not look at it again
            gc.collect()
            gc.freeze()
            while not stopped.is_set() and node.exit_code is None and rclpy.ok():
                executor.spin_once()
            return node.exit_code or 0
        except ExternalShutdownException:
            return node.exit_code or 0
        finally:
            node.stop()
            executor.remove_node(node)
            node.destroy_node()
            executor.shutdown()


@contextmanager
def _stopped_by_signals(wake: Callable[[], None]) -> Iterator[threading.Event]:
    """Set the event on SIGINT or SIGTERM and wake whoever waits.

    While the executor waits in C no Python handler runs; so the interpreter's C handler writes to a socket,
    and a thread that reads it wakes the executor.
    """
    stopped = threading.Event()
    reader, writer = socket.socketpair()
    writer.setblocking(False)

    def watch() -> None:
        while reader.recv(1):
            wake()

    before = {
        number: signal.signal(number, lambda *_: stopped.set()) for number in (signal.SIGINT, signal.SIGTERM)
    }
    before_fd = signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    watcher = threading.Thread(target=watch, name="signals", daemon=True)
    watcher.start()
    try:
        yield stopped
    finally:
        signal.set_wakeup_fd(before_fd)
        for number, handler in before.items():
            signal.signal(number, handler)
        writer.close()
        watcher.join()
        reader.close()


def _use_one_thread() -> None:
    """Keep OpenCV, where it is used, from spreading a picture over the cores that the other nodes need."""
    if "cv2" in sys.modules:
        import cv2

        cv2.setNumThreads(1)


def _print_line(text: str) -> None:
    print(f"{Path(sys.argv[0]).stem}: {text}", file=sys.stderr, flush=True)
