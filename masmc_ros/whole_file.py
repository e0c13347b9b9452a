# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Files that are whole: each takes its name, or another's place, once it is complete."""

from __future__ import annotations

from contextlib import suppress
import os
from pathlib import Path

_unfinished: set[Path] = set()


class WholeFile:
    """A file that is written as `NAME.part` next to its place until it is complete."""

    def __init__(self, path: Path) -> None:
        """Begin the file; OSError where that is not possible."""
        self.path = path
        self.part = part_of(path)
        _unfinished.add(self.part)
        try:
            self.stream = self.part.open('wb')
        except BaseException:
            self._forget()
            raise

    def finish(self) -> None:
        """Give the file its name; OSError where that fails, and `discard` is to follow."""
        self.stream.close()
        os.replace(self.part, self.path)
        _unfinished.discard(self.part)

    def discard(self) -> None:
        """Leave nothing of it; what was there before is there still."""
        # What a full disk has not taken is not wanted any more either.
        with suppress(OSError):
            self.stream.close()
        self._forget()

    def _forget(self) -> None:
        # As far as that goes: where nothing can be written, nothing can be removed.
        with suppress(OSError):
            self.part.unlink(missing_ok=True)
        _unfinished.discard(self.part)


def part_of(path: Path) -> Path:
    """Return where a file is written before it takes its name."""
    return path.parent / f'{path.name}.part'


def remove_unfinished() -> None:
    """Remove what was begun and neither finished nor discarded: the process ends."""
    for part in tuple(_unfinished):
        with suppress(OSError):
            part.unlink(missing_ok=True)
        _unfinished.discard(part)
