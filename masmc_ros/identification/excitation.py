# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Motions that excite the parameters of a robot: Fourier series of the joints within limits.

The series is periodic (Swevers, Ganseman, Tükel, De Schutter and Van Brussel 1997). Many random
series are scaled to the limits of position, speed and torque. The one with the smallest condition
number of the scaled base parameters is selected and improved. Self-collisions are not checked.

`write_exciting` writes a scenario whose path is such a motion, as a parameter file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from masmc_ros.aliases import Array, Records
from masmc_ros.errors import InputError
from masmc_ros.identification.consistent_parameters import Scale, scaled
from masmc_ros.identification.identify import base_parameters, Nominal
from masmc_ros.identification.parameter_file import nominal_of, of_its_kind, write_parameters
from masmc_ros.identification.regressor import instantaneous, record_of
from masmc_ros.jit.arrays import to_vector
from masmc_ros.jit.compiled import kernel
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.tuples import elementwise, head
from masmc_ros.jit.vectors import check_workspace, free, mark
from masmc_ros.law.parts.joint_limits import TORQUE_LIMIT as CONTROLLER_TORQUE_LIMIT
from masmc_ros.loop.plant_parameters import INITIAL_JOINTS, INITIAL_POSE, TORQUE_LIMIT
from masmc_ros.loop.scenario import Scenario
from masmc_ros.messages.topics import PARAMETER_NODES
from masmc_ros.numerics.scalars import minus
from masmc_ros.params.declaration import MutableValues, Values
from masmc_ros.params.file import EVERY
from masmc_ros.robot import mechanism
from masmc_ros.robot.declaration import Quantity
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.robot.robot import Robot, robot_of
from masmc_ros.scenario.node_parameters import declared, shared
import numpy as np

PERIOD = 10.0
"""Period of the series in s."""

_HARMONICS = (1, 2, 3, 5, 8)
"""Multiples of the fundamental frequency."""

_RAMP = 2.0
"""Time in s in which the motion starts and ends."""

_FREE = 2.0
"""Largest deviation in rad or m of a joint that moves the base."""

_UNLIMITED = 2.0
"""Largest speed in rad/s or m/s of a joint without a limit."""

_SHARE = 0.8
"""Part of the limits of speed and torque that the motion uses."""

_CANDIDATES = 80
"""Number of evaluated series; the second half are variations of the best one."""

_STEPS = (0.14, 0.02)
"""Steps in s between evaluated states: of all series, and of those that may be the best one."""

_SHRINKINGS = 60
"""Largest number of reductions of a series to bring its torques within their limits."""


@dataclass(frozen=True)
class Limits:
    """
    Limits of the motion of n joints.

    Attributes
    ----------
    deviation
        (n) Largest deviation from the start in rad or m.
    speed
        (n) Largest speed in rad/s or m/s.
    torque
        (n) Largest torque in N·m or N; infinite without a limit.

    """

    deviation: Array
    speed: Array
    torque: Array


@dataclass(frozen=True)
class Series:
    """
    Fourier series of n joints about the start of the robot.

    Attributes
    ----------
    start
        (n) Positions at the start in rad or m.
    sines, cosines
        (n, harmonics) Amplitudes in rad or m.
    duration
        Duration of the motion in s.

    """

    start: Array
    sines: Array
    cosines: Array
    duration: float

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """Return positions, rates and accelerations, each (N, n), at times (N) in s."""
        omega = 2.0 * np.pi / PERIOD * np.array(_HARMONICS)
        s, c = np.sin(np.outer(times, omega)), np.cos(np.outer(times, omega))
        position = s @ self.sines.T + c @ self.cosines.T
        rate = (c * omega) @ self.sines.T - (s * omega) @ self.cosines.T
        acceleration = -(s * omega**2) @ self.sines.T - (c * omega**2) @ self.cosines.T
        # The motion starts and ends at rest at the start.
        x = np.minimum(np.minimum(times, self.duration - times) / _RAMP, 1.0)
        x, sign = np.maximum(x, 0.0), np.where(times > self.duration / 2.0, -1.0, 1.0)
        ramp = (x**3 * (10.0 - 15.0 * x + 6.0 * x**2))[:, None]
        slope = (sign * 30.0 * x**2 * (1.0 - x) ** 2 / _RAMP)[:, None]
        bend = (60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / _RAMP**2)[:, None]
        return (
            self.start + ramp * position,
            ramp * rate + slope * position,
            ramp * acceleration + 2.0 * slope * rate + bend * position,
        )

    def instants(self, step: float) -> Array:
        """Return times in s, at most a step apart, with both ramps and a period between them."""
        last = self.duration - _RAMP
        sections = (0.0, min(_RAMP + PERIOD, last)), (last, self.duration)
        return np.concatenate([
            np.linspace(start, end, int(np.ceil((end - start) / step)) + 1)
            for start, end in sections
        ])

    def times_factors(self, factors: Array | float) -> Series:
        """Return the series with amplitudes multiplied by a factor, or by factors (n)."""
        by = np.broadcast_to(factors, len(self.start))[:, None]
        return Series(self.start, by * self.sines, by * self.cosines, self.duration)


