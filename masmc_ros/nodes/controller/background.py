# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Thread for computations that must not delay a tick."""

from __future__ import annotations

from collections.abc import Callable
from queue import SimpleQueue
import sys
from threading import Thread

_MOST_WAITING = 20
"""Computations that may wait; further ones are skipped."""

_SWITCH_INTERVAL = 2e-4
"""Time in s after which the thread gives way to a tick; 5 ms by default."""


class Background:
    """Thread that calls functions one after another."""

    def __init__(self) -> None:
        """Initialise without a thread; the first function starts it."""
        self._calls: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._thread: Thread | None = None

    def call(self, function: Callable[[], None]) -> bool:
        """Call a function later; return False if too many are waiting."""
        if self._calls.qsize() >= _MOST_WAITING:
            return False
        if self._thread is None:
            sys.setswitchinterval(min(_SWITCH_INTERVAL, sys.getswitchinterval()))
            self._thread = Thread(target=self._run, daemon=True)
            self._thread.start()
        self._calls.put(function)
        return True

    def close(self) -> None:
        """Wait for the current functions, and end the thread."""
        if self._thread is not None:
            self._calls.put(None)
            self._thread.join()

    def _run(self) -> None:
        while (function := self._calls.get()) is not None:
            function()
