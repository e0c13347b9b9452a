# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Whether a run that was computed again is the one in the log, bit for bit."""

from __future__ import annotations

from masmc_ros.log.read.reader import Run
from masmc_ros.loop.stretch import Stretch
from masmc_ros.loop.timing import Timing
from masmc_ros.messages.layout import NANOSECONDS
import numpy as np
from numpy.typing import NDArray


class Recomputed:
    """Compares stretches of a computed run with the states and commands of a log."""

    def __init__(self, run: Run) -> None:
        """Take the logged run."""
        self._run = run
        self._states = _stamps(run.times)
        self._torques = _stamps(run.torque.times)
        self._twists, self._arm_rates = _stamps(run.cmd_vel.times), _stamps(run.arm_rates.times)
        self._same = {'states': 0, 'commands': 0}
        self._first: tuple[int, str] | None = None

    def compare(self, stretch: Stretch, timing: Timing) -> None:
        """Compare consecutive ticks; to be called for all of them in turn."""
        first = stretch.first
        stamps = np.array(
            [timing.stamp(tick) for tick in range(first, first + len(stretch))], np.int64
        )
        run = self._run
        logged = np.hstack([run.position, run.velocity, run.applied_effort])
        computed = np.hstack([stretch.position, stretch.velocity, stretch.applied])
        self._compare('states', self._states, logged, stamps, computed)
        if stretch.commands_rates:
            base, own = np.hsplit(stretch.rates, [len(run.mechanism.twist)])
            self._compare('commands', self._twists, run.cmd_vel.values, stamps, base)
            self._compare('commands', self._arm_rates, run.arm_rates.values, stamps, own)
        else:
            self._compare('commands', self._torques, run.torque.values, stamps, stretch.torque)

    def verdict(self, *, set_anew: bool) -> str:
        """Return one line on what was found; `set_anew` where other parameters were set."""
        states, commands = self._same['states'], self._same['commands']
        sent = len(self._torques)
        if self._run.commands_rates:
            sent = len(self._twists) + len(self._arm_rates)
        total = f'{len(self._states)} states and {sent} commands'
        if states == len(self._states) and commands == sent:
            return f'computed again: all {total} of {self._run.path} are the same bits'
        # Whoever sets something else expects another run.
        reason = ' with other parameters' if set_anew else ''
        where = 'outside the ticks of the run'
        if self._first is not None:
            where = f'first {self._first[1]} at t = {self._first[0] / NANOSECONDS:.3f} s'
        return (
            f'computed again{reason}: {states} states and {commands} commands of the {total} of'
            f' {self._run.path} are the same bits; the others differ, {where}'
        )

    def _compare(
        self,
        what: str,
        logged_stamps: NDArray[np.int64],
        logged: NDArray[np.float64],
        stamps: NDArray[np.int64],
        computed: NDArray[np.float64],
    ) -> None:
        _, mine, theirs = np.intersect1d(stamps, logged_stamps, return_indices=True)
        same = (
            np.ascontiguousarray(computed[mine]).view(np.int64)
            == np.ascontiguousarray(logged[theirs]).view(np.int64)
        ).all(axis=1)
        self._same[what] += int(same.sum())
        if not same.all():
            stamp = int(stamps[mine[np.argmin(same)]])
            if self._first is None or stamp < self._first[0]:
                self._first = stamp, what


def _stamps(times: NDArray[np.float64]) -> NDArray[np.int64]:
    return np.rint(times * NANOSECONDS).astype(np.int64)