def limits_of(
    robot: Robot, start: Array, torque: Array, amplitude: float
) -> Limits:
    """
    Return the limits of an exciting motion, which keep a margin to the limits of the robot.

    Parameters
    ----------
    robot
        Robot with n joints.
    start
        (n) Positions of the joints at the start in rad or m.
    torque
        (n) Largest torques in N·m or N; 0: no limit.
    amplitude
        Largest deviation of joints that do not move the base, in rad or m.

    """
    low, high = np.array(robot.mechanism.position_limits).T
    outside = (start < low) | (start > high)
    if outside.any():
        joint = robot.mechanism.joints[int(np.argmax(outside))].name
        raise InputError(f'{joint}: starts outside of its limits; expected a start within them')
    room = 0.9 * np.minimum(high - start, start - low)
    # Joints that move the base have no position limits.
    wide = np.where(np.arange(len(start)) < len(robot.mechanism.twist), _FREE, amplitude)
    deviation = np.minimum(room, wide)
    speed = np.array(robot.mechanism.speed_limits)
    speed = np.where(np.isfinite(speed) & (speed > 0.0), _SHARE * speed, _UNLIMITED)
    return Limits(
        deviation, np.minimum(speed, _UNLIMITED), np.where(torque > 0.0, _SHARE * torque, np.inf)
    )


def exciting_series(
    nominal: Nominal, start: Array, limits: Limits, duration: float, seed: int
) -> tuple[Series, float]:
    """
    Return a series within limits, and the condition number of the scaled base parameters.

    Parameters
    ----------
    nominal
        Nominal robot with n joints.
    start
        (n) Positions of the joints at the start in rad or m.
    limits
        Limits of the motion.
    duration
        Duration of the motion in s.
    seed
        Seed of the random series.

    Raises
    ------
    InputError
        if the robot cannot hold its start within the limits of the torques.

    """
    random = np.random.default_rng(seed)
    joints = len(start)
    scale = scaled(nominal.robot, nominal.theta, nominal.friction, np.ones(2 * joints))
    base = base_parameters(nominal.robot, scale)
    best, least = None, np.inf
    for number in range(_CANDIDATES):
        sines, cosines = random.standard_normal((2, joints, len(_HARMONICS)))
        if best is not None and number >= _CANDIDATES // 2:
            size = np.abs(best.sines).max(axis=1, keepdims=True)
            sines, cosines = best.sines + 0.3 * size * sines, best.cosines + 0.3 * size * cosines
        drawn = Series(start, sines, cosines, duration)
        series, condition = _evaluated(nominal, drawn, limits, scale, base, least)
        if condition < least:
            best, least = series, condition
    if best is None:
        raise InputError(
            'no motion within the torque limits found; expected limits above the torques that '
            'hold the robot at its start (controller.torque_limit, plant.initial_joints)'
        )
    return best, least


def _evaluated(
    nominal: Nominal, series: Series, limits: Limits, scale: Scale, base: Array, least: float
) -> tuple[Series, float]:
    """
    Return a series within limits and its condition number; infinite if there is none.

    If the condition number is not below `least`, torques are not evaluated at fine steps.
    """
    position, rate, _ = series.at(series.instants(_STEPS[-1]))
    used = np.maximum(
        np.abs(position - series.start).max(axis=0) / limits.deviation,
        np.abs(rate).max(axis=0) / limits.speed,
    )
    series = series.times_factors(1.0 / used)
    parameters = np.concatenate([nominal.theta, nominal.friction])
    at_rest = Series(series.start, 0.0 * series.sines, 0.0 * series.cosines, series.duration)
    holding = _torques(nominal, at_rest, np.zeros(1), parameters)[1]
    if (np.abs(holding) > limits.torque).any():
        return series, np.inf
    condition = np.inf
    for step in _STEPS:
        times = series.instants(step)
        for _ in range(_SHRINKINGS):
            matrix, torque = _torques(nominal, series, times, parameters)
            excess = np.abs(torque).max(axis=0) / limits.torque
            if (excess <= 1.0).all():
                break
            # Reduce joints above their limits more than the others, which also affect their
            # torques.
            series = series.times_factors(np.where(excess > 1.0, 0.85, 0.97))
        else:
            return series, np.inf
        matrix = matrix / np.sqrt(np.mean(torque**2, axis=0) + 1.0e-12)[:, None]
        values = np.linalg.svd(
            matrix.reshape(-1, matrix.shape[2]) @ scale.scale @ base, compute_uv=False
        )
        condition = float(values[0] / max(values[-1], 1.0e-300))
        if condition >= least:
            break
    return series, condition


def _torques(
    nominal: Nominal, series: Series, times: Array, parameters: Array
) -> tuple[Array, Array]:
    """Return the regressor (N, n, p) and the torques (N, n) of a series."""
    angles, rates, accelerations = series.at(times)
    base = len(nominal.robot.mechanism.base)
    position = np.hstack([np.zeros((len(times), base)), angles])
    equations = instantaneous(nominal.robot, position, rates, accelerations)
    return equations.matrix, equations.known + equations.matrix @ parameters


def positions_of(robot: Robot, start: Array, angles: Array) -> Array:
    """Return the positions (N, positions) of joint angles (N, n); the base follows by rolling."""
    positions: Array = _positions(
        record_of(robot, np.zeros(len(robot.theta))),
        np.ascontiguousarray(start),
        np.ascontiguousarray(angles),
    )
    return positions


@kernel
def _positions(body: Records, start: Array, angles: Array) -> Array:
    record = lane_of(body[0], 0)
    place, template = record.position, record.rates
    model = mechanism.model_of(record)
    base = len(place) - len(template)
    out = np.empty((len(angles), len(place)))
    unused = mark(record)
    for k in range(len(angles)):
        free(record, unused)
        at = to_vector(start if k == 0 else out[k - 1], place)
        before = to_vector(angles[max(k - 1, 0)], template)
        after = to_vector(angles[k], template)
        pose = mechanism.dead_reckoned(
            model, head(at, record.pose), elementwise(minus, after, before)
        )
        for i in range(base):
            out[k, i] = pose[i]
        for i in range(len(template)):
            out[k, base + i] = angles[k, i]
    check_workspace(record)
    return out


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
