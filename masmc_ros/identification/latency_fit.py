# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Latency and motor lag: best alignment of commands with the measured motion, or with efforts.

The averaged equations of motion are linear in the parameters, which are therefore eliminated
(variable projection, Golub and Pereyra 1973). The remaining residual depends on the latency L and
the lag alone. L is the age of a state when the torque computed from it starts to act.

Many drives report the torque of their motors as `effort` in joint_states. This is an echo of the
command, delayed and filtered by the lag of the motors. The fit finds the delay and the lag with
which the commands explain the changes of the efforts best. Gain and offset of each joint are free,
because the efforts may be currents. An effort is assumed to be the mean over the interval before
its stamp. For instantaneous efforts, the delay is up to one period too small.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.jit.compiled import kernel
import numpy as np

LARGEST = 0.1
"""Largest latency and motor lag in s."""

_COARSE = 0.005
"""Step in s of the first search."""

_STEP = 1.0e-4
"""Step in s of the differences."""


_SHARES = (0.1, 0.5, 0.9)
"""Shares of the lag in the sum of latency and lag, at the starts of the search."""


class Estimate(NamedTuple):
    """Value and its standard error, in the same unit."""

    value: float
    error: float


class LatencyFit(NamedTuple):
    """Latency, motor lag and their sum in s; the sum has the smallest error."""

    latency: Estimate
    lag: Estimate
    total: Estimate


def fit_timing(
    residual: Callable[[float, float], Array], near: LatencyFit | None = None
) -> LatencyFit:
    """
    Return the latency and the motor lag with the smallest residual.

    Parameters
    ----------
    residual
        Function of latency and lag in s that returns the projected and weighted residuals (r).
    near
        Estimate from which the search starts; None: a search over the whole range.

    """
    from scipy.optimize import least_squares

    if near is None:
        grid = np.arange(_COARSE, LARGEST + _COARSE / 2.0, _COARSE)
        costs = [float(np.sum(residual(total, 0.0) ** 2)) for total in grid]
        start = float(grid[int(np.argmin(costs))])
        shares = list(_SHARES)
    else:
        start = max(near.total.value, _STEP)
        shares = [min(max(near.lag.value / start, _SHARES[0]), _SHARES[-1])]

    def derivatives(latency: float, lag: float) -> Array:
        """Return the derivatives (r, 2) by latency and lag."""
        low_latency, low_lag = max(latency - _STEP, 0.0), max(lag - _STEP, 0.0)
        by_latency = residual(latency + _STEP, lag) - residual(low_latency, lag)
        by_lag = residual(latency, lag + _STEP) - residual(latency, low_lag)
        return np.column_stack([
            by_latency / (latency + _STEP - low_latency),
            by_lag / (lag + _STEP - low_lag),
        ])

    # The sum of both and the share of the lag in it are nearly independent variables.
    def of_share(x: Array) -> tuple[float, float]:
        return float(x[0] * (1.0 - x[1])), float(x[0] * x[1])

    def jacobian(x: Array) -> Array:
        total, share = x
        outer = np.array([[1.0 - share, -total], [share, total]])
        return np.asarray(derivatives(*of_share(x)) @ outer)

    fits = [
        least_squares(
            lambda x: residual(*of_share(x)),
            [start, share],
            jacobian,
            ([0.0, 0.0], [2.0 * LARGEST, 1.0]),
            x_scale=[_COARSE, 1.0],
        )
        for share in shares
    ]
    fit = min(fits, key=lambda candidate: candidate.cost)
    latency, lag = of_share(fit.x)
    factors = derivatives(latency, lag)
    variance = 2.0 * fit.cost / max(1, len(fit.fun) - 2)
    covariance = variance * np.linalg.pinv(factors.T @ factors)
    return LatencyFit(
        Estimate(latency, float(np.sqrt(covariance[0, 0]))),
        Estimate(lag, float(np.sqrt(covariance[1, 1]))),
        Estimate(latency + lag, float(np.sqrt(covariance.sum()))),
    )


_LONGEST_GAP = 2.5
"""Interval between two states above which there is a gap, in control periods."""


