# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Preview of a path: motion and torques of the nominal robot, and their margins to the limits.

The robot of the file follows the path in simulation, with known masses and without disturbance,
noise, delays and limits of torque. The torques are therefore those that the path requires. Margins
count from the time at which the robot has joined the path; before that it approaches.

`toppra` computes the fastest timing of a path within the speeds and accelerations of the joints.
The joints move along the path as in its preview; only the time at each place changes (Pham and
Pham 2018, "A New Approach to Time-Optimal Path Parameterization Based on Reachability Analysis").
toppra's accelerations step. Polynomials of degree five between the places have larger ones, so the
result is slowed until it keeps the limits.

The path parameter s is the time of the preview. It is a further coordinate of the motion, whose
limits bound the timing where all joints rest.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
import math

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError, remedy
from masmc_ros.loop.plant_parameters import INITIAL_JOINTS, INITIAL_POSE
from masmc_ros.loop.scenario import Scenario
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.timing import DURATION, Timing
from masmc_ros.params.declaration import MutableValues
from masmc_ros.reference.joint_path import places_between
from masmc_ros.reference.minimum_jerk import sample_knots
from masmc_ros.reference.reference import SampledTrajectory
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.robot.declaration import Mechanism, Point
from masmc_ros.scenario.node_parameters import declared
from masmc_ros.scenario.scenario import lowest_limits
import numpy as np

TOLERANCE = 2e-3
"""Distance in m or rad up to which a point is on its path."""

_TRIALS = 4
"""Number of slow-downs that are tried."""

_JOINED = 0.25
"""Part of the tolerance within which an approach has ended."""

_SETTLING = 1.0
"""Time in s after an approach in which torques do not count."""

_SMALLEST = 1.1
"""Smallest slow-down that is tried."""

_MORE = 1.4
"""Factor from one tried slow-down to the next."""

_PHYSICAL = 'initial_', 'integrator_step', 'robot.', 'control_period', 'duration', 'joint_names'
"""Starts of the names of parameters of the file that the nominal plant has."""

_OF_CONTROL = 'k_s1', 'k_s2', 'sigma', 'approach_speed'
"""Further parameters of the file that the nominal controller has."""

_FREE = {'torque_limit', 'torque_rate_limit', 'disturbance.amplitude'}
"""Parameters that are zero in a preview."""

_NOMINAL = {
    'law': 'rasmc', 'switching': 'implicit', 'observer_gain': 0.5, 'model_scale': 1.0,
}  # fmt: skip


class PathError(InputError):
    """Path that the robot does not reach."""


@dataclass(frozen=True)
class Preview:
    """
    Motion along a path, from its first tick on the path on.

    Attributes
    ----------
    mechanism
        Type of the robot.
    times
        Times (n) in s.
    position, velocity, acceleration
        Of the joints, (n, joints) each, SI units.
    torque
        Torques of the joints (n, joints) in N·m or N.
    torque_limits
        Limits (joints); infinite without a limit.
    reference
        Samples (n, 3 axes) of the path.
    error
        Task errors (n, axes) of the robot.
    is_singular
        True (n) if the task is close to singular.
    note
        A sentence on the part of the path that was planned; empty for a complete path.

    """

    mechanism: Mechanism
    times: Array
    position: Array
    velocity: Array
    acceleration: Array
    torque: Array
    torque_limits: Array
    reference: Array
    error: Array
    is_singular: Array
    note: str

    @property
    def range_margin(self) -> Array:
        """Return the distances (n, joints) to the nearer end of each range, infinite without."""
        lower, upper = np.array(self.mechanism.position_limits).reshape(-1, 2).T
        margin: Array = np.minimum(self.position - lower, upper - self.position)
        return margin

    @property
    def speed_share(self) -> Array:
        """Return the speeds (n, joints) as parts of their limits, 0 without one."""
        share: Array = np.abs(self.velocity) / np.array(self.mechanism.speed_limits)
        return share

    @property
    def torque_share(self) -> Array:
        """Return the torques (n, joints) as parts of their limits, 0 without one."""
        share: Array = np.abs(self.torque) / self.torque_limits
        return share

    def distance(self, point: Point) -> Array:
        """Return the distances (n) of a point from its path in m or rad."""
        distance: Array = np.linalg.norm(self.error[:, point.axes], axis=1)
        return distance

    def violations(self) -> list[str]:
        """Return a text for each limit that the path exceeds: place, value and excess."""
        texts = []
        for point in self.mechanism.points:
            distance = self.distance(point)
            row = int(np.argmax(distance))
            if distance[row] > TOLERANCE:
                texts.append(
                    f'{point.symbol} is {1e3 * distance[row]:.3g} {point.small_unit} from its '
                    f'path at {self.times[row]:.3g} s: the robot cannot follow it there'
                )
        if self.is_singular.any():
            first = self.times[int(np.argmax(self.is_singular))]
            texts.append(
                f'{self.mechanism.lost} is close to singular from {first:.3g} s on, for '
                f'{int(self.is_singular.sum())} ticks: {self.mechanism.singular}'
            )
        joints = self.mechanism.joints
        for joint, margin in zip(joints, self.range_margin.T, strict=True):
            row = int(np.argmin(margin))
            if margin[row] < 0.0:
                texts.append(
                    f'{joint.name} is {-margin[row]:.3g} {joint.unit} outside of its range at '
                    f'{self.times[row]:.3g} s'
                )
        units = [f'{joint.unit}/s' for joint in joints], [joint.effort_unit for joint in joints]
        for (share, values, noun), unit in zip(
            (
                (self.speed_share, self.velocity, 'moves at'),
                (self.torque_share, self.torque, 'needs'),
            ),
            units,
            strict=True,
        ):
            for k, joint in enumerate(joints):
                row = int(np.argmax(share[:, k]))
                if share[row, k] > 1.0:
                    texts.append(
                        f'{joint.name} {noun} {abs(values[row, k]):.4g} {unit[k]} at '
                        f'{self.times[row]:.3g} s, {100.0 * (share[row, k] - 1.0):.3g} % above '
                        'its limit'
                    )
        return texts

    def estimated_slowdown(self) -> float:
        """
        Return a factor of the duration that may suffice, at least _SMALLEST.

        Speeds decrease with the factor, torques without gravity with its square.
        """
        torque = float(self.torque_share.max(initial=0.0))
        return max(_SMALLEST, float(self.speed_share.max(initial=0.0)), math.sqrt(torque))


