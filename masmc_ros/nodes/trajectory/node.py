# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The trajectory node: windows of the reference, sent ahead of the robot's time."""

from __future__ import annotations

import sys
import time

from diagnostic_msgs.msg import DiagnosticArray
from masmc_ros.aliases import Array
from masmc_ros.control.actions import Record, Throttle
from masmc_ros.control.supervisor import would_follow
from masmc_ros.errors import InputError, UserError
from masmc_ros.log.traced_paths import DesiredPath
from masmc_ros.loop.controller_parameters import POSE_FRAME
from masmc_ros.loop.timing import Timing
from masmc_ros.loop.trajectory_parameters import HORIZON, START_TIME, WINDOW
from masmc_ros.messages.cdr_layout import checked_stamp
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.messages.topics import CONTROLLER_STATE_TOPIC, DESIRED_PATH_TOPIC
from masmc_ros.nodes.middleware.ros_topics import deserialized, subscribe_with_past
from masmc_ros.nodes.parameters.ros_parameters import Pending
from masmc_ros.nodes.process.base import Health, publish_health, RejectedMessages, SuiteNode
from masmc_ros.nodes.process.command_line import CommandLine
from masmc_ros.nodes.process.runtime import run
from masmc_ros.nodes.trajectory.follow_action import follow_action
from masmc_ros.nodes.trajectory.path_input import PathInput
from masmc_ros.nodes.trajectory.path_messages import PathRequest
from masmc_ros.nodes.trajectory.received_paths import ReceivedPaths
from masmc_ros.params.declaration import MutableValues
from masmc_ros.reference.reference import PATH_RECEIVED
from masmc_ros.reference.trajectory import path_values, Trajectory, TYPE
from masmc_ros.robot.mechanisms import check_frame_prefix, FRAME_PREFIX, joint_names
from masmc_ros.robot.robot import robot_of
from nav_msgs.msg import Odometry, Path
import numpy as np
from rclpy.context import Context
from rclpy.timer import Timer
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

_CHECKED_AHEAD = 60.0
"""Length in s of an endless path, or of one of changed parameters, that is checked at first."""

_MOST_AHEAD = 500
"""Largest number of windows ahead; a controller stores 1000."""