class StateBuffer:
    """Buffer of a constant number of consecutive states."""

    def __init__(self, count: int, widths: Sequence[int], period: float) -> None:
        """
        Initialise an empty buffer.

        Parameters
        ----------
        count
            Number N of states of a full buffer.
        widths
            Number of components of each value of a state.
        period
            Control period in s.

        """
        self._stamps = np.zeros(count, np.int64)
        self._numbers = np.zeros((count, sum(widths)))
        ends = np.cumsum(widths).tolist()
        self._columns = [slice(end - width, end) for end, width in zip(ends, widths, strict=True)]
        self._longest = round(1e9 * _LONGEST_GAP * period)
        self._count = self._last = 0

    def add(self, stamp: int, *values: Array) -> list[Array] | None:
        """
        Add a state, and return the content of a full buffer; a gap empties the buffer.

        Parameters
        ----------
        stamp
            Stamp of the state in ns.
        values
            Values of the state, (width) each.

        Returns
        -------
            Times in s (N), ascending from zero, and each value (N, width); None if not full.

        """
        if not 0 < stamp - self._last <= self._longest:
            self._count = 0
        count, self._last = self._count, stamp
        self._stamps[count] = stamp
        row = self._numbers[count]
        for column, value in zip(self._columns, values, strict=True):
            row[column] = value
        self._count = count + 1
        if self._count < len(self._stamps):
            return None
        self._count = 0
        times = np.asarray(1e-9 * (self._stamps - self._stamps[0]), np.float64)
        numbers = self._numbers.copy()
        return [times, *(numbers[:, column] for column in self._columns)]


BURST = 2.0
"""Duration of a compared part of the run in s."""

_PAUSE = 14
"""Time between two parts, as a multiple of their length."""

_FEWEST = 150
"""Smallest number of samples of a part."""

_CHANGE = 0.05
"""Interval in s of the compared changes; slow torques change little over it."""

_ECHO_SHARES = (0.0, 0.5, 0.9)
"""Shares of the lag in the sum of delay and lag, at the start of the search."""

_ECHO_COARSE = 2.0e-3
"""Step in s of the first search."""

_REFINEMENTS = 16
"""Number of grids of the search, each 0.6 times as large as the previous one."""

_LEAST_CHANGE = 1.0e-3
"""Smallest RMS change of the effort of a used joint, relative to the largest one."""

_EXPLAINED = 0.98
"""Smallest share of the squared changes that the commands of an echo explain."""

_PRECISE = 1.0e-3
"""Largest standard error in s of the sum of delay and lag."""

_TOLERATED = 0.2
"""Largest error of the latency, relative to the right value, without a warning."""


class EchoBuffer:
    """Parts of the states and commands of a run, with pauses between them."""

    def __init__(self, joints: int, period: float) -> None:
        """Initialise an empty buffer for a control period in s."""
        count = max(_FEWEST, round(BURST / period))
        self._buffer = StateBuffer(count, (joints, joints), period)
        self._pause, self._skipped = _PAUSE * count, 0

    def add(self, stamp: int, effort: Array, torque: Array) -> tuple[Array, Array, Array] | None:
        """
        Add a state and its command; return times in s, efforts and torques of a complete part.

        Parameters
        ----------
        stamp
            Stamp of the state in ns.
        effort, torque
            Efforts (joints) in the state, and commanded torques (joints).

        """
        if self._skipped:
            self._skipped -= 1
            return None
        part = self._buffer.add(stamp, effort, torque)
        if part is None:
            return None
        self._skipped = self._pause
        times, efforts, torques = part
        return (times, efforts, torques) if efforts.any() else None


class _Fit(NamedTuple):
    """Scaled changes (r) of the efforts without explanation, and the explained share."""

    residual: Array
    explained: float


@kernel
def _echo(times: Array, torque: Array, delay: float, lag: float, means: Array) -> None:
    """
    Write the means (N, n) of delayed and lagging torques over the interval before each time.

    Each torque (N, n) is held until the next one. The lag obeys lag y' = u - y, so the integral of
    y is that of u less the lag times the change of y.
    """
    for j in range(torque.shape[1]):
        node, value, integral, before = 0, torque[0, j], 0.0, 0.0
        for k in range(len(times)):
            at = times[k] - delay
            while node + 1 < len(times) and times[node + 1] <= at:
                held, length = torque[node, j], times[node + 1] - times[node]
                decay = np.exp(-length / lag) if lag > 0.0 else 0.0
                reached = held + (value - held) * decay
                integral += held * length + lag * (value - reached)
                value = reached
                node += 1
            held, length = torque[node, j], max(at - times[node], 0.0)
            decay = np.exp(-length / lag) if lag > 0.0 else 0.0
            total = integral + held * length + lag * (value - held) * (1.0 - decay)
            means[k, j] = (total - before) / (times[k] - times[k - 1]) if k > 0 else 0.0
            before = total