def preview(scenario: Scenario, slowdown: float = 1.0) -> Preview:
    """
    Compute the preview of a scenario.

    Parameters
    ----------
    scenario
        Scenario whose path is previewed.
    slowdown
        Factor of the duration of the path.

    Raises
    ------
    PathError
        If a point of the path is out of reach, or if the robot does not join or leaves the path.
    InputError
        If the path has no end.

    """
    nominal = _nominal_scenario(scenario, slowdown)
    plant, robot = nominal.plant, nominal.robot
    timing = Timing.from_values(plant)
    if timing.last is None:
        raise InputError('duration = 0.0: expected a length > 0 s for a preview')
    count = timing.last + 1
    trajectory = Trajectory(nominal.trajectory, timing.period / slowdown, robot)
    try:
        samples = trajectory.sample(0, count)
    except InputError as unreachable:
        raise PathError(str(unreachable)) from None
    axes = len(robot.mechanism.axes)
    samples[:, axes:2 * axes] /= slowdown
    samples[:, 2 * axes:] /= slowdown**2
    position = np.array(robot.start(INITIAL_POSE.of(plant), INITIAL_JOINTS.of(plant)))
    starts_on_path = bool(
        (np.abs(robot.task_errors(position[None], samples[:1, :axes])) < _JOINED * TOLERANCE).all()
        and (np.abs(samples[0, axes:2 * axes]) < _JOINED * TOLERANCE).all()
    )
    # An approach also smooths the acceleration at the start, which the path does not.
    control = {**nominal.controller, 'approach_on_start': not starts_on_path}
    nominal = nominal.with_nodes({'controller': control})
    simulation = Simulation(nominal, (), SampledTrajectory(np.arange(count), samples))
    try:
        blocks = list(simulation.run())
    except InputError as diverged:
        raise PathError(str(diverged)) from None
    joints = slice(-len(robot.mechanism.joints), None)

    def signal(name: str) -> Array:
        return np.concatenate([getattr(block, name) for block in blocks])

    error = np.concatenate([block.true_error(robot) for block in blocks])
    velocity = signal('true_velocity')[:, joints]
    acceleration: Array = np.gradient(velocity, timing.period, axis=0)
    rows = slice(0 if starts_on_path else _joined(error, robot.mechanism, timing), None)
    limits = [limit or math.inf for limit in lowest_limits(scenario)]
    return Preview(
        robot.mechanism,
        timing.period * np.arange(count, dtype=np.float64)[rows],
        signal('true_position')[rows, joints],
        velocity[rows],
        acceleration[rows],
        signal('torque')[rows],
        np.array(limits),
        samples[rows],
        error[rows],
        signal('singular')[rows, 0] != 0,
        trajectory.note,
    )


def sufficient_slowdown(scenario: Scenario, first: Preview) -> float | None:
    """
    Return a factor of the duration with which the path keeps all limits.

    Each of a few factors is tried by a preview. None if none of them suffices.
    """
    factor = first.estimated_slowdown()
    for _ in range(_TRIALS):
        factor = math.ceil(100.0 * factor) / 100.0
        with suppress(PathError):
            if not preview(scenario, factor).violations():
                return factor
        factor *= _MORE
    return None


def _joined(error: Array, mechanism: Mechanism, timing: Timing) -> int:
    """Return the tick from which the robot is on the path; PathError if there is none."""
    is_on = np.ones(len(error), dtype=np.bool_)
    for point in mechanism.points:
        is_on &= np.linalg.norm(error[:, point.axes], axis=1) < _JOINED * TOLERANCE
    tick = int(np.argmax(is_on)) + round(_SETTLING / timing.period)
    if not is_on.any() or tick >= len(error):
        point = mechanism.points[0]
        closest = np.linalg.norm(error[:, point.axes], axis=1).min()
        raise PathError(
            f'the robot does not join the path within {timing.time(len(error) - 1):g} s; '
            f'{point.symbol} comes as close as {1e3 * closest:.3g} {point.small_unit}. Expected a '
            'start on the path (masmc robot prints it), or a longer duration'
        )
    return tick


