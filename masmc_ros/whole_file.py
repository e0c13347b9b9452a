# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Atomic files: a file gets its name, or replaces another one, once it is complete."""

from __future__ import annotations

from contextlib import suppress
import os
from pathlib import Path

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
