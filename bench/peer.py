# SPDX-License-Identifier: Apache-2.0
"""lu-vp-detect, the best peer that a robot builder can install, in an environment of its own beside the project's."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from bench.sources import ROOT
from robot_vision.geometry import Camera

#: It asks for any OpenCV with contributions and breaks with version 5, which gives its lines in another shape.
REQUIREMENTS = ("lu-vp-detect==1.0.4", "opencv-contrib-python==4.12.*")
ENVIRONMENT = ROOT / "out" / "peers" / "lu-vp-detect"
_WORKER = Path(__file__).with_name("lu_worker.py")
_PATIENCE_S = 600.0


class MissingPeerError(RuntimeError):
    """The peer cannot be installed here; the text tells what was tried."""


def environment() -> Path:
    """Return the interpreter of the peer's environment, which is made when it is not there yet.

    Raises:
        MissingPeerError: the environment cannot be made, as without a package index.
    """
    python = ENVIRONMENT / "bin" / "python"
    installed = ENVIRONMENT / "installed"
    if installed.exists():
        return python
    make = [sys.executable, "-m", "venv", "--clear", str(ENVIRONMENT)]
    install = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *REQUIREMENTS]
    for command in (make, install):
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=_PATIENCE_S)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise MissingPeerError(f"{' '.join(command)}: {error}") from error
        if done.returncode:
            last = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
            raise MissingPeerError(f"{' '.join(command)}: {last}")
    installed.touch()
    return python


class LuVpDetect:
    """A running lu-vp-detect; leave its `with` block to end it.

    Args:
        camera: of all pictures.

    Raises:
        MissingPeerError: it cannot be installed.
    """

    def __init__(self, camera: Camera) -> None:
        numbers = [str(value) for value in (camera.fx, camera.cx, camera.cy)]
        threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        self._process = subprocess.Popen(
            [str(environment()), str(_WORKER), *numbers],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, **threads},
        )

    def __enter__(self) -> LuVpDetect:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.communicate()

    def find(self, path: Path) -> tuple[NDArray[np.float64], float]:
        """Return the vanishing points of a picture, (3, 3) unit directions, and the CPU time they took in ms.

        Raises:
            MissingPeerError: it has ended before it answered.
        """
        pipe_in, pipe_out = self._process.stdin, self._process.stdout
        assert pipe_in is not None and pipe_out is not None
        try:
            pipe_in.write(f"{path}\n")
            pipe_in.flush()
            answer = json.loads(pipe_out.readline())
        except (BrokenPipeError, json.JSONDecodeError) as error:
            raise MissingPeerError(f"lu-vp-detect has given up on {path.name}") from error
        return np.asarray(answer["directions"], np.float64), float(answer["cpu_ms"])
