# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Path from a file: CSV or Parquet with a column for each task axis, or YAML.

A file of an exported run has such columns, so a run can follow the reference of another one.
Between the points the path is a polynomial of degree five. A sample at the time of a point is that
point, unchanged.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
import csv
import io
from itertools import chain
from pathlib import Path
from typing import Any, ClassVar

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError, remedy, suggestion
from masmc_ros.params.declaration import Parameter, Values
from masmc_ros.reference.following_base import KnotPath
from masmc_ros.reference.minimum_jerk import sample_knots, smooth_knots
from masmc_ros.reference.reference import Declared
from masmc_ros.robot.declaration import Mechanism, Quantity
import numpy as np

_ON_POINT = 2e-9
"""Largest distance in s of a time from that of a point which is used without interpolation."""

_LATEST = 1e6
"""Latest time of the first point in s; a later one is the stamp of a clock."""

Names = tuple[str, ...]
"""Names that a column may have."""

_TIMES = ('time_s', 'time', 't')
"""Names of the column of times."""

_ORDERS = (('position', ''), ('velocity', '/s'), ('acceleration', '/s²'))
"""Quantities of an axis, and the unit of each after that of the axis."""

_KEYS = ('points', 'velocities', 'accelerations')
"""Keys of a YAML file for these quantities."""

_MOST_BYTES = 2_000_000_000
"""Largest size of a file; a million points of 18 axes take 1 GB."""


class PathFile(KnotPath):
    """Motion through the points of a file, which holds the first and the last point."""

    parameters: ClassVar[Declared] = (
        Parameter(
            'file.path', '',
            'File of the path: CSV or Parquet with columns such as time_s, x_E_m and '
            'velocity_x_E_m_per_s, or YAML with times and points',
        ),
        Parameter(
            'file.stops', False,
            'Stop at each point, and connect the points by straight lines; for files without '
            'velocities',
        ),
    )  # fmt: skip

    def __init__(self, values: Values) -> None:
        """Initialise from `times` (n), `knots` (n, 3 axes) and the text `place` of messages."""
        self._times: Array = values['times']
        self._knots: Array = values['knots']
        self._place: str = values['place']
        self._lacks_base: bool = values['lacks_base']

    @classmethod
    def of(cls, values: Values, mechanism: Mechanism) -> PathFile:
        """
        Read the file of checked values for the axes of a mechanism.

        Raises
        ------
        InputError
            If the file cannot be read, or a column, a number or the order of times is wrong.

        """
        path = Path(values['path']).expanduser()
        place = f'file.path = {values["path"]}'
        if not values['path']:
            raise InputError("file.path = '': expected a file of the path: CSV, Parquet or YAML")
        read = _READERS.get(path.suffix.lower())
        if read is None:
            hint = 'masmc export writes CSV from a log' if path.suffix == '.mcap' else ''
            expected = f'expected a file that ends with {", ".join(_READERS)}'
            raise InputError('; '.join(filter(None, (f'{place}: {expected}', hint))))
        try:
            size = path.stat().st_size
            if size > _MOST_BYTES:
                raise InputError(f'{place}: {size} bytes; expected at most {_MOST_BYTES}')
            columns, lacks_base = read(path, place, mechanism)
        except OSError as error:
            raise InputError(f'{place}: {error.strerror or error}') from None
        times, knots = _checked(columns, place)
        axes = len(_own_axes(mechanism, lacks_base=lacks_base))
        if knots.shape[1] == axes:
            knots = np.hstack([knots, np.zeros((len(knots), 2 * axes))])
            if not values['stops']:
                smooth_knots(times, knots)
        elif values['stops']:
            raise InputError(f'{place}: it has velocities; expected file.stops = false')
        elif knots.shape[1] == 2 * axes:
            knots = np.hstack([knots, _accelerations(times, knots)])
        if lacks_base:
            assert mechanism.carrier is not None
            first = mechanism.carrier.first
            at = [k * axes + first for k in range(3) for _ in range(mechanism.carrier.size)]
            knots = np.insert(knots, at, 0.0, axis=1)
        return cls({
            'times': times, 'knots': np.ascontiguousarray(knots), 'place': place,
            'lacks_base': lacks_base,
        })

    def sample(self, times: Array) -> Array:
        """
        Return (n, 3 axes) samples at times (n) in s.

        Raises InputError for a time before or after a path that does not start or end at rest.
        """
        known, knots = self._times, self._knots
        axes = knots.shape[1] // 3
        for end, is_outside, when in (
            (0, times < known[0] - _ON_POINT, 'starts'),
            (-1, times > known[-1] + _ON_POINT, 'ends'),
        ):
            if is_outside.any() and knots[end, axes:].any():
                raise InputError(
                    f'{self._place}: the path moves when it {when} at t = {known[end]:g} s, and is'
                    f' needed at t = {times[is_outside][0]:g} s; expected zero velocity and '
                    'acceleration there, or a path and a duration of the same length'
                )
        samples = np.asarray(sample_knots(known, knots, times))
        after = np.clip(np.searchsorted(known, times), 1, max(1, len(known) - 1))
        for near in (after - 1, np.minimum(after, len(known) - 1)):
            is_on = np.abs(known[near] - times) <= _ON_POINT
            samples[is_on] = knots[near[is_on]]
        return samples