def _nominal_scenario(scenario: Scenario, slowdown: float) -> Scenario:
    """Return plant, controller and trajectory of a preview."""
    duration = {'duration': slowdown * DURATION.of(scenario.plant)}
    mechanism = scenario.mechanism
    nominal: dict[str, MutableValues] = {}
    for node in ('plant', 'controller'):
        kept = (*_PHYSICAL, *(_OF_CONTROL if node == 'controller' else ()))
        nominal[node] = {
            parameter.name: scenario[node][parameter.name]
            if parameter.name.startswith(kept)
            else parameter.default
            for parameter in declared(node, mechanism)
        }
        for name in _FREE & nominal[node].keys():
            nominal[node][name] = tuple(0.0 for _ in nominal[node][name])
    return Scenario(
        nominal['plant'] | duration,
        {**scenario.trajectory, **duration},
        nominal['controller'] | _NOMINAL | duration,
    )


_PLACES = 400
"""Largest number of places at which the timing is determined."""

_FASTEST, _QUICKEST = 50.0, 500.0
"""Largest first and second derivative of s, where all joints rest."""

_AT_REST = 2e-3
"""Part of the largest speed below which the joints rest at the start and at the end. toppra has no
solution for longer rests; a motion from rest misses its ends by 1e-6 of its length."""

_UNLIMITED = 1e3
"""Speed in rad/s or m/s that stands for no limit."""


def fastest_samples(seen: Preview, acceleration: float) -> tuple[Array, Array]:
    """
    Return times (n) and samples (n, 3 axes) of the fastest motion along a path.

    Parameters
    ----------
    seen
        Preview of the path from its start on.
    acceleration
        Largest acceleration of all joints in rad/s2 or m/s2.

    Raises
    ------
    InputError
        If the robot does not start on the path at rest, or if no timing keeps the limits.
    UserError
        If toppra is not installed.

    """
    try:
        from toppra import algorithm, constraint, SplineInterpolator
    except ModuleNotFoundError as error:
        raise remedy(error) from None
    if seen.times[0] > 0.0:
        raise InputError(
            'the robot does not start on the path at rest; expected a path from its start, which '
            'masmc robot prints, for a timing'
        )
    speed = np.linalg.norm(seen.velocity, axis=1)
    moving = np.flatnonzero(speed > _AT_REST * speed.max())
    if not len(moving):
        return seen.times[[0, -1]], seen.reference[[0, -1]]
    rows = np.unique(np.linspace(moving[0], moving[-1], _PLACES).round().astype(np.int64))
    s = seen.times[rows]
    moved = np.column_stack([seen.position[rows], s])
    speeds = np.append(np.minimum(seen.mechanism.speed_limits, _UNLIMITED), _FASTEST)
    changes = np.append(np.full(moved.shape[1] - 1, acceleration), _QUICKEST)
    path = SplineInterpolator(s, moved)
    timing = algorithm.TOPPRA(
        [
            constraint.JointVelocityConstraint(np.column_stack([-speeds, speeds])),
            constraint.JointAccelerationConstraint(np.column_stack([-changes, changes])),
        ],
        path,
        gridpoints=s,
    )
    _, rates, _ = timing.compute_parameterization(0.0, 0.0)
    if rates is None or not np.isfinite(rates).all():
        raise InputError(
            f'toppra has no timing of the path within the speeds of the joints and '
            f'{acceleration:g} rad/s² or m/s²; expected a larger acceleration'
        )
    steps = 2.0 * np.diff(s) / (rates[1:] + rates[:-1])
    times = np.append(0.0, np.cumsum(steps))
    # The derivative of the rate steps from place to place; the samples have its means.
    rises = np.diff(rates) / steps
    change = np.zeros(len(s))
    change[1:-1] = 0.5 * (rises[1:] + rises[:-1])
    position, slope, bend = np.split(seen.reference[rows], 3, axis=1)
    joints = _timed(moved, path(s, 1), path(s, 2), rates, change)
    fine = sample_knots(times, joints, places_between(times))
    _, fine_speeds, fine_changes = (np.abs(part).max(axis=0) for part in np.split(fine, 3, axis=1))
    excess = max((fine_speeds / speeds).max(), math.sqrt((fine_changes / changes).max()), 1.0)
    return excess * times, _timed(
        position, slope, bend, rates / excess, change / excess**2
    )


def _timed(
    position: Array, slope: Array, bend: Array, rates: Array, change: Array
) -> Array:
    """
    Return samples (n, 3 k) of a motion along a curve.

    Parameters
    ----------
    position, slope, bend
        Curve (n, k) and its derivatives by s.
    rates, change
        Derivatives (n) of s by the time.

    """
    rate = rates[:, None]
    return np.hstack([position, slope * rate, bend * rate**2 + slope * change[:, None]])
