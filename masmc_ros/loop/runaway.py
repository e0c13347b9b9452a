# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Detection of a robot that runs away under its controller.

Three independent rules; none had a false alarm in 56 ordinary runs of three robots:

* reversals: over 0.1 s (at least 10 ticks) the torque of one joint is at its limit on at least
  half of the ticks, and the limited side changes at least four times;
* growth: over 0.2 s the torque of one joint is at its limit on at least half of the ticks, and
  the norm of the error grows by more than 20 % and 0.01;
* speed: a joint is faster than 1.2 times its speed limit.

The first two rules need continuous control: they restart after 0.1 s without a tick. On a machine
that is late again and again, the robot leaves its path though the loop is stable. An alarm of
these rules within 1 s after late states therefore passes, unless it is the third one in 10 s.
The law then continues when states have been on time for 0.5 s: at once, the same burst of late
states would raise the next alarm.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
import math
from typing import NamedTuple

from masmc_ros.aliases import Array, Integers
from masmc_ros.jit.compiled import bound, kernel
from masmc_ros.law.parts.joint_limits import TORQUE_LIMIT
from masmc_ros.loop.controller import Controller
import numpy as np

REVERSALS, GROWTH, SPEED = 1, 2, 3
"""Rules, as numbers of the compiled check; 0 is no alarm."""

_REVERSAL_TIME, _FEWEST_TICKS = 0.1, 10
_FEWEST_REVERSALS = 4
_GROWTH_TIME = 0.2
_GROWTH, _GROWTH_MARGIN = 1.2, 0.01
_SPEED_MARGIN = 1.2

_LATE = 0.02
"""Time in s by which a machine is late: a torque is held longer, or a state is older."""

_AFTER_LATE = 1.0
"""Time in s after late states within which their effect on the error ends."""

_PASSING, _TOGETHER = 2, 10.0
"""Largest number of alarms that pass, and the time in s after which they are forgotten."""


_REST = 0.5
"""Time in s without late states after which the law continues."""


class Alarm(NamedTuple):
    """Detected run-away."""

    reason: str
    is_passing: bool
    """True if late states may be the cause, so that control may continue."""


@kernel
def _look(
    tick: int,
    torque: Array,
    limit: Array,
    error: Array,
    rates: Array,
    speed: Array,
    sides: Integers,
    flips: Integers,
    last_side: Integers,
    limited: Integers,
    reversals: Integers,
    norms: Array,
    short: int,
) -> int:
    """
    Add one tick to the windows; return 100 times the joint plus the rule, or 0.

    `sides` and `flips` (window, joints) are rings of the limited side (-1, 0, 1) and of its
    changes; `limited` (2, joints) counts limited ticks of the short and of the long window.
    """
    window = len(sides)
    place, leaving = tick % window, (tick - short) % window
    total = 0.0
    for value in error:
        total += value * value
    norm = np.sqrt(total)
    before = norms[place]
    norms[place] = norm
    alarm = 0
    for joint in range(len(torque)):
        if tick >= short:
            limited[0, joint] -= abs(sides[leaving, joint])
            reversals[joint] -= flips[leaving, joint]
        if tick >= window:
            limited[1, joint] -= abs(sides[place, joint])
        bound = limit[joint]
        side = 0
        if bound > 0.0 and abs(torque[joint]) >= bound:
            side = 1 if torque[joint] > 0.0 else -1
        flip = 1 if side != 0 and side == -last_side[joint] else 0
        if side != 0:
            last_side[joint] = side
        sides[place, joint], flips[place, joint] = side, flip
        limited[0, joint] += abs(side)
        limited[1, joint] += abs(side)
        reversals[joint] += flip
        if abs(rates[joint]) > _SPEED_MARGIN * speed[joint]:
            alarm = 100 * joint + SPEED
        elif 2 * limited[0, joint] >= short and reversals[joint] >= _FEWEST_REVERSALS:
            alarm = 100 * joint + REVERSALS
        elif (
            tick >= window
            and 2 * limited[1, joint] >= window
            and norm > _GROWTH * before + _GROWTH_MARGIN
        ):
            alarm = 100 * joint + GROWTH
    return alarm


