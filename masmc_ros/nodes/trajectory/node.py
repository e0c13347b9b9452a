# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The trajectory node: windows of the reference, sent ahead of the robot's time."""

from __future__ import annotations

import sys

from masmc_ros.control.supervisor import would_follow
from masmc_ros.errors import InputError
from masmc_ros.log.traced_paths import DesiredPath
from masmc_ros.loop.timing import Timing
from masmc_ros.messages.cdr_layout import checked_stamp
from masmc_ros.messages.names import DESIRED_PATH_TOPIC
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.nodes.middleware.messages import deserialized
from masmc_ros.nodes.middleware.past import subscribe_with_past
from masmc_ros.nodes.process.base import SuiteNode
from masmc_ros.nodes.process.command_line import CommandLine
from masmc_ros.nodes.process.rejected_messages import RejectedMessages
from masmc_ros.nodes.process.runtime import run
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.robot.joint_names import check_frame_prefix
from masmc_ros.robot.robot import robot_of
from nav_msgs.msg import Odometry, Path
from rclpy.context import Context
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

_CHECKED_AHEAD = 60.0
"""Length of an endless path in s that is checked at the start."""

_MOST_AHEAD = 500
"""Largest number of windows ahead; a controller stores 1000."""

_MAX_CHECKED = 2_000_000
"""Largest number of ticks that are checked at the start; later ones are checked when sent."""


class TrajectoryNode(SuiteNode):
    """Node that publishes the reference up to the horizon ahead of the robot's time."""

    name = 'trajectory'

    def __init__(self, *, context: Context, command_line: CommandLine) -> None:
        """Create the trajectory; InputError if the robot cannot reach it."""
        super().__init__(context=context, command_line=command_line)
        self._timing = Timing.from_values(self.values)
        period = self._timing.period
        robot = robot_of(self.values)
        self._trajectory = Trajectory(self.values, period, robot)
        prefix = check_frame_prefix(self.values['frame_prefix'])
        self._path = DesiredPath(self._timing, robot, prefix)
        self._window = max(2, round(self.values['window'] / period))
        self._horizon = max(self._window, round(self.values['horizon'] / period))
        if self._horizon > _MOST_AHEAD * self._window:
            raise InputError(
                f'horizon = {self.values["horizon"]:g}, window = {self.values["window"]:g}: '
                f'{self._horizon // self._window} windows ahead; expected at most {_MOST_AHEAD}, '
                'with a longer window or a shorter horizon'
            )
        ticks_ahead = max(self._horizon + self._window, self._timing.last or 0)
        self._ahead_ns = self._timing.stamp(ticks_ahead)
        self._next = 0
        start = self.values['start_time']
        self._origin = round(1e9 * start) if start >= 0.0 else None
        self._is_relative = self._origin is None
        self._was_before = False
        self._is_activated = False
        self._last_tick: int | None = None
        self._rejected_messages = RejectedMessages(self.log)
        self._check_reach()

    def connect(self) -> None:
        """Publish the first windows, and subscribe to the robot's time."""
        super().connect()
        # A late-joining controller needs the windows around the current time, not all past ones.
        depth = 4 + 2 * (self._horizon // self._window)
        self._publisher = self.publisher(Float64MultiArray, 'reference', depth)
        self._paths = self.latched(Path, DESIRED_PATH_TOPIC)
        if self._origin is None:
            subscribe_with_past(
                self.node, String, 'controller/state', self._on_controller_state, depth=10
            )
            subscribe_with_past(self.node, JointState, 'joint_states', self._follow)
            self.wait('the controller to become active (controller/state)')
        else:
            subscribe_with_past(self.node, Odometry, 'odom', self._follow)
            self._set_origin(self._origin)
            self._send_until(self._horizon, self._origin)
            self.wait('the plant (odom)')

    def _check_reach(self) -> None:
        last = self._timing.last
        if last is None:
            last = round(_CHECKED_AHEAD / self._timing.period)
        count = min(last + 1, _MAX_CHECKED)
        for first in range(0, count, self._window):
            self._trajectory.sample(first, min(self._window, count - first))

    def _on_controller_state(self, raw: bytes) -> None:
        """
        Detect an active controller: time 0 is then the stamp of the next robot state.

        A late-joining node receives only the last state of the controller. A controller in the
        fault of a missing reference was active before.
        """
        try:
            self._is_activated |= would_follow(deserialized(raw, String).data)
        except InputError as error:
            self._rejected_messages.add('controller/state', error)
        if self._is_activated and self._origin is None:
            self.wait('a state of the robot (joint_states)')

    def _follow(self, raw: bytes) -> None:
        """Publish the windows from a message's stamp to the horizon after it."""
        try:
            stamp = header_stamp(raw)
            # The windows ahead of it need valid stamps too.
            checked_stamp(stamp + self._ahead_ns)
        except InputError as error:
            self._rejected_messages.add('odom or joint_states', error)
            return
        if self._origin is None and not self._is_activated:
            return
        origin = self._set_origin(stamp) if self._origin is None else self._origin
        self.wait(None)
        tick = round((stamp - origin) / (1e9 * self._timing.period))
        if self._is_relative and tick + self._horizon < 0:
            # The clock was set back to a time before the path, which restarts. A single such
            # stamp may be wrong; the next one decides.
            self._was_before = not self._was_before
            if self._was_before:
                return
            self.log.info("the robot's clock was set back; the path restarts")
            self._set_origin(stamp)
            tick = self._next = 0
        self._was_before = False
        if max(tick, 0) + self._horizon + self._window < self._next:
            self.log.info('the robot was set back; the reference follows')
            self._next = max(0, tick)
        elif tick > self._next:
            # Past windows are skipped: after a pause, a restart or a step of the clock the
            # reference continues at the current time.
            self._next = tick - tick % self._window
        self._send_until(tick + self._horizon, stamp)
        previous, self._last_tick = self._last_tick, tick
        if self._timing.last is None:
            return
        # A single stamp far ahead may be wrong, and the next one decides. The last state of the
        # run has no next one; it may be far ahead for a node that was delayed.
        is_near = previous is not None and tick - previous <= self._horizon
        is_confirmed = is_near or tick == self._timing.last
        if tick >= self._timing.last and is_confirmed:
            self.finished = True

    def _set_origin(self, origin: int) -> int:
        """Start the trajectory at a stamp in ns; publish its path if it has an end."""
        self._origin = origin
        path = self._path.whole(self._trajectory, origin)
        if path is not None:
            self._paths.publish(path)
        return origin

    def _send_until(self, tick: int, current_stamp: int) -> None:
        last = self._timing.last
        while self._next <= (tick if last is None else min(tick, last)):
            count = self._window if last is None else min(self._window, last + 1 - self._next)
            try:
                samples = self._trajectory.sample(self._next, count)
            except InputError as error:
                self.log.error(f'{error}; the reference ends there', once=True)
                return
            start = self._timing.stamp(self._next) + (self._origin or 0)
            window = ReferenceWindow(start, self._timing.period, samples)
            self._publisher.publish(window.to_bytes())
            piece = self._path.piece(current_stamp, start, samples) if last is None else None
            if piece is not None:
                self._paths.publish(piece)
            self._next += count


def main(arguments: list[str] | None = None) -> int:
    """Run the trajectory node."""
    return run([TrajectoryNode], arguments)


if __name__ == '__main__':
    sys.exit(main())
