# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The columns of an exported run: a row a state."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import NamedTuple

from masmc_ros.log.read.decode import Series
from masmc_ros.log.read.reader import Run
from masmc_ros.loop.signals import CONTACT, PUBLISHED
from masmc_ros.numerics.aliases import Array
import numpy as np
from numpy.typing import NDArray


class Column(NamedTuple):
    """A column."""

    name: str
    """Head of the column; it ends with the unit."""
    unit: str
    """With `per` for a stroke, and no points or raised figures."""


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
    values: Array
    known: NDArray[np.bool_]


def table_of(run: Run) -> Table:
    """
    Return the numbers of a run: of torques, of rates, or of both where both were sent.

    What was sent at other times than the states stands with the last state before it; of
    several there, the last counts.
    """
    columns, numbers = zip(*_parts(run), strict=True)
    values, known = zip(*(
        _rows(run.times, each, len(heads)) for heads, each in zip(columns, numbers, strict=True)
    ), strict=True)
    return Table(tuple(chain(*columns)), np.hstack(values), np.hstack(known))


def _columns(quantity: str, of: Sequence[str], unit: str | Sequence[str]) -> list[Column]:
    """Return columns of a quantity, one for each that it is of; of one unit, or of one each."""
    units = [unit] * len(of) if isinstance(unit, str) else unit
    return [
        Column('_'.join(filter(None, (quantity, name, _unit(each)))), _unit(each))
        for name, each in zip(of, units, strict=True)
    ]


def _unit(text: str) -> str:
    """Return a unit as names of columns have it: kg_m2 for kg·m²."""
    return text.replace('·', '_').replace('²', '2').replace('/', '_per_')


def _parts(run: Run) -> Iterator[tuple[list[Column], Array | Series | None]]:
    """Yield neighbouring columns and their numbers: (n, k) of the states, or at other times."""
    mechanism, joints = run.mechanism, run.joint_names
    units = [each.unit for each in mechanism.positions]
    axes = [axis.name for axis in mechanism.axes]
    driven = joints[len(mechanism.base):]
    yield _columns('time', [''], 's'), run.times[:, None]
    yield _columns('position', joints, units), run.position
    yield _columns('velocity', joints, [f'{unit}/s' for unit in units]), run.velocity
    efforts = [joint.effort_unit for joint in mechanism.joints]
    yield _columns('applied_effort', driven, efforts), run.applied_effort
    if not run.commands_rates:
        yield _columns('command', driven, efforts), run.torque
    # Commands of drives that follow velocities.
    if len(run.cmd_vel) or len(run.arm_rates):
        twist = mechanism.twist
        names = [each.name.replace(' ', '_') for each in twist]
        yield _columns('command', names, [each.unit for each in twist]), run.cmd_vel
        rates = [f'{joint.unit}/s' for joint in mechanism.own_rates]
        yield _columns('command', driven[len(twist):], rates), run.arm_rates
    reference = [
        column
        for name, per in (('position', ''), ('velocity', '/s'), ('acceleration', '/s²'))
        for column in _columns(
            f'reference_{name}', axes, [axis.unit + per for axis in mechanism.axes]
        )
    ]
    yield reference, run.reference
    for signal in PUBLISHED:
        if not (signal.of_torques and run.commands_rates):
            of = run.components(signal)
            units = [signal.unit_of(each.unit) for each in of]
            told = run.telemetry.get(signal.name)
            yield _columns(signal.name, [each.name for each in of], units), told
    if run.contact is not None:
        contacts = [
            column
            for name in run.contact_names
            for part in CONTACT
            for column in _columns(part.name, [name], part.unit)
        ]
        yield contacts, run.contact


def _rows(
    states: Array, numbers: Array | Series | None, width: int
) -> tuple[Array, NDArray[np.bool_]]:
    """Return numbers in the rows of the states (n, width), and which rows have them."""
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
