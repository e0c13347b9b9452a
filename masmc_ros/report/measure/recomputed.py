# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Comparison of a recomputed run with its log, bit by bit."""

from __future__ import annotations

from masmc_ros.log.read.decode import Series
from masmc_ros.log.read.reader import Run
from masmc_ros.loop.tick_block import TickBlock
from masmc_ros.loop.timing import Timing
from masmc_ros.messages.cdr_layout import NANOSECONDS
import numpy as np
from numpy.typing import NDArray


class Recomputed:
    """Comparison of blocks of a computed run with the states and commands of a log."""

    def __init__(self, run: Run) -> None:
        """Initialise the comparison with the logged run."""
        self._run = run
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

    def counts(self) -> dict[str, int]:
        """Return the numbers of logged and of identical states and commands."""
        run = self._run
        return {
            'states': len(self._states),
            'identical_states': self._same['states'],
            'commands': len(run.cmd_vel) + len(run.arm_rates) + len(run.torque),
            'identical_commands': self._same['commands'],
        }

    def verdict(self, *, is_changed: bool) -> str:
        """Return the result in one line; `is_changed` if parameters differ from the log's."""
        logged, states, sent, commands = self.counts().values()
        total = f'{logged} states and {sent} commands'
        if states == logged and commands == sent:
            return f'recomputed: all {total} of {self._run.path} are bitwise identical'
        # Different settings give a different run.
        reason = ' with other parameters' if is_changed else ''
        where = 'outside the ticks of the run'
        if self._first is not None:
            where = f'first {self._first[1]} at t = {self._first[0] / NANOSECONDS:.3f} s'
        return (
            f'recomputed{reason}: {states} states and {commands} commands of the {total} of'
            f' {self._run.path} are bitwise identical; the others differ, {where}'
        )

    def _compare(
        self,
        what: str,
        logged: Series,
        stamps: NDArray[np.int64],
        computed: NDArray[np.float64],
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
