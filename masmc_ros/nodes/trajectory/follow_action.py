# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Action FollowJointTrajectory of the trajectory node, if `control_msgs` is installed.

The trajectory of a goal is checked, started and followed as one of `trajectory/joint_trajectory`.
The reference has one owner: a newer goal, message or trajectory of the parameters ends a goal,
whose result names it. `FollowedGoal` contains the rules, and depends neither on the action type
nor on ROS. As in joint_trajectory_controller, tolerances apply to measured positions, a tolerance
of 0 or less is none, and without a time tolerance the goal waits for its goal tolerance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib.util import find_spec
from typing import Any, NamedTuple, TYPE_CHECKING

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError, suggestion
from masmc_ros.loop.timing import Timing
from masmc_ros.messages.cdr_layout import NANOSECONDS
from masmc_ros.nodes.trajectory.path_messages import PathRequest
from masmc_ros.nodes.trajectory.received_paths import ReceivedPaths
from masmc_ros.reference.joint_path import JointPoints
from masmc_ros.reference.pose_path import HEADING
import numpy as np
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

if TYPE_CHECKING:
    from masmc_ros.nodes.process.base import SuiteNode
    from rclpy.action import ActionServer
    from rclpy.action.server import ServerGoalHandle

ACTION = 'trajectory/follow_joint_trajectory'
"""Name of the action, relative to the robot."""

SUCCESSFUL, INVALID_GOAL, PATH_TOLERANCE_VIOLATED, GOAL_TOLERANCE_VIOLATED = 0, -1, -4, -5
"""Values of `error_code`."""

_FEEDBACK_PERIOD = 0.05
"""Time in s of the run between two feedback messages."""


class Outcome(NamedTuple):
    """End of a goal."""

    kind: str
    """Of succeed, abort and canceled, the methods of a goal handle."""
    code: int
    text: str


class Feedback(NamedTuple):
    """Joints (k) of a goal at a tick."""

    desired: Array
    velocities: Array
    accelerations: Array
    actual: Array
    error: Array
    """Actual minus desired positions; of the yaw of the base, within half a turn."""
    time: float
    """Time in s from the first tick of the path."""


