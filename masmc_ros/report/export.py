# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Logged runs as tables and arrays for other programs, without rounding."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import csv
from importlib.util import find_spec
import io
from pathlib import Path
from typing import BinaryIO

from masmc_ros.errors import InputError
from masmc_ros.log.read.reader import Run
from masmc_ros.log.recover.overlap import check_apart
from masmc_ros.output_files import check_absent, check_folder, file_stem, make_folder, whole_file
from masmc_ros.report.columns import parts_of, table_of
import numpy as np

_BLOCK = 10_000
"""Rows of a CSV file that are converted to text at a time."""


def write_export(
    runs: Sequence[Run], directory: str | Path, file_format: str, *, overwrite: bool
) -> list[Path]:
    """
    Write one file per run, with the name of its log, into a folder, created if necessary.

    Parameters
    ----------
    runs
        the runs.
    directory
        the folder.
    file_format
        one of FORMATS.
    overwrite
        whether existing files may be replaced.

    Returns
    -------
        The files.

    Raises
    ------
    InputError
        if a file exists or cannot be written, or if the format needs a missing package.

    """
    logs = [run.path for run in runs]
    paths = check_export(logs, directory, file_format, overwrite=overwrite)
    make_folder(Path(directory))
    for run, path in zip(runs, paths, strict=True):
        with whole_file(path) as stream:
            FORMATS[file_format](run, stream)
    return paths


def check_export(
    logs: Sequence[str | Path], directory: str | Path, file_format: str, *, overwrite: bool
) -> list[Path]:
    """
    Return the files that an export of logs writes, without reading or writing any.

    Raises InputError as `write_export`, and if a file would replace a log.
    """
    _check_format(file_format)
    directory = Path(directory)
    taken: set[str] = set()
    stems = [file_stem(Path(log).resolve().stem, taken) for log in logs]
    paths = [directory / f'{stem}.{file_format}' for stem in stems]
    check_apart([directory, *paths], logs)
    check_folder(directory)
    for path in paths:
        check_absent(path, overwrite=overwrite)
    return paths


def _check_format(file_format: str) -> None:
    """Raise InputError if this machine cannot write a format."""
    if file_format == 'parquet' and find_spec('pyarrow') is None:
        raise InputError(
            'parquet: needs pyarrow, which is not installed; pip install pyarrow, or'
            ' use csv or npz'
        )


def _write_csv(run: Run, stream: BinaryIO) -> None:
    """Write a table as CSV: floats in the shortest form that gives the same number."""
    columns, values, known = table_of(run)
    text = io.TextIOWrapper(stream, encoding='utf-8', newline='', write_through=True)
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow([column.name for column in columns])
    for first in range(0, len(values), _BLOCK):
        block = values[first:first + _BLOCK].astype(object)
        block[~known[first:first + _BLOCK]] = None
        writer.writerows(block.tolist())
    text.detach()


def _write_parquet(run: Run, stream: BinaryIO) -> None:
    """Write a table as Parquet: null for missing values, units as metadata of the fields."""
    # Imported here, as the package is optional.
    import pyarrow as pa
    from pyarrow import parquet

    columns, values, known = table_of(run)
    fields = [pa.field(c.name, pa.float64(), metadata={'unit': c.unit}) for c in columns]
    arrays = [
        pa.array(np.ascontiguousarray(column), mask=~present, from_pandas=False)
        for column, present in zip(values.T, known.T, strict=True)
    ]
    parquet.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields)), stream)


def _write_npz(run: Run, stream: BinaryIO) -> None:
    """Write the unmodified signals of the log, each with its own times."""
    arrays: dict[str, np.ndarray] = {}
    for name, _, numbers in parts_of(run):
        if isinstance(numbers, np.ndarray):
            arrays[name] = numbers
        elif numbers or (numbers is not None and name not in ('cmd_vel', 'arm_rate')):
            arrays |= {f'{name}_time_s': numbers.times, name: numbers.values}
    np.savez(stream, allow_pickle=False, **{**arrays, 'time_s': run.times})


FORMATS: dict[str, Callable[[Run, BinaryIO], None]] = {
    'csv': _write_csv,
    'parquet': _write_parquet,
    'npz': _write_npz,
}
"""Functions that write a run, by format, which is the suffix of the files."""