def compile_echo() -> None:
    """Compile or load the kernel of the comparison."""
    _echo(np.array([0.0, 1.0]), np.zeros((2, 1)), 0.0, 0.0, np.empty((2, 1)))


def fit_echo(times: Array, effort: Array, torque: Array) -> LatencyFit | None:
    """
    Return the delay and the lag of the efforts; None if they are no echo of the torques.

    Parameters
    ----------
    times
        (N) Stamps of the states in s, ascending.
    effort
        (N, n) Efforts in the states.
    torque
        (N, n) Commanded torques, each computed from the state of the same row.

    """
    period = float(np.median(np.diff(times)))
    step = max(1, round(_CHANGE / period))
    first = int(np.searchsorted(times, times[0] + 2.0 * LARGEST))
    if first + 2 * step >= len(times) or not np.isfinite(effort).all():
        return None
    changes = effort[first + step:] - effort[first:-step]
    size = np.sqrt(np.mean(changes**2, axis=0))
    used = size > _LEAST_CHANGE * size.max()
    moving = np.ptp(torque, axis=0) > 0.0
    if not (used & moving).any():
        return None
    used &= moving
    targets, torque = changes[:, used] / size[used], np.ascontiguousarray(torque[:, used])
    means = np.empty_like(torque)

    def fit(delay: float, lag: float) -> _Fit:
        _echo(times, torque, delay, lag, means)
        columns = means[first + step:] - means[first:-step]
        gains = np.sum(columns * targets, axis=0) / (np.sum(columns**2, axis=0) + 1e-300)
        residual = (targets - columns * gains).ravel()
        return _Fit(residual, 1.0 - float(np.mean(residual**2)))

    totals = np.arange(0.0, LARGEST, max(0.5 * period, _ECHO_COARSE))
    starts = [(total * (1.0 - share), total * share) for total in totals for share in _ECHO_SHARES]
    best = max(starts, key=lambda at: fit(*at).explained)
    width = max(0.5 * period, _ECHO_COARSE)
    for _ in range(_REFINEMENTS):
        delay, lag = best
        grid = (-width, 0.0, width)
        near = {(max(delay + a - b, 0.0), max(lag + b, 0.0)) for a in grid for b in grid}
        best = max((best, *near), key=lambda at: fit(*at).explained)
        width *= 0.6
    delay, lag = best
    result = fit(delay, lag)
    if result.explained < _EXPLAINED:
        return None
    slopes = np.column_stack([
        (fit(delay + _STEP, lag).residual - result.residual) / _STEP,
        (fit(delay, lag + _STEP).residual - result.residual) / _STEP,
    ])
    # Neighbouring differences overlap, so only one in `step` is independent.
    variance = float(np.mean(result.residual**2)) * step
    covariance = variance * np.linalg.pinv(slopes.T @ slopes)
    total = Estimate(delay + lag, float(np.sqrt(covariance.sum())))
    if total.error > _PRECISE:
        return None
    errors = np.sqrt(np.diag(covariance)).tolist()
    return LatencyFit(Estimate(delay, errors[0]), Estimate(lag, errors[1]), total)


def echo_text(timing: LatencyFit) -> str:
    """Return delay and lag in ms as text."""
    total, lag = (f'{1e3 * t.value:.1f} ± {1e3 * t.error:.1f}' for t in (timing.total, timing.lag))
    return f'{total}, with a motor lag of {lag}'


def wrong_latency(timing: LatencyFit, latency: float, motor_lag: float, period: float) -> str:
    """
    Return a warning if the parameters differ from the latency of the efforts, otherwise ''.

    Parameters
    ----------
    timing
        Latency and lag by the efforts.
    latency, motor_lag, period
        Parameters of the controller, and the control period, in s.

    """
    total = timing.total
    tolerance = max(period, _TOLERATED * total.value) + 3.0 * total.error
    if abs(latency + motor_lag - total.value) <= tolerance:
        return ''
    return (
        f'latency = {latency:g}, motor_lag = {motor_lag:g}: the efforts in joint_states follow '
        f'the commands after {echo_text(timing)} ms; expected latency = '
        f'{timing.latency.value:.4f} and motor_lag = {timing.lag.value:.4f}'
    )