def _accelerations(times: Array, knots: Array) -> Array:
    """
    Return accelerations (n, axes) at knots (n, 2 axes) with positions and velocities.

    At an inner knot it is the mean of those of the two cubic polynomials that meet there; at both
    ends it is that of the path's only cubic, or zero at rest.
    """
    axes = knots.shape[1] // 2
    x, v = knots[:, :axes], knots[:, axes:]
    step = np.diff(times)[:, None]
    slope = np.diff(x, axis=0) / step
    start = (6.0 * slope - 4.0 * v[:-1] - 2.0 * v[1:]) / step
    end = (2.0 * v[:-1] + 4.0 * v[1:] - 6.0 * slope) / step
    accelerations = np.zeros_like(x)
    if len(x) > 1:
        accelerations[1:-1] = 0.5 * (end[:-1] + start[1:])
        accelerations[0] = np.where(v[0].any(), start[0], 0.0)
        accelerations[-1] = np.where(v[-1].any(), end[-1], 0.0)
    return accelerations


def csv_text(mechanism: Mechanism, times: Array, samples: Array) -> str:
    """
    Return the CSV file of a path, which PathFile reads without a loss of digits.

    Parameters
    ----------
    mechanism
        Type of the robot.
    times
        Times (n) in s.
    samples
        Samples (n, 3 axes).

    """
    heads = [_TIMES[0], *(axis[0] for quantity in _names(mechanism.axes) for axis in quantity)]
    rows = np.column_stack([times, samples]).tolist()
    return '\n'.join([','.join(heads), *(','.join(map(repr, row)) for row in rows), ''])


def _own_axes(mechanism: Mechanism, *, lacks_base: bool) -> list[Quantity]:
    """Return the axes of a file, which may lack those of the carrier."""
    axes = list(mechanism.axes)
    if lacks_base and mechanism.carrier is not None:
        del axes[mechanism.carrier.axes]
    return axes


def _names(axes: Sequence[Quantity]) -> list[list[Names]]:
    """Return the names of the columns of each quantity and axis; the first one is preferred."""
    names: list[list[Names]] = []
    for order, (quantity, per) in enumerate(_ORDERS):
        of_quantity: list[Names] = []
        for axis in axes:
            unit = f'{axis.unit}{per}'.replace('²', '2').replace('/', '_per_')
            bare = axis.name if order == 0 else f'{quantity}_{axis.name}'
            logged = f'reference_{quantity}_{axis.name}_{unit}'
            of_quantity.append((f'{bare}_{unit}', bare, logged))
        names.append(of_quantity)
    return names


