# SPDX-License-Identifier: Apache-2.0
"""Finds a ROS domain nobody uses, so that graphs started side by side do not hear each other."""

from __future__ import annotations

import fcntl
import os
import socket
import tempfile
from pathlib import Path
from types import TracebackType

#: On Linux the ports of higher domains reach into those the system gives to anybody.
HIGHEST = 101


class DomainError(RuntimeError):
    """All domains are in use."""


class FreeDomain:
    """A ROS_DOMAIN_ID of one's own, as long as this object is open.

    A lock on a file keeps other graphs started this way away; a domain whose discovery port somebody has open
    is left out, too.

    Attributes:
        id: the domain, 1 to 101.

    Raises:
        DomainError: all are taken.
    """

    def __init__(self) -> None:
        folder = Path(tempfile.gettempdir()) / f"robot_vision-{os.getuid()}"
        folder.mkdir(mode=0o700, exist_ok=True)
        for step in range(HIGHEST):
            domain = 1 + (os.getpid() + step) % HIGHEST
            lock = os.open(folder / f"domain-{domain}", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                os.close(lock)
                continue
            if _is_quiet(domain):
                self.id, self._lock = domain, lock
                return
            os.close(lock)
        raise DomainError(f"the ROS domains 1 to {HIGHEST} are all in use")

    def close(self) -> None:
        """Give the domain back."""
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    def __enter__(self) -> FreeDomain:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _is_quiet(domain: int) -> bool:
    """Tell whether nobody has the port by which a domain's first participant is found (RTPS 9.6.1.1)."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", 7400 + 250 * domain + 10))
        except OSError:
            return False
    return True
