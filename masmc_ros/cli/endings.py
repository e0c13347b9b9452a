# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""End of a command by a signal, and end of a child process with its parent."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import ctypes
import os
import signal
import sys
from types import FrameType

from masmc_ros.nodes.process.ending import ENDING
from masmc_ros.whole_file import remove_unfinished

_PARENT = 'MASMC_ROS_PARENT'
"""Environment variable: number of the process with which a child ends."""

_PR_SET_PDEATHSIG = 1


class Ended(KeyboardInterrupt):
    """A signal ended the process."""

    def __init__(self, number: int) -> None:
        """Take the signal's number."""
        super().__init__(number)
        self.number = number
        self.name = signal.Signals(number).name


@contextmanager
def ended_by_signals(*, restores: bool = True) -> Iterator[None]:
    """
    Raise Ended within where a signal comes, and leave no unfinished file behind.

    A signal that is ignored, as under `nohup`, stays so. Afterwards the handlers are those of
    before if this `restores` them; otherwise signals are ignored, for a process that ends.
    """
    handlers = {number: signal.getsignal(number) for number in ENDING}
    taken = {n: each for n, each in handlers.items() if each not in (None, signal.SIG_IGN)}
    for number in taken:
        signal.signal(number, _end)
    try:
        yield
    finally:
        # A terminal that is closed sends it more than once.
        for number in taken:
            signal.signal(number, signal.SIG_IGN)
        remove_unfinished()
        if restores:
            for number, handler in taken.items():
                signal.signal(number, handler)


def _end(number: int, frame: FrameType | None) -> None:
    raise Ended(number)


def final(status: int) -> int:
    """
    Return an exit status that no later signal changes.

    While the interpreter is finalised, it has removed its own handlers: a signal would then end
    the process by its default action, although the work is complete.
    """
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)
    return status


def child_environment() -> dict[str, str]:
    """Return the variable by which a `masmc run` that this process starts ends with it."""
    return {_PARENT: str(os.getpid())}


def end_with_parent() -> None:
    """
    End by SIGTERM when the process ends that asked for it, killed or not.

    Only that process's own child does; Linux tells it.
    """
    parent = os.environ.pop(_PARENT, None)
    if parent is None or sys.platform != 'linux':
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0)
    if str(os.getppid()) != parent:  # it ended before
        os.kill(os.getpid(), signal.SIGTERM)
