# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Line on a terminal while a command compiles code that this machine does not have yet."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import sys
from threading import Event, Thread
import time

from masmc_ros.jit.code_files import WAITING
from numba.core import event

_PATIENCE = 2.0
"""Time in s of a compilation before the line appears."""

_KINDS = 'numba:compile', WAITING
"""Events of Numba's kind that the line shows; nested ones count once."""


class _Watch(event.Listener):
    """Sum of the times during which Numba compiles, or another process does so for this one."""

    def __init__(self) -> None:
        self.seconds, self._depth, self._since = 0.0, 0, 0.0

    def on_start(self, event: event.Event) -> None:
        if self._depth == 0:
            self._since = time.monotonic()
        self._depth += 1

    def on_end(self, event: event.Event) -> None:
        self._depth -= 1
        if self._depth == 0:
            self.seconds += time.monotonic() - self._since

    @property
    def total(self) -> float:
        """Return the time in s, with that of a compilation in progress."""
        return self.seconds + (time.monotonic() - self._since if self._depth else 0.0)


@contextmanager
def compile_notice(subject: str) -> Iterator[_Watch]:
    """
    Show what is compiled and for how long; nothing without a terminal.

    Parameters
    ----------
    subject
        What the code belongs to, such as 'rasmc (implicit) for tiago'.

    """
    watch, done = _Watch(), Event()
    for kind in _KINDS:
        event.register(kind, watch)
    thread = Thread(target=_show, args=(watch, done, subject), daemon=True)
    if sys.stderr is not None and sys.stderr.isatty():
        thread.start()
    try:
        yield watch
    finally:
        for kind in _KINDS:
            event.unregister(kind, watch)
        done.set()
        if thread.ident is not None:
            thread.join()


def _show(watch: _Watch, done: Event, subject: str) -> None:
    """Rewrite one line every second, and leave it complete."""
    shown = False
    while not done.wait(1.0):
        if watch.total > _PATIENCE:
            shown = True
            _write(f'compiling {subject}, once on this machine: {watch.total:.0f} s', end='\r')
    if shown:
        _write(f'compiled {subject} in {watch.total:.0f} s; later runs load it', end='\n')


def _write(text: str, end: str) -> None:
    print(f'{text:<79}', end=end, file=sys.stderr, flush=True)
