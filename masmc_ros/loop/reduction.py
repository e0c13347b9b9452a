# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Sums and extremes of a run, from which its metrics follow, without its signals.

Every sum runs over the ticks in their order, and within a tick over the components in their
order. `report.measure.metrics` adds in the same order, so both are bitwise identical.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any

from masmc_ros.aliases import Array, Integers, Record
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.field import Field
from masmc_ros.jit.record import lane_count, new_record
from masmc_ros.robot.declaration import Mechanism
import numpy as np
from numpy.typing import NDArray

REDUCED = (
    Field('square', 'points', 'Squared distance of a point at the tick', 'm²'),
    Field('square_sum', 'points', 'Sum of the squared distances within the window', 'm²'),
    Field('largest_square', 'points', 'Largest of them', 'm²'),
    Field('band', 'points', 'Band of the settling time', 'm'),
    Field('last_outside', 'points', 'Last tick outside of the band', kind='i8', initial=-1),
    Field('previous', 'joints', 'Torque of the tick before', 'N·m'),
    Field('torque_square', description='Squared norm of the torque at the tick', unit='N²·m²'),
    Field('torque_change', description='Change of all torques since the tick before', unit='N·m'),
    Field('torque_square_sum', description='Sum of the squared norms within the window'),
    Field('torque_change_sum', description='Sum of the changes within the window', unit='N·m'),
    Field('residual', description='0; NaN if a signal of the tick is not finite'),
    Field('lost_tick', description='First such tick; -1: none', kind='i8', initial=-1),
)
"""Fields of the record of reduced signals."""

Reduction = np.void | Mapping[str, NDArray[Any]]
"""Reduced signals (component, lane) by name."""


def reduced_signals(mechanism: Mechanism, lanes: int) -> NDArray[np.void]:
    """Return the record of reduced signals before the first tick."""
    sizes = {**mechanism.sizes, 'points': len(mechanism.points)}
    return new_record(REDUCED, sizes, lanes)


def axes_of_points(mechanism: Mechanism) -> NDArray[np.int64]:
    """Return the first task axis of each point, and the axis after its last one: (points, 2)."""
    axes = [(point.first, point.first + point.size) for point in mechanism.points]
    return np.array(axes, np.int64)


@formula
def reduce_tick(
    reduced: Record,
    signals: Record,
    points: Integers,
    settling: Array,
    tick: int,
    start: int,
    end: int,
) -> None:
    """
    Add the signals of a tick in all lanes.

    Parameters
    ----------
    reduced, signals
        Records of `REDUCED` and of `SIGNALS`.
    points
        Axes of each point, see `axes_of_points`.
    settling
        Band of the settling time as a part of the first distance, and its minimum in m.
    tick
        Number of the tick.
    start, end
        First tick of the window, and the tick after its last one.

    """
    # Conditions of the tick are factors, and no branches: the loops over lanes vectorise.
    is_first, is_within = tick == 0, 1.0 if (start <= tick) & (tick < end) else 0.0
    is_change_within = 1.0 if (start < tick) & (tick < end) else 0.0
    lanes, residual = lane_count(signals), reduced['residual']
    error, square, square_sum = signals['error'], reduced['square'], reduced['square_sum']
    largest, band, outside = reduced['largest_square'], reduced['band'], reduced['last_outside']
    for lane in range(lanes):
        residual[lane] = 0.0
    for point in range(len(points)):
        for lane in range(lanes):
            square[point, lane] = 0.0
        for axis in range(points[point, 0], points[point, 1]):
            for lane in range(lanes):
                square[point, lane] += error[axis, lane] * error[axis, lane]
        for lane in range(lanes):
            value = square[point, lane]
            distance = math.sqrt(value)
            least = settling[0] * distance
            least = least if least > settling[1] else settling[1]
            band[point, lane] = least if is_first else band[point, lane]
            is_inside = distance <= band[point, lane]
            outside[point, lane] = outside[point, lane] if is_inside else tick
            counted = value * is_within
            square_sum[point, lane] += counted
            is_larger = counted > largest[point, lane]
            largest[point, lane] = counted if is_larger else largest[point, lane]
            residual[lane] += value - value
    torque, rates, previous = signals['torque'], signals['rates'], reduced['previous']
    torque_square, torque_change = reduced['torque_square'], reduced['torque_change']
    for lane in range(lanes):
        torque_square[lane], torque_change[lane] = 0.0, 0.0
    for joint in range(len(torque)):
        for lane in range(lanes):
            value = torque[joint, lane]
            torque_square[lane] += value * value
            torque_change[lane] += abs(value - previous[joint, lane])
            previous[joint, lane] = value
            residual[lane] += (value - value) + (rates[joint, lane] - rates[joint, lane])
    position = signals['true_position']
    for i in range(len(position)):
        for lane in range(lanes):
            residual[lane] += position[i, lane] - position[i, lane]
    square_total, change_total = reduced['torque_square_sum'], reduced['torque_change_sum']
    lost_tick = reduced['lost_tick']
    for lane in range(lanes):
        square_total[lane] += torque_square[lane] * is_within
        change_total[lane] += torque_change[lane] * is_change_within
        is_lost = (lost_tick[lane] < 0) & (residual[lane] != 0.0)
        lost_tick[lane] = tick if is_lost else lost_tick[lane]
