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

"""The columns of an exported run: a row a state."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from masmc_ros.log.read.reader import Run, TimeSeries
from masmc_ros.loop.signals import Signal, TOLD
from masmc_ros.numerics.field import ONE
from masmc_ros.robot.declaration import Quantity
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Column(NamedTuple):
    """A column; its name ends with its unit, `per` for a stroke."""

    quantity: str
    unit: str

    @property
    def name(self) -> str:
        """Return what stands above it."""
        return f'{self.quantity}_{self.unit}'


class Table(NamedTuple):
    """
    The numbers of a run, a row a state.

    Attributes
    ----------
    columns
        (k) what they are.
    values
        (n, k).
    known
        (n, k) which of them the log has.

    """

    columns: tuple[Column, ...]
    values: Floats
    known: NDArray[np.bool_]


class _Part(NamedTuple):
    """Neighbouring columns (k), and their numbers: (n, k) of the states, or of their own times."""

    columns: tuple[Column, ...]
    numbers: Floats | TimeSeries | None


def table_of(run: Run) -> Table:
    """
    Return the numbers of a run: of torques, of rates, or of both where both were sent.

    What was sent at other times than the states stands with the last state before it; of
    several there, the last counts.
    """
    parts = tuple(_parts(run))
    values, known = zip(*(_rows(run.times, part) for part in parts), strict=True)
    columns = tuple(column for part in parts for column in part.columns)
    return Table(columns, np.hstack(values), np.hstack(known))


def components(run: Run, signal: Signal) -> tuple[Quantity, ...]:
    """Return what the components of a signal belong to; nothing that has a name for one of ONE."""
    mechanism = run.mechanism
    positions = tuple(
        Quantity(name, each.unit, each.label)
        for name, each in zip(run.joint_names, mechanism.positions, strict=True)
    )
    return {
        'axes': mechanism.axes,
        'joints': positions[len(mechanism.base):],
        'positions': positions,
        'parameters': mechanism.theta,
        ONE: (Quantity('', ''),),
    }[str(signal.size)]


def _columns(quantity: str, of: Sequence[str], unit: str | Sequence[str]) -> tuple[Column, ...]:
    """Return columns of a quantity, one for each that it is of; of one unit, or of one each."""
    units = [unit] * len(of) if isinstance(unit, str) else unit
    return tuple(
        Column(f'{quantity}_{name}' if name else quantity, _unit(each))
        for name, each in zip(of, units, strict=True)
    )


def _unit(text: str) -> str:
    """Return a unit as names of columns have it: kg_m2 for kg·m²."""
    return text.replace('·', '_').replace('²', '2').replace('/', '_per_')


def _parts(run: Run) -> Iterator[_Part]:
    mechanism, joints = run.mechanism, run.joint_names
    units = [each.unit for each in mechanism.positions]
    axes = [axis.name for axis in mechanism.axes]
    driven = joints[len(mechanism.base):]
    yield _Part((Column('time', 's'),), run.times[:, None])
    yield _Part(_columns('position', joints, units), run.position)
    yield _Part(_columns('velocity', joints, [f'{unit}/s' for unit in units]), run.velocity)
    yield _Part(_columns('applied_effort', driven, 'N·m'), run.applied_effort)
    if not run.commands_rates:
        yield _Part(_columns('command', driven, 'N·m'), run.torque)
    # What drives are told that take no torques.
    if len(run.cmd_vel.times) or len(run.arm_rates.times):
        twist = mechanism.twist
        names = [each.name.replace(' ', '_') for each in twist]
        yield _Part(_columns('command', names, [each.unit for each in twist]), run.cmd_vel)
        yield _Part(_columns('command', driven[len(twist):], 'rad/s'), run.arm_rates)
    derivatives = (('position', 'm'), ('velocity', 'm/s'), ('acceleration', 'm/s²'))
    yield _Part(
        tuple(c for name, unit in derivatives for c in _columns(f'reference_{name}', axes, unit)),
        run.reference,
    )
    for signal in TOLD:
        if not (signal.of_torques and run.commands_rates):
            of = components(run, signal)
            units = [signal.unit or each.unit for each in of]
            columns = _columns(signal.name, [each.name for each in of], units)
            yield _Part(columns, run.telemetry.get(signal.name))


def _rows(states: Floats, part: _Part) -> tuple[Floats, NDArray[np.bool_]]:
    """Return numbers in the rows of the states (n), and which rows have them."""
    numbers = part.numbers
    if isinstance(numbers, np.ndarray):
        return numbers, ~np.isnan(numbers)
    values = np.zeros((len(states), len(part.columns)))
    known = np.zeros(values.shape, bool)
    if numbers is not None:
        rows = np.searchsorted(states, numbers.times, side='right') - 1
        is_after = rows >= 0
        values[rows[is_after]] = numbers.values[is_after]
        known[rows[is_after]] = True
    return values, known
