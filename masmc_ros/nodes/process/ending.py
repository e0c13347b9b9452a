# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Signals that end a process, and their handlers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import os
import signal
import threading
from types import FrameType

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
