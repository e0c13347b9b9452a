# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Outputs that are inputs too, through links as well, told before any work is done."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
import os
from pathlib import Path

from masmc_ros.errors import InputError
from masmc_ros.log.bag import METADATA_FILE, part_names
from masmc_ros.whole_file import part_of


def check_apart(outputs: Iterable[Path], inputs: Iterable[str | Path]) -> None:
    """
    Raise InputError where writing a file or a folder would touch what is read.

    Of an input that is the folder of a recording, its parts count as well.
    """
    written = [(output, path) for output in outputs for path in (output, part_of(output))]
    for source in inputs:
        for read in _files(Path(source)):
            for output, path in written:
                if _is_same(path, read):
                    raise InputError(f'{output}: is what is read from {source}; name another')


def _files(source: Path) -> Iterator[Path]:
    yield source
    if os.path.isdir(source):
        yield source / METADATA_FILE
        with suppress(InputError):  # whoever reads it tells
            yield from (source / name for name in part_names(source))


def _is_same(one: Path, other: Path) -> bool:
    try:
        return os.path.samefile(one, other)
    except (OSError, ValueError):  # one of them is not there
        return False
