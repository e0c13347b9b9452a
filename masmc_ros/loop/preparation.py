# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Preparation of the control laws while a node starts.

Compiling a law takes seconds, on a tree robot up to a minute. Loading its code from disk takes up
to a fifth of a second. A controller must do neither between two ticks. While the node starts, it
loads the code of the paper's laws and of user laws. A process compiles missing code on idle
processors, once per machine.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import subprocess
from threading import Lock

from masmc_ros.jit.compiled import is_interpreted
from masmc_ros.loop.compiling_process import started
from masmc_ros.loop.law_code import laws_loaded_at_start, load, mark
from masmc_ros.robot.declaration import Mechanism


def prepare(mechanism: Mechanism) -> subprocess.Popen[bytes] | None:
    """Load the kernels, or return a process that compiles them and ends with this process."""
    if is_interpreted():
        return None
    if mark(mechanism).exists():
        load(mechanism, (law for law in laws_loaded_at_start() if law.fits(mechanism)))
        return None
    return started(mechanism, None)


class Preparation:
    """
    Process that compiles all laws, and pauses while another process compiles a requested law.

    A node and two compiling processes need more than two processors.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        """Load the kernels, or start a process that compiles them."""
        self._mechanism = mechanism
        self._lock = Lock()
        self._pauses = 0
        self._process = prepare(mechanism)

    @contextmanager
    def paused(self) -> Iterator[None]:
        """End the process, and start it again afterwards unless it has finished; for threads."""
        with self._lock:
            self._pauses += 1
            if self._process is not None and self._process.poll() is None:
                _end(self._process)
        try:
            yield
        finally:
            with self._lock:
                self._pauses -= 1
                was_ended = self._process is not None and self._process.returncode != 0
                if was_ended and self._pauses == 0:
                    self._process = started(self._mechanism, None)

    def close(self) -> None:
        """End the process; it does not start again."""
        with self._lock:
            if self._process is not None:
                _end(self._process)
            self._process = None


def _end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    process.wait()
    if process.stdin is not None:
        process.stdin.close()
