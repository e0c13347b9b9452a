# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Report of the controller on /diagnostics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import time

from masmc_ros.control.controller_core import ControllerCore
from masmc_ros.control.state_lateness import outdated_latency
from masmc_ros.control.supervisor import ACTIVE, FAULT
from masmc_ros.loop.controller import Controller
from masmc_ros.nodes.controller.command_output import CommandOutput
from masmc_ros.nodes.controller.limited_ticks import Saturation
from masmc_ros.nodes.controller.tick_times import TickTimes
from masmc_ros.nodes.process.diagnostics import ERROR, Health, OK, senders, WARN
from masmc_ros.nodes.process.rejected_messages import RejectedMessages
import numpy as np
from rclpy.clock import Clock, ROSClock
from rclpy.node import Node

_SAME_CLOCK = 1e3
"""Largest difference in s between a stamp and the node's time if both have the same clock."""

_SKIPPED_SHARE = 0.05
"""Share of control periods without a separate command above which a warning is reported."""

_MAX_AGES = 100_000
"""Largest number of ages of states between two reports."""


class ControllerHealth:
    """Report of the controller, with counts since the last report."""

    def __init__(self, period: float, clock: Clock, joints: Sequence[str]) -> None:
        """
        Initialise the counts.

        Parameters
        ----------
        period
            Control period in s.
        clock
            Clock of the node.
        joints
            Names of the driven joints.

        """
        self._ticks = TickTimes(period)
        self._clock = clock
        # Updated once a report: reading the node's clock takes longer than computing a tick.
        self._is_simulated = _is_simulated(clock)
        self._saturation = Saturation(joints)
        self._ages: list[float] = []
        self._problems = self._skipped = self._computed = 0
        self._largest_error = 0.0

    def add_tick(self, controller: Controller) -> None:
        """Count a tick for which the controller has computed a torque."""
        self._saturation.add(controller)
        self._computed += 1
        # For a few numbers Python's comparisons are faster than a call of NumPy.
        self._largest_error = max(self._largest_error, *map(abs, controller.error.tolist()))

    def add_response(self, stamp: int, arrival: float) -> None:
        """Count the response to a state: its stamp in ns, and its monotonic arrival time in s."""
        self._ticks.add(time.monotonic() - arrival)
        now = self._clock.now().nanoseconds if self._is_simulated else time.time_ns()
        age = 1e-9 * (now - stamp)
        if abs(age) < _SAME_CLOCK and len(self._ages) < _MAX_AGES:
            self._ages.append(age)

    def report(
        self,
        node: Node,
        output: CommandOutput,
        core: ControllerCore,
        rejected_messages: RejectedMessages,
        figures: Mapping[str, str],
        wrong_latency: str,
    ) -> Health:
        """
        Return the report and restart the counts.

        Parameters
        ----------
        node
            Node of the controller.
        output
            Publishers of the commands.
        core
            State machine of the controller.
        rejected_messages
            Counts of rejected messages.
        figures
            Further figures by name.
        wrong_latency
            Warning about a latency that differs from that of the efforts, '' without one.

        """
        supervisor, controller, counts = core.supervisor, core.controller, core.counts
        silence = max(0.0, time.monotonic() - core.arrival)
        values = {
            'state': supervisor.text,
            **self._ticks.report(),
            'ticks': str(self._ticks.total),
            'last state (s ago)': f'{silence:.3f}',
            'late states': str(counts.late),
            'repeated states': str(counts.repeated),
            'gaps in states': str(counts.gaps),
            'periods without a command of their own': str(counts.skipped),
            '|e| on any axis, largest': f'{self._largest_error:.6g}',
            '|s| (m/s)': f'{float(np.linalg.norm(controller.surface)):.6g}',
            '|theta_hat|': f'{float(np.linalg.norm(controller.estimate)):.6g}',
            **self._saturation.report(),
            **output.figures(),
            **rejected_messages.figures(),
            **figures,
        }
        self._is_simulated = _is_simulated(self._clock)
        outdated = wrong_latency
        if self._ages:
            mean = sum(self._ages) / len(self._ages)
            outdated = outdated or outdated_latency(controller, mean)
            values['age of answered states, mean (ms)'] = f'{1e3 * mean:.3f}'
            values['age of answered states, most (ms)'] = f'{1e3 * max(self._ages):.3f}'
            self._ages.clear()
        own_name = node.get_fully_qualified_name()
        has_others = False
        for publisher in output.publishers:
            names = senders(node, publisher.topic_name)
            # Another node may have the same name: only one publisher is this node's.
            if own_name in names:
                names.remove(own_name)
            if names:
                has_others = True
                values[f"others on {publisher.topic_name.rpartition('/')[2]}"] = ', '.join(names)
        problems = rejected_messages.total + counts.late + counts.gaps + self._ticks.overruns
        is_worse, self._problems = problems > self._problems, problems
        lateness = self._lateness(counts.skipped)
        if supervisor.state == FAULT:
            return Health(ERROR, supervisor.text, values)
        if has_others:
            return Health(WARN, 'another node commands the robot too', values)
        if supervisor.state == ACTIVE and outdated:
            return Health(WARN, outdated, values)
        if supervisor.state == ACTIVE and lateness:
            return Health(WARN, lateness, values)
        if supervisor.state == ACTIVE and is_worse:
            return Health(WARN, 'messages rejected or late, or ticks too long', values)
        return Health(OK, supervisor.text, values)

    def _lateness(self, skipped: int) -> str:
        """Return a warning about periods that were skipped since the last report, '' if few."""
        count, self._skipped = skipped - self._skipped, skipped
        total, self._computed = count + self._computed, 0
        error, self._largest_error = self._largest_error, 0.0
        if count <= _SKIPPED_SHARE * total:
            return ''
        return (
            f'{count} of {total} control periods had no command of their own: their torque is '
            f'that of an earlier state, and |e| reached {error:.3g}; use a longer control_period, '
            'or publish fewer messages (telemetry_decimation, tf_decimation)'
        )


def _is_simulated(clock: Clock) -> bool:
    """Return True if a node's clock uses /clock instead of the system clock."""
    return isinstance(clock, ROSClock) and bool(clock.ros_time_is_active)
