# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""States and commanded torques of a run, as the identification uses them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from masmc_ros.aliases import Array, Flags
from masmc_ros.errors import InputError
from masmc_ros.identification.regressor import Average
from masmc_ros.log.read.reader import Run
import numpy as np

SHORTEST = 5.0
"""Shortest time in s of states and commands."""

_SLOWEST = 0.01
"""Speed in rad/s or m/s that a joint exceeds if the robot moves."""

_NOISIEST = 5.0e-3
"""Noise in rad/s or m/s above which measured velocities are not used."""

_LONGEST_GAP = 2.5
"""Longest interval between samples, in medians of the intervals."""

_FEWEST_PERIODS = 8
"""Smallest number of intervals between states in half of a window."""
_SHORTEST_HALF = 0.05
"""Shortest half of a window in s."""

_SMOOTH_PERIODS = 3
"""Smallest number of intervals in half of the filter of velocities."""
_SHORTEST_SMOOTHING = 0.01
"""Shortest half of the filter of velocities in s."""

_DEGREE = 4
"""Degree of the local polynomials of the positions."""


@dataclass(frozen=True)
class Samples:
    """
    Motion and commands of a robot with n joints.

    Attributes
    ----------
    times
        (N) Stamps of the states in s, ascending.
    position
        (N, positions) Positions in m and rad.
    velocity
        (N, n) Measured joint rates in rad/s or m/s, NaN if they were not measured.
    command_times
        (M) Stamps in s of the states from which the commands were computed, ascending.
    commands
        (M, n) Commanded torques in N·m or N.
    is_interrupted
        (M) True for a command that a void command follows; None if there are no void commands.

    """

    times: Array
    position: Array
    velocity: Array
    command_times: Array
    commands: Array
    is_interrupted: Flags | None = None

    @property
    def period(self) -> float:
        """Return the median interval between states in s."""
        return float(np.median(np.diff(self.times)))

    @property
    def half(self) -> float:
        """Return half of the length of a window of averages in s."""
        return max(_SHORTEST_HALF, _FEWEST_PERIODS * self.period)

    @cached_property
    def differences(self) -> Array:
        """Return the coefficients (2 m + 1) in 1/s of the filter from positions to rates."""
        from scipy.signal import savgol_coeffs

        count = max(_SMOOTH_PERIODS, round(_SHORTEST_SMOOTHING / self.period))
        return np.asarray(
            savgol_coeffs(2 * count + 1, _DEGREE, deriv=1, delta=self.period, use='dot')
        )

    @cached_property
    def has_rates(self) -> bool:
        """Return True if velocities were measured with little noise."""
        # Third differences of white noise have twenty times its variance.
        noise = np.sqrt(np.mean(np.diff(self.velocity, 3, axis=0) ** 2, axis=0) / 20.0)
        return bool((noise < _NOISIEST).all())

    @property
    def smoothing(self) -> Average | None:
        """Return the averaging filter in `rates`; None if rates are measured."""
        if self.has_rates:
            return None
        return Average(np.cumsum(self.differences[:0:-1]) , self.period)

    @cached_property
    def rates(self) -> Array:
        """
        Return the rates of the joints (N, n) in rad/s or m/s, measured or from positions.

        Rates from positions are averages of the true ones. The torques are then averaged in the
        same way, so the filter has no effect on the result.
        """
        if self.has_rates:
            return self.velocity
        period, factors = self.period, self.differences
        count = len(factors) // 2
        times = self.times
        last = round((times[-1] - times[0]) / period)
        grid = times[0] + period * np.arange(-count, last + count + 1)
        angles = self.position[:, -self.commands.shape[1]:]
        columns = []
        for column in angles.T:
            smooth = np.correlate(np.interp(grid, times, column), factors, mode='valid')
            columns.append(np.interp(times, grid[count:-count], smooth))
        return np.column_stack(columns)

    @property
    def valid(self) -> Flags:
        """Return (N - 1) True for the intervals between states without a gap."""
        valid = _without_gap(self.times)
        commanded = _without_gap(self.command_times)
        # Index of the command before each state; the last command is valid for some periods.
        number = np.searchsorted(self.command_times, self.times, side='right') - 1
        last = len(self.command_times) - 1
        held = self.times - self.command_times[np.maximum(number, 0)]
        period = float(np.median(np.diff(self.command_times)))
        known = (number >= 0) & ((number < last) | (held < _LONGEST_GAP * period))
        known[number < last] &= commanded[np.maximum(number[number < last], 0)]
        if self.is_interrupted is not None:
            known &= ~self.is_interrupted[np.maximum(number, 0)]
        return np.asarray(valid & known[:-1] & known[1:])


def samples_of(run: Run) -> Samples:
    """
    Return the states and commands of a logged run.

    Void commands are no torques. Raises InputError for a run without commanded torques, with too
    few states, or without motion.
    """
    if run.commands_rates:
        raise InputError(
            f'{run.path}: commands of velocities; expected commanded torques '
            '(command_interface: effort), from which masses and friction can be computed'
        )
    if run.is_hybrid:
        raise InputError(
            f'{run.path}: commanded velocities of the base (command_interface: hybrid); expected '
            'commanded torques of all joints (command_interface: effort), from which masses and '
            'friction can be computed'
        )
    if not len(run.torque):
        raise InputError(
            f'{run.path}: no commanded torques in it; expected effort_commands, recorded with '
            'joint_states'
        )
    order = np.argsort(run.torque.times, kind='stable')
    times, first = np.unique(run.torque.times[order], return_index=True)
    commands, is_interrupted = run.torque.values[order][first], None
    if run.torque.is_void is not None:
        # The drives, and not these zeros, determine the torques after a void command.
        is_torque = ~run.torque.is_void[order][first]
        is_interrupted = np.append(~is_torque[1:], False)[is_torque]
        times, commands = times[is_torque], commands[is_torque]
    if not len(times):
        raise InputError(
            f'{run.path}: void commands only; expected commanded torques of an active controller '
            '(~/enable)'
        )
    start = max(float(run.times[0]), float(times[0]))
    end = min(float(run.times[-1]), float(times[-1]))
    if end - start < SHORTEST:
        raise InputError(
            f'{run.path}: {max(0.0, end - start):.3g} s of states with commands; expected at '
            f'least {SHORTEST:g} s, better 30 s'
        )
    velocity = run.velocity[:, len(run.mechanism.base):]
    samples = Samples(run.times, run.position, velocity, times, commands, is_interrupted)
    fastest = float(np.abs(samples.rates).max())
    if not fastest > _SLOWEST:
        raise InputError(
            f'{run.path}: the robot did not move (fastest joint {fastest:.3g} rad/s); expected a '
            'motion of all joints, such as that of masmc excite'
        )
    return samples


def _without_gap(times: Array) -> Flags:
    steps = np.diff(times)
    return np.asarray(steps < _LONGEST_GAP * np.median(steps))
