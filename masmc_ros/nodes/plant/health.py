# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The plant's report on /diagnostics."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
import time

from masmc_ros.nodes.process.diagnostics import Health, OK, senders, WARN
from masmc_ros.nodes.process.refusals import Refusals
from masmc_ros.plant.lateness import Lateness
from rclpy.node import Node

_SLIPS = 0.05
"""Speed in m/s from which a wheel slips; below it creeps."""


class PlantHealth:
    """Changes between two reports, and the text of the report."""

    def __init__(self, period: float, lateness: Lateness) -> None:
        """Initialise with the control period in s and the counts of late ticks."""
        self._period, self._lateness = period, lateness
        self._since = time.monotonic()
        self._tick = 0
        self._problems = 0

    def report(
        self,
        node: Node,
        topics: Sequence[str],
        refusals: Refusals,
        *,
        state: str,
        ticks: int,
        dropped: int,
        command_age: float,
        slip: float | None,
    ) -> Health:
        """Return the report; `topics` are those of commands, `slip` is in m/s."""
        now = time.monotonic()
        seconds = max(now - self._since, 1e-9)
        rate = max(0, ticks - self._tick) / seconds
        late_figures, lateness = self._lateness.report(seconds)
        self._since, self._tick = now, ticks
        values = {
            'state': state,
            'rate (1/s)': f'{rate:.1f}',
            'times real time': f'{rate * self._period:.3f}',
            'tick': str(ticks),
            'last command (s ago)': f'{command_age:.3f}',
            'dropped commands': str(dropped),
            **late_figures,
            **{f'{topic} refused': str(count) for topic, count in refusals.counts.items()},
        }
        if slip is not None:
            values['fastest slip of a wheel (m/s)'] = f'{slip:.4f}'
        problems = sum(refusals.counts.values()) + dropped
        is_worse, self._problems = problems > self._problems, problems
        crowds = [each for each in (senders(node, topic) for topic in topics) if len(each) > 1]
        if crowds:
            values['senders of commands'] = ', '.join(chain.from_iterable(crowds))
            return Health(WARN, 'more than one node commands the robot', values)
        if lateness:
            return Health(WARN, lateness, values)
        if is_worse:
            return Health(WARN, 'commands refused or dropped', values)
        if slip is not None and slip > _SLIPS:
            return Health(WARN, 'wheels slip', values)
        return Health(OK, state, values)
