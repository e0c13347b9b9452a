# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The controller's report on /diagnostics."""

from __future__ import annotations

from collections.abc import Sequence
import time

from masmc_ros.control.core import ControllerCore
from masmc_ros.control.supervisor import ACTIVE, FAULT
from masmc_ros.loop.controller import Controller
from masmc_ros.nodes.controller.command_output import CommandOutput
from masmc_ros.nodes.controller.saturation import Saturation
from masmc_ros.nodes.controller.tick_times import TickTimes
from masmc_ros.nodes.process.diagnostics import ERROR, Health, OK, senders, WARN
from masmc_ros.nodes.process.refusals import Refusals
import numpy as np
from rclpy.clock import Clock, ROSClock
from rclpy.node import Node

_ONE_CLOCK = 1e3
"""Stamps within so many s of the node's time are on its clock; others are on another one."""

_SKIPPED_SHARE = 0.05
"""Share of control periods without a command of their own that is reported as a warning."""

_MOST_AGES = 100_000
"""States whose ages are kept between two reports."""


class ControllerHealth:
    """Counts what happens between two reports, and words the report."""

    def __init__(self, period: float, clock: Clock, joints: Sequence[str]) -> None:
        """Take the control period in s, the node's clock and the driven joints' names."""
        self._ticks = TickTimes(period)
        self._clock = clock
        # Asked once a report: the node's clock takes longer to read than a tick to compute.
        self._is_simulated = _is_simulated(clock)
        self._saturation = Saturation(joints)
        self._ages: list[float] = []
        self._problems = self._skipped = self._computed = 0
        self._largest_error = 0.0

    def computed(self, controller: Controller) -> None:
        """Note that the controller has computed a torque."""
        self._saturation.add(controller)
        self._computed += 1
        # Python's own numbers: a few of them are compared faster than NumPy starts to.
        self._largest_error = max(self._largest_error, *map(abs, controller.error.tolist()))

    def answered(self, stamp: int, arrival: float) -> None:
        """Note that a state of a stamp in ns that has come at a steady time in s is answered."""
        self._ticks.add(time.monotonic() - arrival)
        now = self._clock.now().nanoseconds if self._is_simulated else time.time_ns()
        age = 1e-9 * (now - stamp)
        if abs(age) < _ONE_CLOCK and len(self._ages) < _MOST_AGES:
            self._ages.append(age)

    def report(
        self,
        node: Node,
        output: CommandOutput,
        core: ControllerCore,
        refusals: Refusals,
    ) -> Health:
        """Return how the controller is."""
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
            **{f'{topic} refused': str(count) for topic, count in refusals.counts.items()},
        }
        self._is_simulated = _is_simulated(self._clock)
        if self._ages:
            mean = sum(self._ages) / len(self._ages)
            values['age of answered states, mean (ms)'] = f'{1e3 * mean:.3f}'
            values['age of answered states, most (ms)'] = f'{1e3 * max(self._ages):.3f}'
            self._ages.clear()
        me = node.get_fully_qualified_name()
        others = {}
        for publisher in output.publishers:
            found = senders(node, publisher.topic_name)
            if me in found:
                found.remove(me)
            if found:
                others[publisher.topic_name.rpartition('/')[2]] = ', '.join(found)
        problems = sum(refusals.counts.values()) + counts.late + counts.gaps + self._ticks.overruns
        is_worse, self._problems = problems > self._problems, problems
        lateness = self._lateness(counts.skipped)
        for topic, names in others.items():
            values[f'others on {topic}'] = names
        if supervisor.state == FAULT:
            return Health(ERROR, supervisor.text, values)
        if others:
            return Health(WARN, 'others command the robot too', values)
        if supervisor.state == ACTIVE and lateness:
            return Health(WARN, lateness, values)
        if supervisor.state == ACTIVE and is_worse:
            return Health(WARN, 'messages refused or late, or ticks too long', values)
        return Health(OK, supervisor.text, values)

    def _lateness(self, skipped: int) -> str:
        """Return what late states and ticks cost since the last report; empty for little."""
        count, self._skipped = skipped - self._skipped, skipped
        total, self._computed = count + self._computed, 0
        error, self._largest_error = self._largest_error, 0.0
        if count <= _SKIPPED_SHARE * total:
            return ''
        return (
            f'{count} of {total} control periods had no command of their own: their torque is '
            f'that of an earlier state, and |e| reached {error:.3g}; use a longer control_period, '
            'or publish less (telemetry_decimation, tf_decimation)'
        )


def _is_simulated(clock: Clock) -> bool:
    """Return True if a node's clock follows /clock; else it is the system's."""
    return isinstance(clock, ROSClock) and bool(clock.ros_time_is_active)
