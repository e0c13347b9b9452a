# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Files of compiled code that several processes may write at once.

Numba numbers the files of a function and maps signatures to numbers in an index file. Two
processes that compile at once, such as nodes started together, take the same number. One of them
would then load the code of the other: that of another law, for records of other sizes. Here
the file name has digests of the signature and of the sources, and the file contains both.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cache
import hashlib
import logging
import os
from pathlib import Path
import pickle
import tempfile

from masmc_ros.jit.generated import Types
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


@cache
def _report(folder: str, reason: str) -> None:
    logging.getLogger(__name__).warning(
        'compiled code is not stored in %s: %s; it is compiled again next time', folder, reason
    )


def _time(path: Path) -> int:
    return path.stat().st_mtime_ns
