# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Files of compiled code that several processes may write at once.

Numba numbers the files of a function and maps signatures to numbers in an index file. Two
processes that compile at once, such as nodes started together, take the same number. One of them
would then load the code of the other: that of another law, for records of other sizes. Here
the file name has digests of the signature and of the sources, and the file contains both.

A process that compiles holds a lock; others that need the same code wait for it.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cache
import hashlib
import logging
import math
import os
from pathlib import Path
import pickle
import tempfile
import time

from masmc_ros.jit.generated import Types
from numba.core import event
from numba.core.serialize import dumps

_DAMAGED = (
    pickle.UnpicklingError,
    EOFError,
    ImportError,
    AttributeError,
    LookupError,
    TypeError,
    ValueError,
)
"""Errors of unpickling a damaged file, or one with removed names."""

_VERSIONS = 3
"""Number of kept files of a signature for different sources, such as those of two branches."""

_LONGEST_WAIT = 120.0
"""
Maximum time in s to wait for another process that compiles the same code.

A process that has been stopped, or a slow one, would otherwise delay the others further.
"""

WAITING = 'masmc_ros:waiting_for_code'
"""Event of Numba's kind: another process compiles the code that this one needs."""

_POLLING = 0.002
"""Time in s between two attempts to get a lock."""

Key = tuple[Types, object, object]
"""Key of Numba: types of the arguments, the machine and the code of the function."""


class CodeFiles:
    """Code files of one function, in place of Numba's `IndexDataCacheFile`."""

    def __init__(self, folder: str, name: str, sources: Callable[[Key], str]) -> None:
        """
        Initialise the files of a function.

        Parameters
        ----------
        folder
            Folder of the files.
        name
            First part of their names.
        sources
            Key -> digest of all sources of its code.

        """
        self._folder, self._name, self._sources = Path(folder), name, sources

    def load(self, key: Key) -> object:
        """
        Return the data saved under a key, or None if this process has to compute them.

        Other processes that load the same data wait until they are saved, or the lock is released.
        """
        data = self.read(key)
        if data is None and LOCKS.acquire(self.path(key)):
            # The previous owner of the lock may have saved them.
            data = self.read(key)
            if data is not None:
                LOCKS.release(self.path(key))
        return data

    def read(self, key: Key) -> object:
        """Return the data saved under a key; None if there is none or the file is damaged."""
        try:
            sources, signature, data = pickle.loads(self.path(key).read_bytes())
        except (OSError, *_DAMAGED):
            return None
        return data if sources == self._sources(key) and signature == key else None

    def save(self, key: Key, data: object) -> None:
        """
        Save data under a key, and delete the oldest files of other sources.

        If the folder cannot take a file, the code in memory is used, and a line says so once.
        """
        try:
            self._save(key, data)
        except OSError as error:
            _report(str(self._folder), error.strerror or str(error))
        finally:
            LOCKS.release(self.path(key))

    def _save(self, key: Key, data: object) -> None:
        content = dumps((self._sources(key), key, data))
        # A concurrent reader gets the previous file or this one, both complete.
        descriptor, temporary = tempfile.mkstemp(dir=self._folder, prefix=f'{self._name}.tmp.')
        try:
            with open(descriptor, 'wb') as file:
                file.write(content)
            os.replace(temporary, self.path(key))
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
        with suppress(OSError):  # another process may delete the same files
            files = set(self._folder.glob(f'{self._signature(key)}.*.nbc')) - {self.path(key)}
            for path in sorted(files, key=_time)[:1 - _VERSIONS]:
                path.unlink(missing_ok=True)

    def flush(self) -> None:
        """Delete all files."""
        for path in self._folder.glob(f'{self._name}.*.nbc'):
            path.unlink(missing_ok=True)

    def _signature(self, key: Key) -> str:
        """Return the name of the files of a key, without the digest of its sources."""
        return f'{self._name}.{hashlib.sha256(str(key).encode()).hexdigest()[:32]}'

    def path(self, key: Key) -> Path:
        """Return the path of the file of a key."""
        return self._folder / f'{self._signature(key)}.{self._sources(key)}.nbc'


class _Locks:
    """
    Locks of the code that this process computes: bytes of one file in each folder.

    Without locks, as on Windows and some network file systems, every process computes the code
    itself. So does a process that runs only if no other one has to: all others would wait for it.
    """

    def __init__(self) -> None:
        self._held: list[Path] = []
        self._end_of_patience = math.inf

    def acquire(self, path: Path) -> bool:
        """
        Wait until no other process computes the code of a path; return True if it is locked now.

        A process waits for one whose code is not there after the longest wait, and not again for
        each function that this code needs.
        """
        if path in self._held or _is_idle():
            return False
        try:
            return self._lock(path) or self._wait(path)
        except (ImportError, OSError):
            return False

    def _lock(self, path: Path) -> bool:
        import fcntl  # not on Windows

        try:
            fcntl.lockf(_lock_file(path.parent), fcntl.LOCK_EX | fcntl.LOCK_NB, 1, _place(path))
        except (BlockingIOError, PermissionError):
            return False
        self._held.append(path)
        return True

    def _wait(self, path: Path) -> bool:
        end = min(time.monotonic() + _LONGEST_WAIT, self._end_of_patience)
        with event.trigger_event(WAITING):
            while time.monotonic() < end:
                time.sleep(_POLLING)
                if self._lock(path):
                    return True
        self._end_of_patience = end
        return False

    def release(self, path: Path) -> None:
        """
        Let other processes compute the code of a path, which this process has saved.

        Code that it needed and that was not saved is released as well; its compilation failed.
        """
        if path in self._held:
            self._release_from(self._held.index(path))

    def release_all(self) -> None:
        """Let other processes compute what this process could not compile."""
        self._release_from(0)

    def _release_from(self, first: int) -> None:
        for path in self._held[first:]:
            _unlock(path)
        del self._held[first:]


LOCKS = _Locks()
"""Locks of this process."""


def _unlock(path: Path) -> None:
    import fcntl

    with suppress(OSError):
        fcntl.lockf(_lock_file(path.parent), fcntl.LOCK_UN, 1, _place(path))


def _is_idle() -> bool:
    return hasattr(os, 'SCHED_IDLE') and os.sched_getscheduler(0) == os.SCHED_IDLE


@cache
def _lock_file(folder: Path) -> int:
    """Return the descriptor of the file of a folder whose bytes are locked, one for each code."""
    return os.open(folder / 'locks', os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)


def _place(path: Path) -> int:
    return int.from_bytes(hashlib.sha256(path.name.encode()).digest()[:7], 'big')


@cache
def _report(folder: str, reason: str) -> None:
    logging.getLogger(__name__).warning(
        'compiled code is not stored in %s: %s; it is compiled again next time', folder, reason
    )


def _time(path: Path) -> int:
    return path.stat().st_mtime_ns
