# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Check that outputs are not inputs, through links as well."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
import os
from pathlib import Path

from masmc_ros.errors import InputError
from masmc_ros.log.bag import METADATA_FILE, part_names
from masmc_ros.output_files import part_of


def check_apart(outputs: Iterable[Path], inputs: Iterable[str | Path]) -> None:
    """
    Raise InputError if writing a file or a folder would change an input.

    The parts of a recording are inputs as well if its folder is.
    """
    written = [(output, path) for output in outputs for path in (output, part_of(output))]
    for source in inputs:
        for read in _files(Path(source)):
            for output, path in written:
                # One of them may be missing.
                with suppress(OSError, ValueError):
                    if os.path.samefile(path, read):
                        raise InputError(f'{output}: is what is read from {source}; name another')


def _files(source: Path) -> Iterator[Path]:
    yield source
    if os.path.isdir(source):
        yield source / METADATA_FILE
        with suppress(InputError):  # its reader reports it
            yield from (source / name for name in part_names(source))