def _selected(heads: Sequence[str], place: str, mechanism: Mechanism) -> tuple[list[int], bool]:
    """
    Return the columns of times, positions and perhaps velocities and accelerations.

    The flag is True for a file without the axes of the carrier.
    """
    heads = [head.strip() for head in heads]
    names, lacks_base = _names(mechanism.axes), False
    if mechanism.carrier is not None:
        of_base = chain.from_iterable(chain(*(axes[mechanism.carrier.axes] for axes in names)))
        lacks_base = set(heads).isdisjoint(of_base)
        names = _names(_own_axes(mechanism, lacks_base=lacks_base))
    is_export = any(head.startswith('reference_position_') for head in heads)

    def column(known: Names) -> int | None:
        if is_export and len(known) == len(_ORDERS) and known != _TIMES:
            known = known[-1:]  # its other columns are the robot's
        columns = [k for k, head in enumerate(heads) if head in known]
        if len(columns) > 1:
            raise InputError(f'{place}: two columns for {known[0]}; expected one')
        return columns[0] if columns else None

    wanted: list[list[Names]] = [[_TIMES], *names]
    selected = [[column(known) for known in quantity] for quantity in wanted]
    for quantity, columns in zip(wanted, selected, strict=True):
        has_some = any(place_of is not None for place_of in columns)
        if None in columns and (quantity in wanted[:2] or has_some):
            missing = quantity[columns.index(None)]
            raise InputError(
                f'{place}: no column {missing[0]}; expected columns {_expected(names)}, and '
                f'perhaps those of velocities and accelerations, such as {names[1][0][0]}'
            )
    if None not in selected[3] and None in selected[2]:
        raise InputError(f'{place}: accelerations without velocities; expected columns of both')
    if not is_export:
        known = list(chain(_TIMES, *(chain.from_iterable(quantity) for quantity in names)))
        usual = [_TIMES[0], *(axis[0] for quantity in names for axis in quantity)]
        for head in heads:
            if head not in known:
                raise InputError(f"{place}: unknown column '{head}'; {suggestion(head, usual)}")
    return [k for columns in selected for k in columns if k is not None], lacks_base


def _expected(names: Sequence[Sequence[Names]]) -> str:
    return ', '.join([_TIMES[0], *(known[0] for known in names[0])])


def _read_csv(path: Path, place: str, mechanism: Mechanism) -> tuple[Array, bool]:
    """Return the selected columns (n, k) of a CSV file; fields end with a comma, ; or a tab."""
    try:
        text = path.read_text(encoding='utf-8-sig')
    except UnicodeDecodeError as error:
        raise InputError(f'{place}: not text in UTF-8 ({error.reason})') from None
    first, _, rest = text.partition('\n')
    separator = max(',;\t', key=first.count)
    heads = next(csv.reader([first], delimiter=separator), [])
    columns, lacks_base = _selected(heads, place, mechanism)
    if not rest.strip():
        raise InputError(f'{place}: no points; expected a line for each point after the names')
    for row, cells in enumerate(csv.reader(io.StringIO(rest), delimiter=separator), 2):
        # Also of columns that are not used: a decimal comma shifts those behind it.
        if len(cells) != len(heads) and any(map(str.strip, cells)):
            raise InputError(f'{place}, line {row}: {len(cells)} fields; expected {len(heads)}')
    try:
        return np.loadtxt(
            io.StringIO(rest), delimiter=separator, usecols=columns, ndmin=2, comments=None,
            quotechar='"',
        ), lacks_base  # fmt: skip
    except ValueError:
        raise _wrong_line(rest, separator, heads, columns, place) from None


def _wrong_line(
    rest: str, separator: str, heads: Sequence[str], columns: Sequence[int], place: str
) -> InputError:
    """Return the error about the first line of a CSV file that is not numbers."""
    for row, cells in enumerate(csv.reader(io.StringIO(rest), delimiter=separator), 2):
        for k in columns if cells else ():
            try:
                float(cells[k])
            except ValueError:
                return InputError(
                    f'{place}, line {row}: {heads[k].strip()} = {cells[k]!r}; expected a number'
                )
    return InputError(f'{place}: not a table of numbers')


