# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
