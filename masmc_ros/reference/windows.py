# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Reference of the controller: windows of samples received in advance.

The reference has one source at a time. Windows that cover the current time are a running
trajectory: a set-point is rejected until they have ended. Windows that reach the current time
replace an active set-point.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import kernel
from masmc_ros.numerics.hermite import quintic
import numpy as np

_ON_GRID_NS = 2
"""Largest distance to a sample that is used without interpolation; stamps are rounded to 1 ns."""

_KEPT_NS = 10_000_000_000
"""Time in ns for which windows are kept after their end, in case the plant is set back."""

_MOST = 1000
"""Largest number of windows; a further one replaces the oldest."""


@dataclass(frozen=True)
class Window:
    """Samples (n, 3 axes) of x_d, xdot_d, xddot_d, `period_ns` apart, stamps `start` to `end`."""

    start: int
    end: int
    period_ns: float
    samples: Array

    def at(self, stamp: int) -> Array:
        """Return the sample (3 axes) at a stamp between start and end."""
        place = (stamp - self.start) / self.period_ns
        nearest = round(place)
        if abs(stamp - self.start - nearest * self.period_ns) <= _ON_GRID_NS:
            return self.samples[nearest]
        before = min(int(place), len(self.samples) - 2)
        out = np.empty(self.samples.shape[1])
        _between(
            self.samples[before],
            self.samples[before + 1],
            self.period_ns * 1e-9,
            place - before,
            out,
        )
        return out

    def covers(self, stamp: int, beyond: float = _ON_GRID_NS) -> bool:
        """Return True if a stamp in ns is within start and end, or less than `beyond` outside."""
        return self.start - beyond <= stamp <= self.end + beyond


@kernel
def _between(first: Array, second: Array, period: float, part: float, out: Array) -> None:
    n = len(out) // 3
    for i in range(n):
        position, velocity, acceleration = quintic(
            (first[i], first[n + i], first[2 * n + i]),
            (second[i], second[n + i], second[2 * n + i]),
            period,
            part,
        )
        out[i] = position
        out[n + i] = velocity
        out[2 * n + i] = acceleration


class ReferenceWindows:
    """Windows received so far; newer ones replace older where they overlap."""

    def __init__(self, axes: int, on_notice: Callable[[str], object] = lambda _: None) -> None:
        """Initialise without a reference; `on_notice` receives a text if a source is replaced."""
        self._size, self._on_notice = 3 * axes, on_notice
        self._windows: list[Window] = []
        # The window of the last sample, and the first and last stamp without a newer one.
        self._recent: tuple[int, int, Window] | None = None
        self._set_point: Array | None = None

    def add(self, start: int, period: float, samples: Array) -> None:
        """
        Add samples (n, 3 axes) every `period` s from the stamp `start` in ns.

        Raises InputError for numbers that are not finite and for a period that is not > 0.
        """
        if not np.isfinite(samples).all():
            raise InputError('reference: a sample is not finite, expected numbers everywhere')
        if len(samples) == 0 or samples.shape[1:] != (self._size,):
            raise InputError(
                f'reference: samples of shape {samples.shape}, expected (n, {self._size})'
            )
        if not (np.isfinite(period) and period > 0.0):
            raise InputError(f'reference: sample period {period}, expected more than 0 s')
        self._recent = None
        period_ns = period * 1e9
        end = start + round((len(samples) - 1) * period_ns)
        # Compiled code requires this layout and does not check it.
        samples = np.require(samples, np.float64, ('C', 'A'))
        self._windows.append(Window(start, end, period_ns, samples))
        if len(self._windows) > _MOST:
            del self._windows[0]

    def set_point(self, numbers: Array, stamp: int | None = None) -> None:
        """
        Hold a position (axes), optionally followed by velocity and acceleration.

        Raises InputError for another count, for numbers that are not finite, and while windows
        cover `stamp` in ns; None stands for any time.
        """
        counts = self._size // 3, 2 * self._size // 3, self._size
        if numbers.size not in counts or not np.isfinite(numbers).all():
            raise InputError(
                'reference: {}, expected {}, {} or {} finite numbers or a window'.format(
                    numbers.tolist(), *counts
                )
            )
        if self._windows and (stamp is None or self._covering(stamp) is not None):
            raise InputError(
                'a set-point while a trajectory runs; end the trajectory, or wait until it ends'
            )
        sample = np.zeros(self._size)
        sample[: numbers.size] = numbers
        self._set_point = sample

    def at(self, stamp: int) -> Array | None:
        """Return the sample (3 axes) at a stamp in ns; None without one."""
        recent = self._recent
        if recent is not None and recent[0] <= stamp <= recent[1]:
            return recent[2].at(stamp)
        window = self._covering(stamp)
        if window is None:
            return self._set_point
        if self._set_point is not None:
            self._set_point = None
            self._on_notice('a trajectory has started; it replaces the set-point')
        self._recent = *self._span(window, stamp), window
        self._forget_before(stamp)
        return window.at(stamp)

    def _span(self, window: Window, stamp: int) -> tuple[int, int]:
        """Return the first and the last stamp next to a stamp at which a window is the newest."""
        first, last = window.start, window.end
        for newer in reversed(self._windows):
            if newer is window:
                break
            if newer.start > stamp:
                last = min(last, newer.start - 1)
            else:
                first = max(first, newer.end + 1)
        return first, last

    def _covering(self, stamp: int) -> Window | None:
        """Return the newest window at a stamp in ns, or one that joins its two neighbours."""
        for window in reversed(self._windows):
            if window.covers(stamp):
                return window
        near = [w for w in self._windows if w.covers(stamp, w.period_ns)]
        before = [candidate for candidate in near if candidate.end < stamp]
        after = [candidate for candidate in near if candidate.start > stamp]
        if not (before and after):
            return None
        first, second = before[-1], after[-1]
        period = second.start - first.end
        if period > first.period_ns + _ON_GRID_NS:
            return None
        ends = np.stack([first.samples[-1], second.samples[0]])
        return Window(first.end, second.start, period, ends)

    @property
    def end(self) -> int | None:
        """Return the last stamp in ns of all windows; None without a window."""
        return max((window.end for window in self._windows), default=None)

    def held_after(self, stamp: int) -> Array | None:
        """Return the last position at rest (3 axes) if a reference has ended by this stamp."""
        ended = [window for window in self._windows if window.end < stamp]
        if not ended:
            return None
        latest = max(ended, key=lambda window: window.end)
        sample = np.zeros(self._size)
        axes = self._size // 3
        sample[:axes] = latest.samples[-1, :axes]
        return sample

    def _forget_before(self, stamp: int) -> None:
        self._windows = [w for w in self._windows if w.end + _KEPT_NS >= stamp]
