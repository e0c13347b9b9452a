# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Files: those that are installed with the package, and results, which are always complete."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from difflib import get_close_matches
import errno
import os
from pathlib import Path
import re
import sys
from typing import BinaryIO

from masmc_ros.errors import InputError, suggestion

_OTHER = 'ros2_control'
"""Start of the names of parameter files for the nodes of other packages."""


def shared_file(*parts: str) -> Path:
    """
    Return a file such as `config/paper.yaml`; InputError if it is not installed.

    The folders are those of the sources, of a pip installation and of colcon.
    """
    for folder in _folders():
        path = folder.joinpath(*parts)
        if path.is_file():
            return path
    raise InputError(f'{"/".join(parts)}: not installed with masmc_ros; reinstall the package')


def scenarios() -> dict[str, Path]:
    """Return the parameter files that are installed with the package, by name."""
    files = (sorted(folder.glob('config/*.yaml')) for folder in _folders())
    first = next(filter(None, files), [])
    return {path.stem: path for path in first if not path.stem.startswith(_OTHER)}


def scenario_file(name: str) -> str:
    """Return the path of a parameter file: an existing one, or that of an installed name."""
    if name.startswith('~'):
        name = os.path.expanduser(name)
    if Path(name).exists() or Path(name).name != name:
        return name
    installed = scenarios()
    if name in installed:
        return str(installed[name])
    if Path(name).suffix or not installed:
        return name
    if get_close_matches(name, installed):
        raise InputError(f'{name}: no such file; {suggestion(name, installed)}')
    raise InputError(
        f'{name}: no such file; give the path of a parameter file or of a log, or the name of an '
        f'installed one: {", ".join(installed)}'
    )


def _folders() -> tuple[Path, ...]:
    package = Path(__file__).resolve().parent
    # colcon: PREFIX/lib/pythonX.Y/site-packages/masmc_ros, and PREFIX/share/masmc_ros.
    prefixes = [Path(sys.prefix), *package.parents[:5]]
    return (package.parent, *(p / 'share' / 'masmc_ros' for p in prefixes))


_unfinished: set[Path] = set()


class WholeFile:
    """File that is written as `NAME.part` in the same folder until it is complete."""

    def __init__(self, path: Path) -> None:
        """Initialise the file at a path; OSError if that is not possible."""
        self.path = path
        self.part = part_of(path)
        _unfinished.add(self.part)
        try:
            self.stream = self.part.open('wb')
        except BaseException:
            self._forget()
            raise

    def finish(self) -> None:
        """Give the file its name; OSError if that fails, after which the caller discards it."""
        self.stream.close()
        os.replace(self.part, self.path)
        _unfinished.discard(self.part)

    def discard(self) -> None:
        """Remove the file; a previous file of its name is kept."""
        # Data that a full disk rejected are not needed.
        with suppress(OSError):
            self.stream.close()
        self._forget()

    def _forget(self) -> None:
        # On a read-only disk the file cannot be removed.
        with suppress(OSError):
            self.part.unlink(missing_ok=True)
        _unfinished.discard(self.part)


def part_of(path: Path) -> Path:
    """Return the path of an incomplete file."""
    return path.parent / f'{path.name}.part'


def remove_unfinished() -> None:
    """Remove files that were neither finished nor discarded, before the process ends."""
    for part in tuple(_unfinished):
        with suppress(OSError):
            part.unlink(missing_ok=True)
        _unfinished.discard(part)


def make_folder(folder: Path) -> None:
    """Create a folder and its parents; InputError if that is not possible."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _error(folder, error) from error


def check_folder(folder: Path) -> None:
    """Raise InputError if a folder evidently cannot be created; write nothing."""
    existing = folder
    while not os.path.lexists(existing) and existing != existing.parent:
        existing = existing.parent
    if not os.path.isdir(existing):
        raise _error(folder, NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR)))
    if not os.access(existing, os.W_OK | os.X_OK):
        raise _error(folder, PermissionError(errno.EACCES, os.strerror(errno.EACCES)))


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """
    Write a file that gets its name, or replaces another file, once it is complete.

    Raises OSError if it cannot be written. A previous file of this name is kept.
    """
    file = WholeFile(path)
    try:
        yield file.stream
        file.finish()
    except BaseException:
        file.discard()
        raise


@contextmanager
def whole_file(path: Path) -> Iterator[BinaryIO]:
    """Write a file as `replacing` does; InputError if it cannot be written."""
    try:
        with replacing(path) as stream:
            yield stream
    except OSError as error:
        raise _error(path, error) from error


def write_file(path: Path, content: bytes) -> None:
    """Write a file completely; InputError if it cannot be written."""
    with whole_file(path) as stream:
        stream.write(content)


def check_absent(path: Path, *, overwrite: bool) -> None:
    """Raise InputError for an existing file, unless `overwrite` allows to replace it."""
    if path.exists() and not overwrite:
        raise InputError(f'{path}: exists already; add --overwrite to replace it')


def file_stem(name: str, taken: set[str]) -> str:
    """
    Return a file name for a name, with a number if necessary, and add it to `taken`.

    File names that differ only in upper and lower case are identical on some machines.
    """
    stem = re.sub(r'[^\w.-]+', '_', name)
    free, number = stem, 1
    while free.lower() in taken:
        number += 1
        free = f'{stem}_{number}'
    taken.add(free.lower())
    return free


def _error(path: Path, error: OSError) -> InputError:
    reason = error.strerror or str(error)
    return InputError(
        f'{path}: cannot be written ({reason}); expected a folder that can be made and written'
    )
