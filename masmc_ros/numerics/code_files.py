# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Files of compiled code that several processes may write at once.

Numba numbers the files of a function and maps signatures to numbers in an index file. Two
processes that compile at once, such as nodes started together, take the same number. One of them
would then load the code of the other: that of another law, for records of other sizes. Here
the file name is a digest of the signature, and the file contains the signature.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
import pickle
import tempfile

from numba import __version__ as numba_version
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

_Key = tuple[object, ...]
"""Key of Numba: types of the arguments, and the machine."""


class CodeFiles:
    """Code files of one function, in place of Numba's `IndexDataCacheFile`."""

    def __init__(self, folder: str, name: str, stamp: object) -> None:
        """
        Initialise the files of a function.

        Parameters
        ----------
        folder
            Folder of the files.
        name
            First part of their names.
        stamp
            Version of the source file.

        """
        self._folder, self._name = Path(folder), name
        self._made_of = numba_version, stamp

    def load(self, key: _Key) -> object:
        """Return the data saved under a key; None if there is none or the file is damaged."""
        try:
            made_of, signature, data = pickle.loads(self._path(key).read_bytes())
        except (OSError, *_DAMAGED):
            return None
        return data if made_of == self._made_of and signature == key else None

    def has(self, key: _Key) -> bool:
        """Return True if there is a file for a key, whole or damaged."""
        return self._path(key).exists()

    def save(self, key: _Key, data: object) -> None:
        """Save data under a key."""
        content = dumps((self._made_of, key, data))
        # A concurrent reader gets the previous file or this one, both complete.
        descriptor, temporary = tempfile.mkstemp(dir=self._folder, prefix=f'{self._name}.tmp.')
        try:
            with open(descriptor, 'wb') as file:
                file.write(content)
            os.replace(temporary, self._path(key))
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise

    def flush(self) -> None:
        """Delete all files."""
        for path in self._folder.glob(f'{self._name}.*.nbc'):
            path.unlink(missing_ok=True)

    def _path(self, key: _Key) -> Path:
        signature = hashlib.sha256(str(key).encode()).hexdigest()
        return self._folder / f'{self._name}.{signature[:32]}.nbc'
