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

from masmc_ros.errors import UserError
from masmc_ros.nodes.process.ending import ENDING
from masmc_ros.output_files import remove_unfinished

_PARENT = 'MASMC_ROS_PARENT'
"""Environment variable: number of the process with which a child ends."""

_PR_SET_PDEATHSIG = 1


class Ended(KeyboardInterrupt):
    """A signal ended the process."""

    def __init__(self, number: int) -> None:
        """Initialise the error with the number of the signal."""
        super().__init__(number)
        self.number = number
        self.name = signal.Signals(number).name


@contextmanager
def ended_by_signals(*, restores: bool = True) -> Iterator[None]:
    """
    Raise Ended when a signal arrives, and remove unfinished files.

    Ignored signals, as under `nohup`, remain ignored. Afterwards the previous handlers are
    restored if `restores` is True; otherwise signals are ignored until the process ends.
    """
    ends: list[Ended] = []

    def end(number: int, frame: FrameType | None) -> None:
        ends.append(Ended(number))
        raise ends[-1]

    handlers = {number: signal.getsignal(number) for number in ENDING}
    replaced = {n: h for n, h in handlers.items() if h not in (None, signal.SIG_IGN)}
    for number in replaced:
        signal.signal(number, end)
    try:
        yield
    except Exception as error:
        # Modules in C replace an error that is raised while they are imported.
        if ends and not isinstance(error, UserError):
            raise ends[0] from None
        raise
    finally:
        # A closed terminal sends its signal more than once.
        for number in replaced:
            signal.signal(number, signal.SIG_IGN)
        remove_unfinished()
        if restores:
            for number, handler in replaced.items():
                signal.signal(number, handler)


def final(status: int) -> int:
    """
    Return an exit status that later signals do not change.

    The interpreter removes its handlers before it ends: a signal would then end the process by
    its default action, although the work is complete.
    """
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)
    return status


def child_environment() -> dict[str, str]:
    """
    Return the variables of a child `masmc run`: it ends with this process.

    It reads its arguments as UTF-8, as rcl does, in any locale.
    """
    return {_PARENT: str(os.getpid()), 'PYTHONUTF8': '1'}


def end_with_parent() -> None:
    """
    End this process by SIGTERM when the parent that requested it ends, killed or not.

    Only direct children of that process end with it, and only on Linux.
    """
    parent = os.environ.pop(_PARENT, None)
    if parent is None or sys.platform != 'linux':
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0)
    if str(os.getppid()) != parent:  # the parent has already ended
        os.kill(os.getpid(), signal.SIGTERM)
