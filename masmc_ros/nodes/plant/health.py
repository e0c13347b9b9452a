# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Report of the plant on /diagnostics."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
import time

from masmc_ros.nodes.process.base import ERROR, Health, OK, RejectedMessages, senders, WARN
from masmc_ros.plant.plant_core import Lateness
from rclpy.node import Node

_SLIP_LIMIT = 0.05
"""Speed in m/s above which a wheel slips; a slower contact point only creeps."""


class PlantHealth:
    """Report of the plant, with the changes since the last report."""

    def __init__(self, period: float, lateness: Lateness) -> None:
        """Initialise with the control period in s and the counts of late ticks."""
        self._period, self._lateness = period, lateness
        self._since = time.monotonic()
        self._tick = 0
        self._problems = 0
        self._had_several = False

    def report(
        self,
        node: Node,
        topics: Sequence[str],
        rejected_messages: RejectedMessages,
        *,
        state: str,
        is_over: bool = False,
        ticks: int,
        dropped: int,
        command_age: float,
        slip: float | None,
    ) -> Health:
        """
        Return the report.

        Parameters
        ----------
        node
            Node of the plant.
        topics
            Full names of the command topics.
        rejected_messages
            Counts of rejected messages.
        state
            State of the plant, in a few words.
        is_over
            True if the robot has no finite state.
        ticks
            Tick of the robot.
        dropped
            Number of commands that responded to another state.
        command_age
            Time in s since the last command.
        slip
            Fastest slip in m/s since the last report; None if wheels cannot slip.

        """
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
            **rejected_messages.figures(),
        }
        if slip is not None:
            values['fastest slip of a wheel (m/s)'] = f'{slip:.4f}'
        problems = rejected_messages.total + dropped
        is_worse, self._problems = problems > self._problems, problems
        if is_over:
            return Health(ERROR, state, values)
        all_senders = [senders(node, topic) for topic in topics]
        if any(len(names) > 1 for names in all_senders):
            values['senders of commands'] = text = ', '.join(
                chain.from_iterable(names for names in all_senders if len(names) > 1)
            )
            if not self._had_several:
                node.get_logger().warning(f'more than one node commands the robot: {text}')
            self._had_several = True
            return Health(WARN, 'more than one node commands the robot', values)
        self._had_several = False
        if lateness:
            return Health(WARN, lateness, values)
        if is_worse:
            return Health(WARN, 'commands rejected or dropped', values)
        if slip is not None and slip > _SLIP_LIMIT:
            return Health(WARN, 'wheels slip', values)
        return Health(OK, state, values)
