# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Logged runs as tables and arrays for other programs, without rounding."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
import csv
from importlib.util import find_spec
import io
from itertools import chain
from pathlib import Path
from typing import BinaryIO, NamedTuple

from masmc_ros.aliases import Array, Flags
from masmc_ros.errors import InputError
from masmc_ros.files import check_absent, check_folder, file_stem, make_folder, whole_file
from masmc_ros.log.bag import check_apart
from masmc_ros.log.read.decode import Series
from masmc_ros.log.read.reader import Run
from masmc_ros.loop.signals import CONTACT, PUBLISHED
import numpy as np


class Column(NamedTuple):
    """Head of a column, which ends with the unit; units in letters, such as m_per_s2."""

    name: str
    unit: str


class Part(NamedTuple):
    """Adjacent columns; their numbers (n, k) at the states, or at other times, or None."""

    name: str
    columns: list[Column]
    numbers: Array | Series | None


class Table(NamedTuple):
    """
    Numbers of a run, with a row per state.

    Attributes
    ----------
    columns
        (k) heads.
    values
        (n, k).
    known
        (n, k) True for values that the log has.

    """

    columns: tuple[Column, ...]
    values: Array
    known: Flags


def table_of(run: Run) -> Table:
    """
    Return the numbers of a run, with the torques and velocities that were commanded.

    Values with other stamps than the states are in the row of the last state before; of several
    in one row, the last is kept.
    """
    parts = tuple(parts_of(run))
    rows = (_rows(run.times, part.numbers, len(part.columns)) for part in parts)
    values, known = zip(*rows, strict=True)
    columns = chain.from_iterable(part.columns for part in parts)
    return Table(tuple(columns), np.hstack(values), np.hstack(known))


def _columns(quantity: str, names: Sequence[str], units: Sequence[str]) -> list[Column]:
    """Return the columns of a quantity by the names of its components, such as joints."""
    # kg_m2 for kg·m².
    plain = [u.replace('·', '_').replace('²', '2').replace('/', '_per_') for u in units]
    return [
        Column('_'.join(filter(None, (quantity, name, unit))), unit)
        for name, unit in zip(names, plain, strict=True)
    ]


def parts_of(run: Run) -> Iterator[Part]:
    """Yield all numbers of a run, in the order of the columns."""
    mechanism, joints = run.mechanism, run.joint_names
    units = [position.unit for position in mechanism.positions]
    axes = [axis.name for axis in mechanism.axes]
    driven = joints[len(mechanism.base):]
    rates = [f'{unit}/s' for unit in units]
    yield Part('time_s', _columns('time', [''], ['s']), run.times[:, None])
    yield Part('position', _columns('position', joints, units), run.position)
    yield Part('velocity', _columns('velocity', joints, rates), run.velocity)
    efforts = [joint.effort_unit for joint in mechanism.joints]
    heads = _columns('applied_effort', driven, efforts)
    yield Part('applied_effort', heads, run.applied_effort)
    if not run.commands_rates:
        yield Part('command', _columns('command', driven, efforts), run.torque)
    # Commands of drives that follow velocities.
    if len(run.cmd_vel) or len(run.arm_rates):
        twist = mechanism.twist
        names = [velocity.name.replace(' ', '_') for velocity in twist]
        heads = _columns('command', names, [velocity.unit for velocity in twist])
        yield Part('cmd_vel', heads, run.cmd_vel)
        rates = [f'{joint.unit}/s' for joint in mechanism.own_rates]
        yield Part('arm_rate', _columns('command', driven[len(twist):], rates), run.arm_rates)
    reference = [
        column
        for name, per in (('position', ''), ('velocity', '/s'), ('acceleration', '/s²'))
        for column in _columns(
            f'reference_{name}', axes, [axis.unit + per for axis in mechanism.axes]
        )
    ]
    yield Part('reference', reference, run.reference)
    for signal in PUBLISHED:
        if not (signal.of_torques and run.commands_rates):
            components = run.components(signal)
            units = [signal.unit_of(component.unit) for component in components]
            heads = _columns(signal.name, [component.name for component in components], units)
            yield Part(signal.name, heads, run.telemetry.get(signal.name))
    if run.contact is not None:
        contacts = [
            column
            for name in run.contact_names
            for part in CONTACT
            for column in _columns(part.name, [name], [part.unit])
        ]
        yield Part('contact', contacts, run.contact)


def _rows(
    states: Array, numbers: Array | Series | None, width: int
) -> tuple[Array, Flags]:
    """Return numbers in the rows of the states (n, width), and the rows that have them."""
    if isinstance(numbers, np.ndarray):
        return numbers, ~np.isnan(numbers)
    values = np.zeros((len(states), width))
    known = np.zeros((len(states), width), bool)
    if numbers is not None:
        rows = np.searchsorted(states, numbers.times, side='right') - 1
        is_after = rows >= 0
        values[rows[is_after]] = numbers.values[is_after]
        known[rows[is_after]] = True
    return values, known


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
