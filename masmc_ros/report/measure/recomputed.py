# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Comparison of a recomputed run with its log, bit by bit, and the responses of real time."""

from __future__ import annotations

from masmc_ros.aliases import Array, Stamps
from masmc_ros.log.read.decode import Series
from masmc_ros.log.read.gaps import gaps_in
from masmc_ros.log.read.reader import Run
from masmc_ros.loop.plant_parameters import TORQUE_LIMIT
from masmc_ros.loop.records import is_compensated
from masmc_ros.loop.scenario import Scenario
from masmc_ros.loop.simulation import Responses
from masmc_ros.loop.tick_block import TickBlock
from masmc_ros.loop.timing import CONTROL_PERIOD, PACING, Timing
from masmc_ros.messages.cdr_layout import NANOSECONDS
import numpy as np

_MOST_LATE = 20
"""Largest number of commands that are newer than the one that acts, in real time."""


def logged_responses(run: Run, scenario: Scenario) -> Responses | None:
    """
    Return the responses of the controller of a run in real time, None for one in lock-step.

    A command acts at the state after its own, or later if it was late. Of the last commands before
    a state, the newest one with the torques that the plant has logged is the one that acted. With
    drives whose torques differ from their commands, no command is taken as late, nor is one before
    a state that the log lacks.

    Parameters
    ----------
    run
        Logged run.
    scenario
        Scenario with which the run is computed.

    """
    plant, controller = scenario.plant, run.parameters['controller']
    period = CONTROL_PERIOD.of(plant)
    if controller.get(PACING.name) != 'realtime' or CONTROL_PERIOD.of(controller) != period:
        return None
    ticks = np.rint(run.times / period).astype(np.int64)
    count = int(ticks[-1]) + 1
    computed = np.zeros(count, dtype=np.bool_)
    for series in (run.torque, run.cmd_vel, run.arm_rates):
        answered = np.rint(series.times / period).astype(np.int64)
        computed[answered[(answered >= 0) & (answered < count)]] = True
    latest = np.maximum.accumulate(np.where(computed, np.arange(count), -1))
    torques, applied = np.full((2, count, run.applied_effort.shape[1]), np.nan)
    limits = np.array(TORQUE_LIMIT.of(plant))
    limits[limits == 0.0] = np.inf
    if len(run.torque):
        answered = np.rint(run.torque.times / period).astype(np.int64)
        is_inside = (answered >= 0) & (answered < count)
        torques[answered[is_inside]] = np.clip(run.torque.values[is_inside], -limits, limits)
    is_later = ticks > 0
    applied[ticks[is_later] - 1] = run.applied_effort[is_later]
    acting = latest.copy()
    is_known = ~np.isnan(applied).any(axis=1)
    is_late = is_known & (torques[latest] != applied).any(axis=1) & (latest > 0)
    if 2 * np.count_nonzero(is_late) < np.count_nonzero(is_known):
        for tick in np.flatnonzero(is_late):
            earlier = latest[tick]
            for _ in range(_MOST_LATE):
                earlier = latest[earlier - 1] if earlier > 0 else -1
                if earlier < 0 or (torques[earlier] == applied[tick]).all():
                    break
            if earlier >= 0 and (torques[earlier] == applied[tick]).all():
                acting[tick] = earlier
    return Responses(computed, acting)


class Recomputed:
    """Comparison of blocks of a computed run with the states and commands of a log."""

    def __init__(self, run: Run, responses: Responses | None = None) -> None:
        """Initialise the comparison with the logged run, and its responses in real time."""
        self._run, self._responses = run, responses
        stamps = np.rint(run.times * NANOSECONDS).astype(np.int64)
        self._states = Series(stamps, np.hstack([run.position, run.velocity, run.applied_effort]))
        self._same = {'states': 0, 'commands': 0}
        self._first: tuple[int, str] | None = None

    def compare(self, tick_block: TickBlock, timing: Timing) -> None:
        """Compare a block of ticks; called for all blocks in their order."""
        first = tick_block.first
        stamps = np.array(
            [timing.stamp(tick) for tick in range(first, first + len(tick_block))], np.int64
        )
        run = self._run
        computed = np.hstack([tick_block.position, tick_block.velocity, tick_block.applied])
        self._compare('states', self._states, stamps, computed)
        if tick_block.commands_rates:
            base, own = np.hsplit(tick_block.rates, [len(run.mechanism.twist)])
            self._compare('commands', run.cmd_vel, stamps, base)
            self._compare('commands', run.arm_rates, stamps, own)
        else:
            self._compare('commands', run.torque, stamps, tick_block.torque)
            # The other topic of a hybrid interface.
            base = tick_block.rates[:, :len(run.mechanism.twist)]
            self._compare('commands', run.cmd_vel, stamps, base)

    def counts(self) -> dict[str, int | float | None]:
        """
        Return the numbers of logged and of identical states and commands.

        `first_difference` is the stamp in s of the first one that differs, None if none does.
        """
        run = self._run
        return {
            'first_difference': None if self._first is None else self._first[0] / NANOSECONDS,
            'states': len(self._states),
            'identical_states': self._same['states'],
            'commands': len(run.cmd_vel) + len(run.arm_rates) + len(run.torque),
            'identical_commands': self._same['commands'],
        }

    def verdict(self, *, is_changed: bool) -> str:
        """Return the result in one line; `is_changed` if parameters differ from the log's."""
        states, commands = self._same['states'], self._same['commands']
        logged, sent = self.counts()['states'], self.counts()['commands']
        total = f'{logged} states and {sent} commands'
        if states == logged and commands == sent:
            return f'recomputed: all {total} of {self._run.path} are bitwise identical'
        # Different settings give a different run.
        reason = ' with other parameters' if is_changed else ''
        where = 'outside the ticks of the run'
        if self._first is not None:
            where = f'first {self._first[1]} at t = {self._first[0] / NANOSECONDS:.3f} s'
        if self._responses is not None:
            where += f'; {self._lacking(self._first)}'
        return (
            f'recomputed{reason}: {states} states and {commands} commands of the {total} of'
            f' {self._run.path} are bitwise identical; the others differ, {where}'
        )

    def _lacking(self, first: tuple[int, str] | None) -> str:
        """Return what a log in real time lacks for its recomputation, by its first difference."""
        start = self._states.stamps[0] / NANOSECONDS
        if start > 0.0:
            return f'the log lacks the states before its first one at t = {start:.3f} s'
        gaps = gaps_in(self._states.stamps)
        if gaps.count:
            return f'the log lacks states, and commands that acted with them: {gaps.text()}'
        if is_compensated(self._run.parameters['controller']):
            return 'the log lacks the lateness by which the controller compensates latency'
        if first is None or first[1] == 'commands':
            return 'a controller that ends or loses states sends commands between them'
        return 'in real time the log lacks when late commands reach drives with delays, and halts'

    def _compare(
        self,
        what: str,
        logged: Series,
        stamps: Stamps,
        computed: Array,
    ) -> None:
        _, mine, theirs = np.intersect1d(stamps, logged.stamps, return_indices=True)
        same = (
            np.ascontiguousarray(computed[mine]).view(np.int64)
            == np.ascontiguousarray(logged.values[theirs]).view(np.int64)
        ).all(axis=1)
        self._same[what] += int(same.sum())
        if not same.all():
            stamp = int(stamps[mine[np.argmin(same)]])
            if self._first is None or stamp < self._first[0]:
                self._first = stamp, what