def _read_parquet(path: Path, place: str, mechanism: Mechanism) -> tuple[Array, bool]:
    """Return the selected columns (n, k) of a Parquet file."""
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ModuleNotFoundError as error:
        raise InputError(f'{place}: {remedy(error)}') from None
    try:
        file = parquet.ParquetFile(path)
        heads = file.schema_arrow.names
        selected, lacks_base = _selected(heads, place, mechanism)
        columns = [heads[k] for k in selected]
        table = file.read(columns=columns)
        return np.column_stack([
            table[name].cast(pa.float64()).to_numpy(zero_copy_only=False) for name in columns
        ]), lacks_base
    except pa.ArrowException as error:
        raise InputError(f'{place}: not a Parquet file of numbers ({error})') from None


def _read_yaml(path: Path, place: str, mechanism: Mechanism) -> tuple[Array, bool]:
    """Return times and quantities (n, k) of a YAML file."""
    import yaml

    axes = [axis.name for axis in mechanism.axes]
    try:
        loader = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
        content = yaml.load(path.read_bytes(), Loader=loader)
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        mark = getattr(error, 'problem_mark', None)
        line = '' if mark is None else f', line {mark.line + 1}'
        raise InputError(f'{place}{line}: not YAML; expected times and points') from None
    known = ('axes', 'times', *_KEYS)
    if not isinstance(content, Mapping) or not {'times', 'points'} <= content.keys():
        raise InputError(f'{place}: expected the keys times and points, and of {", ".join(known)}')
    for key in content:
        if key not in known:
            raise InputError(f"{place}: unknown key '{key}'; {suggestion(str(key), known)}")
    order = content.get('axes', axes)
    short = [axis.name for axis in _own_axes(mechanism, lacks_base=True)]
    lacks_base = isinstance(order, list) and len(order) == len(short) < len(axes)
    axes = short if lacks_base else axes
    if not isinstance(order, list) or sorted(map(str, order)) != sorted(axes):
        raise InputError(f'{place}: axes = {order}; expected {", ".join(axes)} in any order')
    times = _numbers(content['times'], 1, place, 'times')
    parts = [times]
    for key in _KEYS:
        if key in content:
            part = _numbers(content[key], len(axes), place, key)
            if len(part) != len(times):
                raise InputError(f'{place}: {len(part)} {key} for {len(times)} times')
            parts.append(part[:, [order.index(axis) for axis in axes]])
    if 'accelerations' in content and 'velocities' not in content:
        raise InputError(f'{place}: accelerations without velocities; expected both')
    return np.hstack(parts), lacks_base


def _numbers(values: Any, width: int, place: str, key: str) -> Array:
    """Return an array (n, width) of a list of numbers, or of a list of such lists."""
    try:
        return np.array(values, dtype=np.float64).reshape(-1, width)
    except (TypeError, ValueError):
        raise InputError(
            f'{place}: {key} are not rows of {width} numbers; expected a number for each axis'
        ) from None


_READERS: dict[str, Callable[[Path, str, Mechanism], tuple[Array, bool]]] = {
    '.csv': _read_csv, '.parquet': _read_parquet, '.yaml': _read_yaml, '.yml': _read_yaml
}


def _checked(columns: Array, place: str) -> tuple[Array, Array]:
    """Return times (n) and knots (n, k); InputError for values that are no path."""
    times, knots = np.ascontiguousarray(columns[:, 0]), columns[:, 1:]
    if not len(times):
        raise InputError(f'{place}: no points; expected at least one')
    is_bad = ~np.isfinite(columns).all(axis=1)
    if is_bad.any():
        raise InputError(
            f'{place}: point {int(np.argmax(is_bad)) + 1} has a number that is not finite; '
            'expected numbers everywhere'
        )
    if not 0.0 <= times[0] <= _LATEST:
        raise InputError(
            f'{place}: it starts at t = {times[0]:.9g} s; expected times in s from the start of '
            f'the run, from 0 on (subtract the first stamp)'
        )
    is_back = np.diff(times) <= 0.0
    if is_back.any():
        point = int(np.argmax(is_back))
        raise InputError(
            f'{place}: point {point + 2} at t = {times[point + 1]:.9g} s follows '
            f'{times[point]:.9g} s; expected times that ascend'
        )
    return times, knots
