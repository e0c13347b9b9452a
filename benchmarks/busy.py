# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Other work for the processors during a measurement."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import subprocess
import sys


@contextmanager
def busy(count: int) -> Iterator[None]:
    """Run `count` endless loops."""
    loops = [subprocess.Popen([sys.executable, '-c', 'while True: pass']) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()
