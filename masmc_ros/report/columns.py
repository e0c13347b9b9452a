# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Columns of an exported run, with a row per state."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.log.read.decode import Series
from masmc_ros.log.read.reader import Run
from masmc_ros.loop.signals import CONTACT, PUBLISHED
import numpy as np
from numpy.typing import NDArray


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
    known: NDArray[np.bool_]


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
) -> tuple[Array, NDArray[np.bool_]]:
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