class FollowedGoal:
    """
    Goal from its acceptance to its end.

    Attributes
    ----------
    request
        Path of the goal.
    is_cancelled
        True once a client has cancelled it.
    rejection
        Reason why its path does not start; empty without one.

    """

    def __init__(
        self, goal: Any, request: PathRequest, names: Sequence[str], *, is_planar: bool
    ) -> None:
        """
        Initialise the goal.

        Parameters
        ----------
        goal
            Message FollowJointTrajectory.Goal.
        request
            Its path.
        names
            Names of the joints in the order of a joint state.
        is_planar
            True if the third one is the heading of the base.

        Raises
        ------
        InputError
            If the goal has no points, paths of frames, or a tolerance of another joint.

        """
        points = request.points
        if not isinstance(points, JointPoints):
            raise InputError('no points; expected some, or cancel a goal to stop')
        if goal.multi_dof_trajectory.points:
            raise InputError(
                'multi_dof_trajectory has points; expected none: send such paths on '
                'trajectory/multi_dof_trajectory'
            )
        self.request, self.is_cancelled, self.rejection = request, False, ''
        self.columns = points.columns
        self.names = [names[column] for column in points.columns]
        self._turned = (self.columns == HEADING) & is_planar
        self._on_path = self._tolerances(goal.path_tolerance, 'path_tolerance')
        self._at_goal = self._tolerances(goal.goal_tolerance, 'goal_tolerance')
        patience = goal.goal_time_tolerance
        self._patience = patience.sec + patience.nanosec / NANOSECONDS
        self._first: int | None = None

    def update(
        self, received: ReceivedPaths, timing: Timing, tick: int, position: Array
    ) -> Outcome | Feedback | None:
        """
        Return the end of the goal, its joints, or None before its path starts.

        Parameters
        ----------
        received
            Paths of the node.
        timing
            Control grid.
        tick, position
            Tick and positions (positions) of a measured state.

        """
        if self.is_cancelled:
            return Outcome('canceled', SUCCESSFUL, 'cancelled; the reference stops')
        if self.rejection:
            return Outcome('abort', INVALID_GOAL, self.rejection)
        if received.followed is not self.request:
            if received.waiting is self.request:
                return None
            newer = received.waiting or received.followed
            is_path = newer is not None and newer.topic != 'type'
            by = newer.topic if newer and is_path else 'the trajectory of the parameters'
            return Outcome('abort', INVALID_GOAL, f'replaced by {by}')
        state = received.joints_at(tick)
        if state is None or tick < received.first:
            return None
        desired, velocities, accelerations = (values[self.columns] for values in state)
        actual = position[self.columns]
        error = actual - desired
        error[self._turned] = (error[self._turned] + np.pi) % (2.0 * np.pi) - np.pi
        time = timing.time(tick)
        if tick < received.end:
            wrong = self._excess(error, self._on_path, f'from the path at t = {time:g} s')
            if wrong:
                return Outcome('abort', PATH_TOLERANCE_VIOLATED, wrong)
        else:
            wrong = self._excess(error, self._at_goal, f'from the goal at t = {time:g} s')
            if not wrong:
                return Outcome('succeed', SUCCESSFUL, '')
            if 0.0 < self._patience < time - timing.time(received.end):
                return Outcome('abort', GOAL_TOLERANCE_VIOLATED, wrong)
        elapsed = time - timing.time(received.first)
        return Feedback(desired, velocities, accelerations, actual, error, elapsed)

    def _tolerances(self, tolerances: Sequence[Any], name: str) -> Array:
        """Return the largest differences (k) of positions; infinite without a tolerance."""
        largest = np.full(len(self.names), np.inf)
        for tolerance in tolerances:
            if tolerance.name not in self.names:
                raise InputError(
                    f"{name}: unknown joint '{tolerance.name}'; "
                    f'{suggestion(tolerance.name, self.names)}'
                )
            if tolerance.position > 0.0:
                largest[self.names.index(tolerance.name)] = tolerance.position
        return largest

    def _excess(self, error: Array, largest: Array, place: str) -> str:
        """Return a text on the joint that exceeds its tolerance by most; empty if none does."""
        excess = np.abs(error) - largest
        k = int(np.argmax(excess))
        if not excess[k] > 0.0:
            return ''
        return (
            f'{self.names[k]} is {abs(error[k]):.3g} {place}; expected at most {largest[k]:.3g}'
        )


def follow_action(
    node: SuiteNode, received: ReceivedPaths, timing: Timing, names: Sequence[str],
    *, is_planar: bool, read: Callable[[str, JointTrajectory], PathRequest],
    start: Callable[[PathRequest], None],
) -> FollowAction | None:
    """Return the action server of a node; None without `control_msgs`. Arguments: FollowAction."""
    if find_spec('control_msgs') is None:
        return None
    return FollowAction(
        node, received, timing, names, is_planar=is_planar, read=read, start=start
    )


