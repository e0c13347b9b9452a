# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Equations of motion of a robot, averaged over windows, and their regressor.

With the momentum p = H v, the equations of motion are dp/dt - C' v + g + friction = torque. Their
average with a smooth weight h over a window, with the derivative moved to the weight,

    -∫ h'(s) p ds + ∫ h(s) (g - C' v + friction) ds = ∫ h(s) torque ds,

contains neither accelerations nor differentiated measurements.
"""

from __future__ import annotations

from typing import NamedTuple

from masmc_ros.aliases import Array, Flags, Integers, Records
from masmc_ros.jit.arrays import to_vector
from masmc_ros.jit.compiled import kernel
from masmc_ros.jit.field import Field
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.record import fill, new_record
from masmc_ros.jit.tuples import elementwise, unit
from masmc_ros.jit.vectors import check_workspace, free, mark
from masmc_ros.numerics.scalars import zero
from masmc_ros.robot import mechanism
from masmc_ros.robot.robot import Robot
from masmc_ros.robot.tree.friction import sliding
import numpy as np

_TAIL = 12.0
"""Time after which the response of the motor lag is ignored, in multiples of the lag."""

_GRID = 4000
"""Number of points of tabulated weights."""


def weight(x: Array) -> Array:
    """Return the weight 35/32 (1 - x²)³ for -1 < x < 1, with an integral of 1, and 0 outside."""
    return np.asarray(35.0 / 32.0 * np.clip(1.0 - x * x, 0.0, None) ** 3)


def weight_slope(x: Array) -> Array:
    """Return the derivative of `weight` by x."""
    return np.asarray(-6.0 * 35.0 / 32.0 * x * np.clip(1.0 - x * x, 0.0, None) ** 2)


class Windows(NamedTuple):
    """
    Windows in time of equal length.

    Attributes
    ----------
    centres
        (W) Times of their middles in s, ascending.
    half
        Half of their length in s.

    """

    centres: Array
    half: float


class Weights(NamedTuple):
    """
    Weights of N samples in the windows that contain them, at most M windows for each sample.

    Attributes
    ----------
    window
        (N, M) Indices of the windows; -1 for no window.
    mean
        (N, M) Weights of the sample in the average.
    slope
        (N, M) Weights of the sample in the average of its derivative, in 1/s.

    """

    window: Integers
    mean: Array
    slope: Array


class Average(NamedTuple):
    """
    Symmetric average with weights that are constant over intervals.

    Attributes
    ----------
    weights
        (2 m) Weights of the intervals in 1/s; their sum times `period` is 1.
    period
        Length of an interval in s.

    """

    weights: Array
    period: float

    @property
    def half(self) -> float:
        """Return half of its length in s."""
        return len(self.weights) * self.period / 2.0

    def sampled(self, step: float) -> Array:
        """Return an odd number of weights at multiples of a step in s around its middle."""
        side = np.arange(0.0, self.half, step)
        offsets = np.concatenate([-side[:0:-1], side])
        total = np.concatenate([[0.0], np.cumsum(self.weights)])
        edges = np.arange(len(total)) * self.period - self.half
        reached = [np.interp(offsets + sign * step / 2.0, edges, total) for sign in (1.0, -1.0)]
        return np.asarray(reached[0] - reached[1])


def windows_in(times: Array, half: float, valid: Flags, margin: float) -> Windows:
    """
    Return half-overlapping windows in which all samples are valid.

    Parameters
    ----------
    times
        (N) Times of the samples in s, ascending.
    half
        Half of the length of a window in s.
    valid
        (N - 1) True for intervals between samples without a gap.
    margin
        Time in s before a window in which the intervals must be valid as well.

    """
    centres = np.arange(times[0] + half + margin, times[-1] - half, half)
    bad = np.concatenate([[0], np.cumsum(~valid)])
    first = np.searchsorted(times, centres - half - margin, side='right') - 1
    last = np.searchsorted(times, centres + half)
    return Windows(centres[bad[last] == bad[first]], half)


def sample_weights(times: Array, windows: Windows) -> Weights:
    """Return the weights of samples in windows by the trapezoidal rule; `times` (N) are in s."""
    steps = np.diff(times)
    share = np.concatenate([[0.0], steps]) / 2.0 + np.concatenate([steps, [0.0]]) / 2.0
    half = windows.half
    first = np.searchsorted(windows.centres, times - half)
    end = np.searchsorted(windows.centres, times + half, side='right')
    count = max(1, int((end - first).max()))
    window = first[:, None] + np.arange(count)
    outside = window >= end[:, None]
    x = (times[:, None] - windows.centres[np.minimum(window, len(windows.centres) - 1)]) / half
    mean = np.where(outside, 0.0, weight(x) / half * share[:, None])
    slope = np.where(outside, 0.0, -weight_slope(x) / half**2 * share[:, None])
    return Weights(np.where(outside, -1, window), mean, slope)


def average_of_held(
    times: Array,
    values: Array,
    windows: Windows,
    delay: float = 0.0,
    lag: float = 0.0,
    smoothing: Average | None = None,
) -> Array:
    """
    Return the averages (W, k) of k delayed values, each held until the next one.

    Parameters
    ----------
    times
        (M) Times of the values in s, ascending.
    values
        (M, k) Values.
    windows
        W windows of the average.
    delay
        Delay of the values in s.
    lag
        Time constant in s of a first-order lag after the delay; 0: no lag.
    smoothing
        Average of the rates, if they are not measured; None: no additional average.

    """
    half = windows.half + (0.0 if smoothing is None else smoothing.half)
    # Weight of a value at a time relative to the middle: h, filtered backwards by the lag.
    grid = np.linspace(-half - _TAIL * lag, half, _GRID)
    lagged = weight(grid / windows.half)
    if smoothing is not None:
        lagged = np.convolve(lagged, smoothing.sampled(float(grid[1] - grid[0])), mode='same')
    if lag > 0.0:
        lagged = _filtered_backwards(lagged, float(grid[1] - grid[0]), lag)
    total = np.concatenate([[0.0], np.cumsum(0.5 * (lagged[1:] + lagged[:-1]))])
    total /= total[-1]
    start = np.searchsorted(times, windows.centres + grid[0] - delay, side='right') - 1
    end = np.searchsorted(times, windows.centres + half - delay)
    index = np.maximum(start, 0)[:, None] + np.arange(int((end - start).max()) + 1)
    edges = times[np.minimum(index, len(times) - 1)] + delay - windows.centres[:, None]
    edges = np.where(index < len(times), edges, half)
    reached = np.interp(edges, grid, total)
    parts = np.diff(reached, axis=1)
    rows = np.minimum(index[:, :-1], len(times) - 1)
    return np.asarray(np.einsum('wm,wmk->wk', parts, values[rows]))


def _filtered_backwards(values: Array, step: float, lag: float) -> Array:
    """Return the response of a first-order lag to values (n) that run backwards in time."""
    from scipy.signal import lfilter

    decay = float(np.exp(-step / lag))
    return np.asarray(lfilter([1.0 - decay], [1.0, -decay], values[::-1])[::-1])


_BODY = (
    Field('geometry', 'lengths', 'Lengths of the robot', 'm'),
    Field('theta', 'parameters', 'Its base inertial parameters'),
    Field('position', 'positions', 'Positions', 'm, rad'),
    Field('rates', 'joints', "The joints' rates", 'rad/s'),
    Field('pose', 'base', 'Pose of the base', 'm, rad'),
)

FRICTIONS = ('viscous', 'coulomb')
"""Kinds of friction, whose coefficients follow the inertial parameters."""

COULOMB_SHARE = 0.1
"""Expected Coulomb friction, as a part of the RMS torque of the joint."""


class Equations(NamedTuple):
    """
    Averaged equations of motion: matrix x = torque - known.

    Attributes
    ----------
    matrix
        (W, n, q + 2 n) Factors of q inertial parameters, and of viscous and Coulomb friction of n
        joints.
    known
        (W, n) Torques that depend on no parameter, those of rotors, in N·m.

    """

    matrix: Array
    known: Array


def record_of(robot: Robot, theta: Array) -> Records:
    """Return an array of one record with a robot and its inertial parameters (q), for kernels."""
    body = new_record(_BODY, robot.mechanism.sizes, 1, {'mechanism': robot.mechanism.tag})
    fill(body, 'geometry', robot.geometry)
    fill(body, 'theta', theta)
    return body


def averaged(robot: Robot, position: Array, rates: Array, weights: Weights) -> Equations:
    """
    Return the equations of motion, averaged over windows.

    Parameters
    ----------
    robot
        Robot without friction; its inertial parameters are not used.
    position
        (N, positions) Positions in m and rad.
    rates
        (N, n) Joint rates in rad/s or m/s.
    weights
        Weights of the N samples in the windows.

    """
    joints, parameters = rates.shape[1], len(robot.theta)
    count = int(weights.window.max()) + 1
    matrix = np.zeros((count, joints, parameters + len(FRICTIONS) * joints))
    known = np.zeros((count, joints))
    body = record_of(robot, np.zeros(parameters))
    position, rates, mean, slope = map(
        np.ascontiguousarray, (position, rates, weights.mean, weights.slope)
    )
    window = np.ascontiguousarray(weights.window)
    _add_samples(body, position, rates, window, mean, slope, matrix, known)
    return Equations(matrix, known)


def instantaneous(robot: Robot, position: Array, rates: Array, acceleration: Array) -> Equations:
    """
    Return the equations of motion at N states, in place of averages over windows.

    Parameters
    ----------
    robot
        Robot without friction; its inertial parameters are not used.
    position
        (N, positions) Positions in m and rad.
    rates, acceleration
        (N, n) Joint rates and accelerations in rad/s and rad/s², or m/s and m/s².

    """
    joints, parameters = rates.shape[1], len(robot.theta)
    matrix = np.zeros((len(position), joints, parameters + len(FRICTIONS) * joints))
    known = np.zeros((len(position), joints))
    position, rates, acceleration = map(np.ascontiguousarray, (position, rates, acceleration))
    body = record_of(robot, np.zeros(parameters))
    _write_states(body, position, rates, acceleration, matrix, known)
    return Equations(matrix, known)


@kernel
def _write_states(
    body: Records, position: Array, rates: Array, acceleration: Array, matrix: Array, known: Array
) -> None:
    """Write the equations of motion at states (N), row by row in joint torques."""
    record = lane_of(body[0], 0)
    theta = record.theta
    place, template = record.position, record.rates
    model = mechanism.model_of(record)
    parameters, joints = len(theta), len(template)
    of_samples = mark(record)
    for k in range(len(position)):
        free(record, of_samples)
        posture = mechanism.posture(model, to_vector(position[k], place))
        v = mechanism.motion(model, to_vector(rates[k], template))
        a = mechanism.motion(model, to_vector(acceleration[k], template))
        y = mechanism.regressor(model, posture, v, v, a)
        rotors = mechanism.joint_torques(model, mechanism.regressor_times(model, y, theta))
        of_joints = mark(record)
        for j in range(joints):
            free(record, of_joints)
            along = mechanism.motion(model, unit(template, j))
            row = mechanism.regressor_transpose_times(model, y, along, theta)
            for i in range(parameters):
                matrix[k, j, i] = row[i]
            matrix[k, j, parameters + j] = rates[k, j]
            matrix[k, j, parameters + joints + j] = sliding(rates[k, j])
            known[k, j] = rotors[j]
    check_workspace(record)


@kernel
def _add_samples(
    body: Records,
    position: Array,
    rates: Array,
    window: Integers,
    mean: Array,
    slope: Array,
    matrix: Array,
    known: Array,
) -> None:
    """
    Add samples (N) to the equations of their windows, row by row in joint torques.

    v_j is the motion of joint j alone. Without gravity, the row of momentum is Y(0, 0, v)' v_j,
    and that of C' v is Y(v, v_j, 0)' v, because Hdot - 2 C is skew-symmetric.
    """
    record = lane_of(body[0], 0)
    theta = record.theta
    place, template = record.position, record.rates
    still = elementwise(zero, template)
    model = mechanism.model_of(record)
    parameters, joints = len(theta), len(template)
    momentum, force = np.empty(parameters), np.empty(parameters)
    of_samples = mark(record)
    for k in range(len(position)):
        if window[k, 0] < 0:
            continue
        free(record, of_samples)
        posture = mechanism.posture(model, to_vector(position[k], place))
        v = mechanism.motion(model, to_vector(rates[k], template))
        at_rest = mechanism.regressor(model, posture, still, still, still)
        moving = mechanism.regressor(model, posture, still, still, v)
        lifting = mechanism.regressor_transpose_times(model, at_rest, v, theta)
        rotors = mechanism.joint_torques(model, mechanism.regressor_times(model, moving, theta))
        of_joints = mark(record)
        for j in range(joints):
            free(record, of_joints)
            along = mechanism.motion(model, unit(template, j))
            gravity = mechanism.regressor_transpose_times(model, at_rest, along, theta)
            impulse = mechanism.regressor_transpose_times(model, moving, along, theta)
            turning = mechanism.regressor(model, posture, v, along, still)
            power = mechanism.regressor_transpose_times(model, turning, v, theta)
            for i in range(parameters):
                momentum[i] = impulse[i] - gravity[i]
                force[i] = gravity[i] - (power[i] - lifting[i])
            rate = rates[k, j]
            for m in range(window.shape[1]):
                w = window[k, m]
                if w < 0:
                    continue
                average, derivative = mean[k, m], slope[k, m]
                for i in range(parameters):
                    matrix[w, j, i] += derivative * momentum[i] + average * force[i]
                matrix[w, j, parameters + j] += average * rate
                matrix[w, j, parameters + joints + j] += average * sliding(rate)
                known[w, j] += derivative * rotors[j]
    check_workspace(record)
