# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Files and folders for results: what is there is whole."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import errno
import os
from pathlib import Path
import re
from typing import BinaryIO

from masmc_ros.errors import InputError
from masmc_ros.whole_file import WholeFile


def make_folder(folder: Path) -> None:
    """Make a folder and those above it; InputError where that cannot be done."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _refused(folder, error) from error


def check_folder(folder: Path) -> None:
    """Raise InputError if a folder evidently cannot be created; write nothing."""
    there = folder
    while not os.path.lexists(there) and there != there.parent:
        there = there.parent
    if not os.path.isdir(there):
        raise _refused(folder, NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR)))
    if not os.access(there, os.W_OK | os.X_OK):
        raise _refused(folder, PermissionError(errno.EACCES, os.strerror(errno.EACCES)))


@contextmanager
def whole_file(path: Path) -> Iterator[BinaryIO]:
    """
    Write a file that takes its name, or another's place, once it is complete.

    Raises
    ------
    InputError
        where it cannot be written. What was there before is there still.

    """
    try:
        file = WholeFile(path)
        try:
            yield file.stream
            file.finish()
        except BaseException:
            file.discard()
            raise
    except OSError as error:
        raise _refused(path, error) from error


def file_stem(name: str, taken: set[str]) -> str:
    """
    Turn a name into that of a file, numbered if need be, which is `taken` from then on.

    Names that differ by upper and lower case only are the same on some machines.
    """
    stem = re.sub(r'[^\w.-]+', '_', name)
    free, number = stem, 1
    while free.lower() in taken:
        number += 1
        free = f'{stem}_{number}'
    taken.add(free.lower())
    return free


def _refused(path: Path, error: OSError) -> InputError:
    reason = error.strerror or str(error)
    return InputError(
        f'{path}: cannot be written ({reason}); expected a folder that can be made and written'
    )