_RETRY = 0.02
"""Period in s in which a path that waits for its compiled code is tried again."""

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
        self._robot = robot = robot_of(self.values)
        self._trajectory = Trajectory(self.values, period, robot)
        self._prefix = check_frame_prefix(FRAME_PREFIX.of(self.values))
        self._path = DesiredPath(
            self._timing, robot, self._prefix, POSE_FRAME.of(self.values)
        )
        self._mechanism = robot.mechanism
        self._received = ReceivedPaths(self._trajectory, robot, self._timing, self.values)
        self._window = max(2, round(WINDOW.of(self.values) / period))
        self._horizon = max(self._window, round(HORIZON.of(self.values) / period))
        if self._horizon > _MOST_AHEAD * self._window:
            raise InputError(
                f'horizon = {HORIZON.of(self.values):g}, window = {WINDOW.of(self.values):g}: '
                f'{self._horizon // self._window} windows ahead; expected at most {_MOST_AHEAD}, '
                'with a longer window or a shorter horizon'
            )
        ticks_ahead = max(self._horizon + self._window, self._timing.last or 0)
        self._ahead_ns = self._timing.stamp(ticks_ahead)
        self._next = 0
        start = START_TIME.of(self.values)
        self._origin = round(1e9 * start) if start >= 0.0 else None
        self._is_relative = self._origin is None
        self._throttle = Throttle(period=1.0)
        self._was_before = False
        self._is_activated = False
        self._last_tick: int | None = None
        self._state_tick: int | None = None
        self._rejected_messages = RejectedMessages(self.log)
        self._requested: MutableValues = {}
        self._retry: Timer | None = None
        self._kept = 0, np.empty(0)
        self._check_reach()
        if self._trajectory.note:
            self.log.info(self._trajectory.note)
        self.parameters.on_request(self._request)

    def connect(self) -> None:
        """Publish the first windows, and subscribe to the robot's time."""
        super().connect()
        # A late-joining controller needs the windows around the current time, not all past ones.
        depth = 4 + 2 * (self._horizon // self._window)
        self._publisher = self.publisher(Float64MultiArray, 'reference', depth)
        self._paths = self.latched(Path, DESIRED_PATH_TOPIC)
        self._input = PathInput(
            self, self._mechanism, self._prefix, self._on_path, self._on_state
        )
        self._action = follow_action(
            self,
            self._received,
            self._timing,
            joint_names(self.values),
            is_planar=self._mechanism.is_planar,
            read=self._input.read_joints,
            start=self._on_goal,
        )
        publish_health(
            self.node, self.latched(DiagnosticArray, '/diagnostics'), self.steady, self._health
        )
        if self._origin is None:
            subscribe_with_past(
                self.node, String, CONTROLLER_STATE_TOPIC, self._on_controller_state, depth=10
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
            self._rejected_messages.add(CONTROLLER_STATE_TOPIC, error)
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
            self._received.reset()
            self._withdraw_requested()
            self._set_origin(stamp)
            tick = self._next = 0
        self._was_before = False
        self._check_set_back(tick, self._state_tick)
        self._skip_until(tick)
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

    def _check_set_back(self, tick: int, other: int | None) -> bool:
        """
        Return True if the robot was set back, and continue the reference there.

        A path starts at a tick of `joint_states`, and on a busy machine older odometry may arrive
        after it. Therefore both have to be earlier.

        Parameters
        ----------
        tick
            Tick of the message.
        other
            Latest tick of the other topic; None without one.

        """
        newest = max(tick, 0 if other is None else other)
        if max(newest, 0) + self._horizon + self._window >= self._next:
            return False
        # The stamps of two robots may alternate many times in a second.
        if self._throttle.is_due('set back', time.monotonic()):
            self.log.info('the robot was set back; the reference follows')
        self._next = max(0, newest)
        if self._received.reset_before(self._next):
            self._withdraw_requested()
            self.log.info('it is before the path of a message, which is dropped')
        return True

    def _set_origin(self, origin: int) -> int:
        """Start the trajectory at a stamp in ns; publish its path if it has an end."""
        self._origin = origin
        path = self._path.whole(self._trajectory, origin)
        if path is not None:
            self._paths.publish(path)
        return origin

    def _skip_until(self, tick: int) -> None:
        """
        Skip the windows that are past at a tick.

        After a pause, a restart or a step of the clock the reference continues at the current
        time. The stamp of a message that is not of this robot may be years ahead.
        """
        if tick > self._next:
            self._next = tick - tick % self._window

    def _send_until(self, tick: int, current_stamp: int) -> None:
        last, unsendable = self._timing.last, self._received.unsendable
        if unsendable is not None:
            last = unsendable - 1 if last is None else min(last, unsendable - 1)
        while self._next <= (tick if last is None else min(tick, last)):
            count = self._window if last is None else min(self._window, last + 1 - self._next)
            try:
                samples = self._received.sample(self._next, count)
            except InputError as error:
                self.log.error(f'{error}; the reference ends there', once=True)
                return
            start = self._timing.stamp(self._next) + (self._origin or 0)
            window = ReferenceWindow(start, self._timing.period, samples)
            self._publisher.publish(window.to_bytes())
            is_piece = self._timing.last is None or self._received.followed is not None
            piece = self._path.piece(current_stamp, start, samples) if is_piece else None
            if piece is not None:
                self._paths.publish(piece)
            self._next += count

    def _on_path(self, request: PathRequest) -> None:
        """Let a path of a message wait for the state at which it starts; may raise InputError."""
        if self._origin is None:
            raise InputError(
                'the controller is not active yet, so time has no origin; expected the path later'
            )
        self._received.wait(
            request, unsent=self._next, tick=self._last_tick or 0, origin_ns=self._origin
        )
        if not isinstance(request.points, Trajectory):
            # The path of the message has replaced that of the parameters, which waits.
            self._withdraw_requested()

    def _on_goal(self, request: PathRequest) -> None:
        """Let the path of an action wait for its start; may raise InputError."""
        self._on_path(request)
        self._input.follow_states()

    def _request(self, values: MutableValues) -> Pending:
        """
        Let the trajectory of changed parameters wait for its start, as a path of a message does.

        Parameters of other types take effect at once.
        """
        new = {**self.values, **self._requested, **values}
        if path_values(new) == path_values(self.values):
            self.parameters.take_effect(values)
            return Pending()
        try:
            trajectory = Trajectory(new, self._timing.period, self._robot)
            ticks = round(_CHECKED_AHEAD / self._timing.period)
            if self._timing.last is not None:
                ticks = min(ticks, self._timing.last - (self._last_tick or 0))
            trajectory.sample(0, ticks + 1)
            self._on_path(PathRequest('type', trajectory, None))
        except UserError as error:
            return Pending(str(error), tuple(values))
        self._requested.update(values)
        self._input.follow_states()
        return Pending(f'the trajectory {trajectory.kind} starts at the next state of the robot')

    def _take_requested(self) -> MutableValues:
        """Return the parameters that wait for the start of their trajectory; none wait then."""
        requested, self._requested = self._requested, {}
        return requested

    def _withdraw_requested(self) -> None:
        """Reset parameters whose trajectory does not start."""
        self.parameters.withdraw(self._take_requested())

    def _on_state(self, stamp: int, position: Array) -> None:
        """Start a path that waits for this state of the robot, and follow goals of the action."""
        if self._origin is None:
            return
        tick = round((stamp - self._origin) / (1e9 * self._timing.period))
        self._state_tick = tick
        if self._last_tick is not None and self._check_set_back(tick, self._last_tick):
            self._send_until(tick + self._horizon, stamp)
        if self._received.waiting is not None:
            self._start_waiting(self._received.waiting, tick, stamp, position)
        if self._action is not None:
            self._action.update(tick, position)

    def _start_waiting(
        self, request: PathRequest, tick: int, stamp: int, position: Array
    ) -> None:
        """
        Start a waiting path if a state is the one at which it starts.

        Parameters
        ----------
        request
            Path.
        tick, stamp, position
            Tick, stamp in ns and positions (positions) of the state.

        """
        assert self._origin is not None
        before = self._received.followed
        continues = before is not None and before.is_command and tick <= self._received.end
        try:
            first = self._received.start(tick, position)
            if first is None:
                if self._received.is_loading and self._received.unsendable is not None:
                    self._keep(stamp, position)
                return
        except InputError as error:
            self._input.reject(request.topic, error)
            if self._action is not None:
                self._action.reject(request, error)
            self._withdraw_requested()
            self._skip_until(tick)
        else:
            self._next = first
            start = self._timing.stamp(first) + self._origin
            self._input.accept()
            changed = self._take_requested()
            if changed:
                self.parameters.take_effect(changed)
                self.record_parameters(Record(first, start, self.values, tuple(changed)))
            # Velocities arrive many times a second: one line and one record for all of them.
            if not (continues and request.is_command):
                self.log.info(f'{request.topic}: {request.text}, from t = {start * 1e-9:g} s on')
                self.record_parameters(Record(first, start, self.values, event=PATH_RECEIVED))
        # In lock-step the controller waits for these samples.
        self._send_until(tick + self._horizon, stamp)

    def _keep(self, stamp: int, position: Array) -> None:
        """Keep a state at which a path may start once its compiled code is ready."""
        self._kept = stamp, position.copy()
        if self._retry is None:
            self._retry = self.node.create_timer(_RETRY, self._try_again, clock=self.steady)

    def _try_again(self) -> None:
        """Take the kept state again; in lock-step no other one arrives before the path starts."""
        if self._received.is_loading or self._retry is None:
            return
        self.node.destroy_timer(self._retry)
        self._retry = None
        self._on_state(*self._kept)

    def _health(self) -> Health:
        text = f'type {TYPE.of(self.values)}'
        followed = self._received.followed
        if followed is not None and not isinstance(followed.points, Trajectory):
            is_moving = (self._last_tick or 0) <= self._received.end
            text = 'a path of a message' if is_moving else 'the end of a path of a message'
        return self._input.health(text)


def main(arguments: list[str] | None = None) -> int:
    """Run the trajectory node."""
    return run([TrajectoryNode], arguments)


if __name__ == '__main__':
    sys.exit(main())
