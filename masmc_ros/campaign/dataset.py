# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Dataset of a campaign: a folder of Parquet files, one for each part.

The name of a file contains its first run and its number of runs. A file gets its name when it is
complete, so an interrupted campaign continues with the missing runs. The metadata of every file
contain the description of the campaign, the versions and the key.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
import fcntl
from importlib.metadata import version
from itertools import pairwise
import os
from pathlib import Path
import platform
import re
from typing import Any

from masmc_ros import __version__
from masmc_ros.campaign.campaign import Campaign
from masmc_ros.campaign.runs import Rows
from masmc_ros.errors import InputError
from masmc_ros.files import make_folder, whole_file
from masmc_ros.log.write.provenance import git_state
import numpy as np
from numpy.typing import NDArray
import pyarrow as pa
from pyarrow import parquet

_NAME = re.compile(r'part-([0-9]{10})-([0-9]+)\.parquet')

_PREFIX = 'masmc_ros.'
"""Prefix of the names of metadata."""


def versions() -> dict[str, str]:
    """Return the versions on which the rows depend, by the name of the package, and `git`."""
    packages = {name: version(name) for name in ('numpy', 'numba', 'scipy')}
    return {'masmc_ros': __version__, 'git': git_state(), **packages}


@contextmanager
def reserved(folder: Path) -> Iterator[None]:
    """
    Create a folder and lock it against other processes, which could compute the same runs.

    Created folders that stay empty are removed. Raises InputError if another process has locked
    the folder. A file system without locks is accepted.
    """
    created = [path for path in (folder, *folder.parents) if not path.exists()]
    make_folder(folder)
    lock = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                f'{folder}: another process writes this dataset; wait until it ends, or choose '
                'another --output'
            ) from None
        except OSError:
            pass
        yield
    finally:
        for path in created:
            with suppress(OSError):
                path.rmdir()
        os.close(lock)


class Dataset:
    """Rows of a campaign on the disk."""

    def __init__(self, folder: Path, campaign: Campaign) -> None:
        """
        Initialise the dataset in a folder, which may have rows of the same campaign.

        Raises InputError if the folder has files of another campaign, damaged files, or rows of
        a run twice.
        """
        self.folder = folder
        self.campaign = campaign
        self._metadata = {
            'campaign': campaign.text,
            'key': campaign.key,
            'python': platform.python_version(),
            'machine': platform.machine(),
            **versions(),
        }
        for path in self._files():
            try:
                known = parquet.read_schema(path).metadata or {}
            except (OSError, pa.ArrowException) as error:
                raise InputError(
                    f'{path}: no readable Parquet file ({error}); remove it, and the same command'
                    ' computes its runs again'
                ) from None
            key = known.get(f'{_PREFIX}key'.encode(), b'')
            if key.decode() != campaign.key:
                raise InputError(
                    f'{path}: runs of another campaign or version; expected an empty folder, or '
                    'the same command to continue; choose another --output, or remove the folder'
                )
        for (first, count), (following, _) in pairwise(self._ranges()):
            if following < first + count:
                raise InputError(
                    f'{folder}: run {following} is in two files; remove the folder, and compute '
                    'the campaign again'
                )
        for path in folder.glob('part-*.parquet.part'):
            path.unlink()  # left by a killed process

    def missing(self, size: int) -> Iterator[tuple[int, int]]:
        """Yield first run and number of runs of missing parts, at most `size` runs per part."""
        edges = [(0, 0), *self._ranges(), (self.campaign.total, 0)]
        for (first, count), (following, _) in pairwise(edges):
            for start in range(first + count, following, size):
                yield start, min(size, following - start)

    @property
    def done(self) -> int:
        """Return the number of runs on the disk."""
        return sum(count for _, count in self._ranges())

    def write(self, rows: Rows) -> None:
        """Write the rows of a part to a new file, which appears when it is complete."""
        make_folder(self.folder)
        first, count = int(rows['run'][0]), len(rows['run'])
        path = self.folder / f'part-{first:010d}-{count}.parquet'
        with whole_file(path) as stream:
            parquet.write_table(self._table(rows), stream, compression='zstd')

    def table(self) -> pa.Table:
        """Return all rows on the disk, sorted by the number of the run."""
        return pa.concat_tables([parquet.read_table(path) for path in self._files()])

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return all columns on the disk, sorted by the number of the run, as `arrays`."""
        columns: dict[str, NDArray[Any]] = {}
        first = 0
        # One file at a time: a table of all and its columns take twice the memory.
        for path in self._files():
            for name, values in arrays(parquet.read_table(path)).items():
                if name not in columns:
                    columns[name] = np.empty(self.done, values.dtype)
                columns[name][first:first + len(values)] = values
            first += len(values)
        return columns

    def _files(self) -> list[Path]:
        return sorted(path for path in self.folder.glob('part-*') if _NAME.fullmatch(path.name))

    def _ranges(self) -> list[tuple[int, int]]:
        """Return first run and number of runs of each file, sorted."""
        matches = (_NAME.fullmatch(path.name) for path in self._files())
        return sorted((int(match[1]), int(match[2])) for match in matches if match)

    def _table(self, rows: Rows) -> pa.Table:
        # NaN stands for missing numbers, which tables of other programs count as null.
        columns = {name: pa.array(values, from_pandas=True) for name, values in rows.items()}
        metadata = {f'{_PREFIX}{name}': value for name, value in self._metadata.items()}
        return pa.table(columns).replace_schema_metadata(metadata)


def arrays(table: pa.Table) -> dict[str, NDArray[Any]]:
    """Return the columns of a table as arrays, missing numbers as NaN."""
    return {name: table[name].to_numpy() for name in table.column_names}