class FollowAction:
    """Action server; goals are accepted one after the other, and the newest one is followed."""

    def __init__(
        self, node: SuiteNode, received: ReceivedPaths, timing: Timing, names: Sequence[str],
        *, is_planar: bool, read: Callable[[str, JointTrajectory], PathRequest],
        start: Callable[[PathRequest], None],
    ) -> None:
        """
        Offer the action.

        Parameters
        ----------
        node, received, timing
            Trajectory node, its paths and its control grid.
        names, is_planar
            As for a FollowedGoal.
        read
            Function that reads the trajectory of a goal; an InputError rejects it.
        start
            Function that lets a path wait for its start; an InputError rejects it.

        """
        from control_msgs.action import FollowJointTrajectory
        from rclpy.action import ActionServer, CancelResponse, GoalResponse

        self._type = FollowJointTrajectory
        self._node, self._received, self._timing = node, received, timing
        self._names, self._is_planar = names, is_planar
        self._read, self._start = read, start
        self._answers = GoalResponse
        self._accept_cancel = CancelResponse.ACCEPT
        self._accepted: FollowedGoal | None = None
        self._active: list[tuple[FollowedGoal, ServerGoalHandle]] = []
        self._due = 0.0
        self._server: ActionServer = ActionServer(
            node.node, FollowJointTrajectory, ACTION, self._end,
            goal_callback=self._check, handle_accepted_callback=self._follow,
            cancel_callback=self._cancel,
        )  # fmt: skip
        self._outcomes: dict[bytes, Outcome] = {}

    def reject(self, request: PathRequest | None, reason: object) -> None:
        """Note why the path of a goal does not start."""
        for goal, _ in self._active:
            if goal.request is request:
                goal.rejection = str(reason)

    def update(self, tick: int, position: Array) -> None:
        """End goals and send feedback at a measured state: tick and positions (positions)."""
        for goal, handle in tuple(self._active):
            result = goal.update(self._received, self._timing, tick, position)
            if isinstance(result, Outcome):
                self._active.remove((goal, handle))
                self._outcomes[bytes(handle.goal_id.uuid)] = result
                if result.code in (PATH_TOLERANCE_VIOLATED, GOAL_TOLERANCE_VIOLATED):
                    self._stop()
                # The handle becomes active only now, because its end is known.
                handle.execute()
            elif result is not None and result.time >= self._due:
                self._due = result.time + _FEEDBACK_PERIOD
                self._send_feedback(goal, handle, result)

    def _check(self, goal: Any) -> Any:
        """Accept or reject a goal; the reason of a rejection is a warning of the node."""
        try:
            request = self._read(ACTION, goal.trajectory)
            followed = FollowedGoal(goal, request, self._names, is_planar=self._is_planar)
            self._start(request)
        except InputError as error:
            self._node.log.warning(f'{ACTION} rejected: {error}')
            return self._answers.REJECT
        self._accepted = followed
        return self._answers.ACCEPT

    def _follow(self, handle: ServerGoalHandle) -> None:
        """Follow an accepted goal; called right after `_check`."""
        assert self._accepted is not None
        self._active.append((self._accepted, handle))
        self._accepted, self._due = None, 0.0

    def _cancel(self, handle: ServerGoalHandle) -> Any:
        for goal, active in self._active:
            if active.goal_id == handle.goal_id:
                goal.is_cancelled = True
                owners = self._received.waiting, self._received.followed
                if any(owner is goal.request for owner in owners):
                    self._stop()
        return self._accept_cancel

    def _stop(self) -> None:
        """Stop the reference, unless the run ends before."""
        with suppress(InputError):
            self._start(PathRequest(ACTION, None, None))

    def _end(self, handle: ServerGoalHandle) -> Any:
        """Set the end of a goal, and return its result."""
        outcome = self._outcomes.pop(bytes(handle.goal_id.uuid))
        getattr(handle, outcome.kind)()
        return self._type.Result(error_code=outcome.code, error_string=outcome.text)

    def _send_feedback(
        self, goal: FollowedGoal, handle: ServerGoalHandle, joints: Feedback
    ) -> None:
        message = self._type.Feedback(joint_names=goal.names)
        message.header.stamp = self._node.node.get_clock().now().to_msg()
        for point, positions in (
            (message.desired, joints.desired), (message.actual, joints.actual),
            (message.error, joints.error),
        ):
            _fill(point, positions, joints.time)
        message.desired.velocities = joints.velocities.tolist()
        message.desired.accelerations = joints.accelerations.tolist()
        handle.publish_feedback(message)


def _fill(point: JointTrajectoryPoint, positions: Array, time: float) -> None:
    """Write positions and the time in s from the start into a point."""
    point.positions = positions.tolist()
    seconds, nanoseconds = divmod(round(time * NANOSECONDS), round(NANOSECONDS))
    point.time_from_start.sec, point.time_from_start.nanosec = seconds, nanoseconds