class RunawayWatch:
    """Monitor that checks every computed tick for a run-away."""

    def __init__(self, controller: Controller, speed_limits: Sequence[float]) -> None:
        """
        Initialise the watch.

        Parameters
        ----------
        controller
            Controller whose torque, error and limits are watched.
        speed_limits
            Speed limit of each joint (joints), rad/s or m/s; infinite without a limit.

        """
        joints, period = len(controller.torque), controller.period
        self._controller = controller
        self._speed = np.asarray(speed_limits, np.float64)
        self._short = max(_FEWEST_TICKS, round(_REVERSAL_TIME / period))
        window = max(self._short, round(_GROWTH_TIME / period))
        self._sides, self._flips = np.zeros((2, window, joints), np.int64)
        self._last_side = np.zeros(joints, np.int64)
        self._limited = np.zeros((2, joints), np.int64)
        self._reversals = np.zeros(joints, np.int64)
        self._norms = np.zeros(window)
        self._limit = np.zeros(joints)
        self._tick = 0
        self._late_at = self._continues_at = -math.inf
        self._passed: deque[float] = deque(maxlen=_PASSING)
        self._windows = (
            self._speed, self._sides, self._flips, self._last_side, self._limited,
            self._reversals, self._norms, self._short,
        )  # fmt: skip
        self.restart()
        # Compiled or loaded before the first tick, and called without a check of types at each.
        self._kernel = bound(_look, *self._arguments(np.zeros(joints)))

    def restart(self) -> None:
        """Clear the windows: the law, its limits or its activation changed."""
        self._limit[:] = TORQUE_LIMIT.of(self._controller.values)
        for array in (
            self._sides, self._flips, self._last_side, self._limited, self._reversals, self._norms
        ):
            array[:] = 0
        self._tick = 0

    def skip(self, periods: int, now: float) -> None:
        """
        Account for periods in which the last torque was held, at the time `now` in s.

        The robot moved without control in these periods. After too many the windows are cleared.
        """
        if periods >= self._short:
            self.restart()
        if periods * self._controller.period >= _LATE:
            self.note_late(now)

    def note_age(self, lateness: float, now: float) -> None:
        """Note by how many seconds a state is older than the mean, at the time `now` in s."""
        if lateness >= _LATE:
            self.note_late(now)

    def note_late(self, now: float) -> None:
        """Note that states were late or missing until the time `now` in s."""
        self._late_at = now
        if not self.may_continue(now):
            self._continues_at = now + _REST

    def may_continue(self, now: float) -> bool:
        """Return False soon after an alarm that passes, at the time `now` in s."""
        return now >= self._continues_at

    def look(self, rates: Array, now: float) -> Alarm | None:
        """
        Return an alarm after a computed tick; None without one.

        Parameters
        ----------
        rates
            Measured or estimated joint velocities (joints) of the tick.
        now
            Time in s.

        """
        alarm = self._kernel(*self._arguments(rates))
        self._tick += 1
        if not alarm:
            return None
        reason = self._reason(alarm, rates)
        is_sudden = alarm % 100 != SPEED and now - self._late_at < _AFTER_LATE
        # The older of the last two; there is none before the second alarm.
        is_often = len(self._passed) == _PASSING and now - self._passed[0] < _TOGETHER
        if not is_sudden or is_often:
            return Alarm(reason, is_passing=False)
        self._passed.append(now)
        self._continues_at = now + _REST
        return Alarm(f'{reason}; states were late', is_passing=True)

    def _arguments(self, rates: Array) -> tuple[object, ...]:
        controller = self._controller
        return (
            self._tick, controller.torque, self._limit, controller.error, rates, *self._windows
        )  # fmt: skip

    def _reason(self, alarm: int, rates: Array) -> str:
        joint, rule = divmod(alarm, 100)
        name = self._controller.mechanism.joints[joint].name
        unit = self._controller.mechanism.joints[joint].unit
        if rule == SPEED:
            return (
                f'run-away: {name} moves at {abs(rates[joint]):.3g} {unit}/s; its limit is '
                f'{self._speed[joint]:.3g} {unit}/s'
            )
        if rule == REVERSALS:
            return (
                f'run-away: the torque of {name} changed between its limits '
                f'{self._reversals[joint]} times in {self._short * self._controller.period:.3g} s'
            )
        return (
            f'run-away: the error grows to {self._norms[(self._tick - 1) % len(self._norms)]:.3g} '
            f'while the torque of {name} is at its limit'
        )
