# SPDX-License-Identifier: Apache-2.0
"""What killed processes leave in the middleware's shared memory, and what hangs on it.

Fast DDS makes a file for every port that a participant listens on. Whoever finds such a file
half made waits until its maker has finished, without a bound; if the maker was killed, for
ever. The next participant with the same port number then stands still while it is created.
"""

from __future__ import annotations

from contextlib import suppress
import os
from pathlib import Path
import time

_FOLDER = Path('/dev/shm')

_MAKING = 2.0
"""Time in s after which a file that is not whole has lost its maker; making takes microseconds."""

_LOOK = 0.05

_WORD = 4
"""Bytes of the state in which a file begins (boost::interprocess, managed_open_or_create)."""

_HALF_MADE = (b'', bytes(_WORD), b'\x01\0\0\0')
"""Nothing yet, uninitialized, initializing."""

_CORRUPTED = b'\x03\0\0\0'
"""On this state whoever waits gives up, and makes the file anew."""


def clear_half_made(folder: Path = _FOLDER) -> list[Path]:
    """Remove files of Fast DDS whose makers were killed; return them.

    Files that might still be in the making are waited for. Who already stands still in front
    of one goes on. Files of other users are left alone.
    """
    cleared = []
    for path in _files(folder):
        with suppress(OSError):
            while _state(path) in _HALF_MADE:
                if time.time() - path.stat().st_mtime > _MAKING:
                    _remove(path)
                    cleared.append(path)
                    break
                time.sleep(_LOOK)
    return cleared


def _files(folder: Path) -> list[Path]:
    """Return the files that are made so; those beside them, of locks, are empty by nature."""
    try:
        names = os.listdir(folder)
    except OSError:
        return []
    return [
        folder / name
        for name in names
        if name.startswith('fastrtps_') and not name.endswith(('_el', '_sl', '_mutex'))
    ]


def _state(path: Path) -> bytes:
    with path.open('rb') as stream:
        return stream.read(_WORD)


def _remove(path: Path) -> None:
    with path.open('r+b') as stream:
        stream.write(_CORRUPTED)
    path.unlink()
