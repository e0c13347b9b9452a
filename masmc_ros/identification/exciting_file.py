# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Scenario whose path is an exciting motion, as a parameter file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.identification.excitation import exciting_series, limits_of, PERIOD, positions_of
from masmc_ros.identification.parameter_file import nominal_of, of_its_kind, write_parameters
from masmc_ros.law.parts.joint_limits import TORQUE_LIMIT as CONTROLLER_TORQUE_LIMIT
from masmc_ros.loop.plant_parameters import INITIAL_JOINTS, INITIAL_POSE, TORQUE_LIMIT
from masmc_ros.loop.scenario import Scenario
from masmc_ros.messages.topics import PARAMETER_NODES
from masmc_ros.params.declaration import MutableValues, Values
from masmc_ros.params.file import EVERY
from masmc_ros.robot.declaration import Quantity
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.node_parameters import declared, shared
import numpy as np

_STEP = 0.1
"""Time in s between points of the path."""

_DIGITS = 9
"""Decimals of times and points, in s, m and rad."""

_FINE = 100
"""Number of steps between two points, to integrate the rolling of the base."""

_LAW = 'computed_torque'
"""Law of the motion, which tolerates an unknown latency."""


class Excitation(NamedTuple):
    """Exciting motion: condition number, and largest deviations (n) and speeds (n) of joints."""

    condition: float
    deviation: Array
    speed: Array


def write_exciting(
    path: Path,
    scenario: Scenario,
    source: str,
    *,
    duration: float,
    amplitude: float,
    seed: int,
) -> Excitation:
    """
    Write a scenario with an exciting motion of a robot.

    Parameters
    ----------
    path
        Parameter file to write.
    scenario
        Checked values by node.
    source
        Name of the scenario, for a comment.
    duration
        Duration of the motion in s.
    amplitude
        Largest deviation of joints that do not move the base, in rad or m.
    seed
        Seed of the search.

    Raises
    ------
    InputError
        if the duration is shorter than PERIOD, if the robot cannot hold its start within the
        limits of the torques, or if its type cannot be identified.

    """
    if duration < PERIOD:
        raise InputError(f'--duration {duration:g}: expected at least {PERIOD:g} s, one period')
    plant, control = scenario.plant, scenario.controller
    # The limits of torques are those of the robot, so its masses are not scaled.
    nominal = nominal_of({**control, 'model_scale': 1.0})
    start = np.array(INITIAL_JOINTS.of(plant))
    torque = np.array(CONTROLLER_TORQUE_LIMIT.of(control))
    motor = np.array(TORQUE_LIMIT.of(plant))
    torque = np.where((motor > 0.0) & ((torque == 0.0) | (motor < torque)), motor, torque)
    limits = limits_of(nominal.robot, start, torque, amplitude)
    series, condition = exciting_series(nominal, start, limits, duration, seed)
    task = of_its_kind(nominal.robot, 'exciting_task')(nominal.robot)
    times = np.arange(round(duration / _STEP) + 1) * _STEP
    fine = np.linspace(0.0, times[-1], _FINE * (len(times) - 1) + 1)
    angles, rates, _ = series.at(fine)
    robot = robot_of({**plant, **task})
    first = np.array(robot.start(INITIAL_POSE.of(plant), INITIAL_JOINTS.of(plant)))
    positions = positions_of(robot, first, angles)[::_FINE]
    points = _unwound(robot.task_positions(positions), robot.mechanism.axes)
    nodes = {node: _kept(node, scenario[node], task) for node in PARAMETER_NODES}
    nodes['trajectory'] |= {
        'type': 'waypoints',
        'waypoints.times': tuple(times.round(_DIGITS).tolist()),
        'waypoints.points': tuple(points.ravel().round(_DIGITS).tolist()),
    }
    nodes['controller']['law'] = _LAW
    common = {parameter.name for parameter in shared(robot.mechanism)}
    everywhere = {
        name: value
        for name, value in nodes['plant'].items()
        if name in common and all(own.get(name) == value for own in nodes.values())
    }
    for own in nodes.values():
        for name in everywhere:
            del own[name]
    values = {EVERY: everywhere | {'duration': duration}, **nodes}
    comment = f'Exciting motion for masmc identify, by masmc excite {source}.'
    write_parameters(path, values, [comment, f'Condition number: {condition:.4g}'])
    deviation = np.abs(angles - start).max(axis=0)
    return Excitation(condition, deviation, np.abs(rates).max(axis=0))


def _kept(node: str, values: Values, task: Values) -> MutableValues:
    """Return the values of a node that differ from defaults, without the previous path."""
    before = {p.name: p for p in declared(node, mechanism_from(values))}
    robot = mechanism_from({**values, **task})
    kept = {}
    for parameter in declared(node, robot):
        name = parameter.name
        value = parameter.or_default({**values, **task})
        of_task = name in before and before[name].length != parameter.length
        of_path = node == 'trajectory' and name.partition('.')[0] in ('type', 'line_sine')
        if name != 'duration' and not (of_task or of_path) and value != parameter.default:
            kept[name] = value
    return kept


def _unwound(points: Array, axes: Sequence[Quantity]) -> Array:
    """Return points (N, axes) whose angles do not jump by turns."""
    is_angle = [axis.unit == 'rad' for axis in axes]
    return np.where(is_angle, np.unwrap(points, axis=0), points)
