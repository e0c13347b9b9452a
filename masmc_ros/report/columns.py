# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Columns of an exported run, with a row per state."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import NamedTuple

from masmc_ros.log.read.decode import Series
from masmc_ros.log.read.reader import Run
from masmc_ros.loop.signals import CONTACT, TOLD
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Column(NamedTuple):
    """Head of a column, which ends with the unit; units in letters, such as m_per_s2."""

    name: str
    unit: str


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
    values: Floats
    known: NDArray[np.bool_]


def table_of(run: Run) -> Table:
    """
    Return the numbers of a run, with the torques and velocities that were commanded.

    Values with other stamps than the states are in the row of the last state before; of several
    in one row, the last is kept.
    """
    columns, numbers = zip(*_parts(run), strict=True)
    values, known = zip(*(
        _rows(run.times, part, len(heads)) for heads, part in zip(columns, numbers, strict=True)
    ), strict=True)
    return Table(tuple(chain(*columns)), np.hstack(values), np.hstack(known))


def _columns(quantity: str, names: Sequence[str], units: Sequence[str]) -> list[Column]:
    """Return the columns of a quantity by the names of its components, such as joints."""
    # kg_m2 for kg·m².
    plain = [u.replace('·', '_').replace('²', '2').replace('/', '_per_') for u in units]
    return [
        Column('_'.join(filter(None, (quantity, name, unit))), unit)
        for name, unit in zip(names, plain, strict=True)
    ]


def _parts(run: Run) -> Iterator[tuple[list[Column], Floats | Series | None]]:
    """Yield adjacent columns and their numbers: (n, k) at the states, or at other times."""
    mechanism, joints = run.mechanism, run.joint_names
    units = [position.unit for position in mechanism.positions]
    axes = [axis.name for axis in mechanism.axes]
    driven = joints[len(mechanism.base):]
    yield _columns('time', [''], ['s']), run.times[:, None]
    yield _columns('position', joints, units), run.position
    yield _columns('velocity', joints, [f'{unit}/s' for unit in units]), run.velocity
    efforts = [joint.effort_unit for joint in mechanism.joints]
    yield _columns('applied_effort', driven, efforts), run.applied_effort
    if not run.commands_rates:
        yield _columns('command', driven, efforts), run.torque
    # Commands of drives that follow velocities.
    if len(run.cmd_vel) or len(run.arm_rates):
        twist = mechanism.twist
        names = [velocity.name.replace(' ', '_') for velocity in twist]
        yield _columns('command', names, [velocity.unit for velocity in twist]), run.cmd_vel
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
    for signal in TOLD:
        if not (signal.of_torques and run.commands_rates):
            components = run.components(signal)
            units = [signal.unit_of(component.unit) for component in components]
            heads = _columns(signal.name, [component.name for component in components], units)
            yield heads, run.telemetry.get(signal.name)
    if run.contact is not None:
        contacts = [
            column
            for name in run.contact_names
            for part in CONTACT
            for column in _columns(part.name, [name], [part.unit])
        ]
        yield contacts, run.contact


def _rows(
    states: Floats, numbers: Floats | Series | None, width: int
) -> tuple[Floats, NDArray[np.bool_]]:
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
