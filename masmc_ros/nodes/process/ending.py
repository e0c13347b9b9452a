# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Signals that end a process, and the end of a child process with its parent."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import ctypes
import os
import signal
import sys
import threading
from types import FrameType

from masmc_ros.errors import UserError
from masmc_ros.files import remove_unfinished

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that end a process: from the keyboard, another process or a closed terminal."""


def on_end(handler: Callable[[int, FrameType | None], None]) -> None:
    """
    Install a handler for the signals of `ENDING`.

    SIGHUP, the signal of a closed terminal, stays ignored under `nohup`.
    """
    for number in ENDING:
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, handler)


@contextmanager
def ending_at_once() -> Iterator[None]:
    """
    End the process with status 0 at a signal, without the Python handler.

    A Python handler waits while LLVM compiles, which can take minutes. The signal's number in a
    pipe wakes a thread at once.
    """
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    before = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)

    def watch() -> None:
        while (number := os.read(reader, 1)[0]) != 0:
            if number in ENDING:
                os._exit(0)
        os.close(reader)

    watching = threading.Thread(target=watch, name='ending at once', daemon=True)
    watching.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.write(writer, bytes(1))
        watching.join()
        os.close(writer)


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
