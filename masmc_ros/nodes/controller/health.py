# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Report of the controller on /diagnostics: times of ticks, limited torques, ages of states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math
import time

from masmc_ros.control.controller_core import ControllerCore
from masmc_ros.control.gates import outdated_latency
from masmc_ros.loop.controller import Controller
from masmc_ros.nodes.controller.output import CommandOutput
from masmc_ros.nodes.process.base import ERROR, Health, OK, RejectedMessages, senders, WARN
import numpy as np
from rclpy.clock import Clock, ROSClock
from rclpy.node import Node


class TickTimes:
    """
    Durations of ticks.

    Attributes
    ----------
    total
        Number of ticks.
    overruns
        Number of ticks that took longer than a period.

    """

    def __init__(self, period: float) -> None:
        """Initialise with the control period in s."""
        self._period = period
        self._since = time.monotonic()
        self._counted = 0
        self._longest = self._sum = 0.0
        self.total = 0
        self.overruns = 0

    def add(self, duration: float) -> None:
        """Count a tick that took `duration` s."""
        self.total += 1
        self._sum += duration
        if duration > self._longest:
            self._longest = duration
        if duration > self._period:
            self.overruns += 1

    def report(self) -> dict[str, str]:
        """Return rate, mean and longest tick since the last report, and the total overruns."""
        now = time.monotonic()
        count = self.total - self._counted
        rate = count / max(now - self._since, 1e-9)
        report = {
            'rate (1/s)': f'{rate:.1f}',
            'mean tick (ms)': f'{1e3 * self._sum / max(count, 1):.3f}',
            'longest tick (ms)': f'{1e3 * self._longest:.3f}',
            'overruns': str(self.overruns),
        }
        self._since, self._counted = now, self.total
        self._longest = self._sum = 0.0
        return report


class Saturation:
    """Counts of ticks between two reports."""

    def __init__(self, joints: Sequence[str]) -> None:
        """Initialise the counts for joints of these names."""
        self._joints = joints
        self._ticks = self._limited = 0
        self._limited_by_joint = np.zeros(len(joints), np.int64)

    def add(self, controller: Controller) -> None:
        """Count a computed tick."""
        self._ticks += 1
        if controller.has_limits:
            is_limited = controller.torque != controller.raw_torque
            self._limited_by_joint += is_limited
            self._limited += bool(is_limited.any())

    def report(self) -> dict[str, str]:
        """Return the shares since the last report, in total and by joint; restart the counts."""
        ticks = max(self._ticks, 1)
        joints = [
            f'{joint} {count / ticks:.0%}'
            for joint, count in zip(self._joints, self._limited_by_joint.tolist(), strict=True)
            if count
        ]
        report = {
            'ticks with limited torque': f'{self._limited / ticks:.1%}',
            'joints with limited torque': ', '.join(joints) or 'none',
        }
        self._ticks = self._limited = 0
        self._limited_by_joint[:] = 0
        return report


_SAME_CLOCK = 1e3
"""Largest difference in s between a stamp and the node's time if both have the same clock."""

_SKIPPED_SHARE = 0.05
"""Share of control periods without a separate command above which a warning is reported."""

_SILENCE = 1.0
"""Time in s without a usable state after which an active controller reports a warning."""

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
        self._had_others = False

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
        sources: str,
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
        sources
            Inputs with more than one sender, '' without such.

        """
        supervisor, controller, counts = core.supervisor, core.controller, core.states.counts
        has_state = core.states.arrival < math.inf
        silence = max(0.0, time.monotonic() - core.states.arrival) if has_state else math.inf
        values = {
            'state': supervisor.text,
            **self._ticks.report(),
            'ticks': str(self._ticks.total),
            'last state (s ago)': f'{silence:.3f}' if has_state else 'none',
            'late states': str(counts.late),
            'repeated states': str(counts.repeated),
            'gaps in states': str(counts.gaps),
            'periods without a command of their own': str(counts.skipped),
            '|e| on any axis, largest': f'{self._largest_error:.6g}',
            '|s| (m/s)': f'{float(np.linalg.norm(controller.surface)):.6g}',
            '|theta_hat|': f'{float(np.linalg.norm(controller.estimate)):.6g}',
            **self._saturation.report(),
            'ticks with torque changed by joint limits': str(controller.limited_ticks),
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
        if sources:
            values['senders of inputs'] = sources
        own_name = node.get_fully_qualified_name()
        others = ''
        for publisher in output.publishers:
            names = senders(node, publisher.topic_name)
            # Another node may have the same name: only one publisher is this node's.
            if own_name in names:
                names.remove(own_name)
            if names:
                others = ' and '.join(names)
                values[f"others on {publisher.topic_name.rpartition('/')[2]}"] = ', '.join(names)
        problems = rejected_messages.total + counts.late + counts.gaps + self._ticks.overruns
        is_worse, self._problems = problems > self._problems, problems
        lateness = self._lateness(counts.skipped)
        if supervisor.is_fault:
            return Health(ERROR, supervisor.text, values)
        if others:
            if not self._had_others:
                node.get_logger().warning(f'another node commands the robot too: {others}')
            self._had_others = True
            return Health(WARN, 'another node commands the robot too', values)
        self._had_others = False
        if sources:
            return Health(WARN, f'more than one sender: {sources}', values)
        if supervisor.is_active and silence > _SILENCE:
            duration = f'for {silence:.1f} s' if has_state else 'so far'
            return Health(WARN, f'no usable {core.missing_source()} {duration}', values)
        if supervisor.is_active and outdated:
            return Health(WARN, outdated, values)
        if supervisor.is_active and lateness:
            return Health(WARN, lateness, values)
        if supervisor.is_active and is_worse:
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
