# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Pose of a base on two wheels by the rotation of its wheels, for programs without Python."""

from __future__ import annotations

from masmc_ros.aliases import Array, Records
from masmc_ros.jit.arrays import to_vector
from masmc_ros.jit.compiled import kernel
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.tuples import elementwise, tail
from masmc_ros.jit.vectors import check_workspace
from masmc_ros.numerics.scalars import minus, moved
from masmc_ros.params.declaration import Values
from masmc_ros.robot import mechanism

_BASE = 'robot.base'


def has_odometry(values: Values) -> bool:
    """Return True if the wheels of a robot determine its pose: of a base on two wheels."""
    return bool(values.get(_BASE, 'differential') == 'differential')


@kernel
def odometry(
    settings: Records, signals: Records, before: Array, position: Array, velocity: Array
) -> int:
    """
    Write the pose of the base and its derivative; return 0.

    The wheels roll without slip. The pose changes by the motion at the middle of the step, which
    is exact to the third order of the step.

    Parameters
    ----------
    settings, signals
        Records of the controller; the signals are not changed.
    before
        Positions (positions) of the last state, with the pose in m and rad.
    position
        Measured positions of wheels and joints at the last entries (positions); the pose is
        written into the first ones.
    velocity
        Their velocities (positions), of which those of the pose are written.

    """
    row = lane_of(signals[0], 0)
    model = mechanism.model_of(lane_of(settings[0], 0))
    start = to_vector(before, row.position)
    rotation = elementwise(minus, tail(to_vector(position, start), row.torque),
                           tail(start, row.torque))  # fmt: skip
    change = mechanism.position_rates(model, mechanism.posture(model, start), rotation)
    middle = elementwise(moved, start, change, 0.5)
    change = mechanism.position_rates(model, mechanism.posture(model, middle), rotation)
    end = elementwise(moved, start, change, 1.0)
    rates = tail(to_vector(velocity, start), row.torque)
    motion = mechanism.position_rates(model, mechanism.posture(model, end), rates)
    for i in range(len(end) - len(row.torque)):
        position[i], velocity[i] = end[i], motion[i]
    check_workspace(row)
    return 0
