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

"""What the controller tells of itself on /diagnostics."""

from __future__ import annotations

from collections.abc import Sequence
import math
import time

from masmc_ros.loop.controller import Controller
from masmc_ros.loop.supervisor import ACTIVE, FAULT, Supervisor
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

_MOST_AGES = 100_000
"""States whose ages are kept between two reports."""


class ControllerHealth:
    """
    Counts what happens between two reports, and words the report.

    Attributes
    ----------
    late
        states that came after newer ones and were left out.
    repeated
        states that came again and were answered again.
    gaps
        states that were missing for longer than the timeout.

    """

    def __init__(self, period: float, clock: Clock, joints: Sequence[str]) -> None:
        """Take the control period in s, the node's clock and the driven joints' names."""
        self._ticks = TickTimes(period)
        self._clock = clock
        # Asked once a report: the node's clock takes longer to read than a tick to compute.
        self._is_simulated = _is_simulated(clock)
        self._saturation = Saturation(joints)
        self._ages: list[float] = []
        self._arrival = math.inf
        self._stamp = 0
        self._problems = 0
        self.late = self.repeated = self.gaps = 0

    def saw_state(self, stamp: int) -> None:
        """Note that a usable state of a stamp in ns has come."""
        self._arrival = time.monotonic()
        self._stamp = stamp

    def computed(self, controller: Controller) -> None:
        """Note that the controller has computed a torque."""
        self._saturation.add(controller)

    def answered(self) -> None:
        """Note that the state that came last is answered."""
        self._ticks.add(time.monotonic() - self._arrival)
        now = self._clock.now().nanoseconds if self._is_simulated else time.time_ns()
        age = 1e-9 * (now - self._stamp)
        if abs(age) < _ONE_CLOCK and len(self._ages) < _MOST_AGES:
            self._ages.append(age)

    def silence(self) -> float:
        """Return the time in s since the last usable state, 0 before the first."""
        return max(0.0, time.monotonic() - self._arrival)

    def report(
        self,
        node: Node,
        output: CommandOutput,
        supervisor: Supervisor,
        controller: Controller,
        refusals: Refusals,
    ) -> Health:
        """Return how the controller is."""
        values = {
            'state': supervisor.text,
            **self._ticks.report(),
            'ticks': str(self._ticks.total),
            'last state (s ago)': f'{self.silence():.3f}',
            'late states': str(self.late),
            'repeated states': str(self.repeated),
            'gaps in states': str(self.gaps),
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
        problems = sum(refusals.counts.values()) + self.late + self.gaps + self._ticks.overruns
        is_worse, self._problems = problems > self._problems, problems
        for topic, names in others.items():
            values[f'others on {topic}'] = names
        if supervisor.state == FAULT:
            return Health(ERROR, supervisor.text, values)
        if others:
            return Health(WARN, 'others command the robot too', values)
        if supervisor.state == ACTIVE and is_worse:
            return Health(WARN, 'messages refused or late, or ticks too long', values)
        return Health(OK, supervisor.text, values)


def _is_simulated(clock: Clock) -> bool:
    """Tell whether a node's clock is that of /clock; else it is the system's."""
    return isinstance(clock, ROSClock) and bool(clock.ros_time_is_active)
