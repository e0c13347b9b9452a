# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Reference with paths from messages, without ROS.

The reference is the trajectory of the parameters until a path starts. A path waits until the state
of the robot is known at which it starts. In lock-step this is the first state for which no
reference was sent: the node sends none beyond, and the controller waits. Therefore no sample is
replaced, and the run can be recomputed. In real time a path starts a lead after the latest state,
and its samples replace those that were sent.
"""

from __future__ import annotations

import math
from threading import Thread

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.loop.timing import PACING, Timing
from masmc_ros.loop.trajectory_parameters import (
    PATH_ACCELERATION,
    PATH_BASE,
    PATH_JERK,
    PATH_LEAD,
    PATH_SPEED,
    PATH_TURN_RATE,
)
from masmc_ros.nodes.trajectory.path_messages import PathRequest
from masmc_ros.params.declaration import Values
from masmc_ros.reference.jerk_limited import load_ruckig
from masmc_ros.reference.joined import JoinedMotion, load_code, Motion, TrajectoryMotion
from masmc_ros.reference.joint_path import JointPath, JointPoints, JointState, JointTask
from masmc_ros.reference.pose_path import HEADING, PosePoints, Speeds, TaskPath, TwistPoints
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.robot.mechanisms import joint_names
from masmc_ros.robot.robot import Robot

_BRAKING = 1.0
"""Time in s in which an empty message stops the reference."""

_MOST_CHECKED = 60.0
"""Length in s of the start of a path whose reach is checked; later samples when they are sent."""


class ReceivedPaths:
    """
    Trajectory of a node, and the path that replaces it.

    Attributes
    ----------
    waiting
        Path that waits for its start; None without one.
    followed
        Path that is followed; None without one.

    """

    def __init__(
        self, trajectory: Trajectory, robot: Robot, timing: Timing, values: Values
    ) -> None:
        """
        Initialise without a path.

        Parameters
        ----------
        trajectory
            Trajectory of the parameters.
        robot
            Robot of the node.
        timing
            Control grid.
        values
            Parameters of the node.

        Raises
        ------
        UserError
            If goals have a limit of jerk, and ruckig is not installed.

        """
        self._trajectory, self._robot, self._timing = trajectory, robot, timing
        self._speeds = Speeds(
            PATH_SPEED.of(values), PATH_TURN_RATE.of(values), PATH_ACCELERATION.of(values),
            PATH_JERK.of(values),
        )  # fmt: skip
        if self._speeds.jerk > 0.0:
            load_ruckig()
        self._base_follows = PATH_BASE.of(values) == 'follow'
        self._names = joint_names(values)
        is_timed = PACING.of(values) == 'realtime'
        self._lead = math.ceil(PATH_LEAD.of(values) / timing.period) if is_timed else 0
        self._is_timed = is_timed
        self._joined: JoinedMotion | None = None
        self._loading: Thread | None = None
        self._first = 0
        self._start_ns: int | None = None
        self.waiting: PathRequest | None = None
        self.followed: PathRequest | None = None

    @property
    def end(self) -> int:
        """Return the last tick at which the path of a message moves; 0 without one."""
        return 0 if self._joined is None else self._joined.last

    @property
    def first(self) -> int:
        """Return the first tick of the path of a message; 0 without one."""
        return 0 if self._joined is None else self._joined.tick

    def joints_at(self, tick: int) -> JointState | None:
        """Return the state of the joints on the path at a tick; None without a path of joints."""
        if self._joined is None or not isinstance(self._joined.motion, JointTask):
            return None
        return self._joined.motion.path.state(self._joined.time(tick))

    def sample(self, first: int, count: int) -> Array:
        """Return (count, 3 axes) samples at ticks first, ...; InputError out of reach."""
        if self._joined is None:
            return self._trajectory.sample(first, count)
        samples = self._joined.sample(first, count)
        self._trajectory.check_reach(self._robot.geometry, first, samples)
        return samples

    def wait(self, request: PathRequest, *, unsent: int, tick: int, origin_ns: int) -> None:
        """
        Let a path wait for its start; it replaces one that waits.

        Parameters
        ----------
        request
            Path.
        unsent
            First tick for which no sample was sent.
        tick
            Latest known tick of the robot.
        origin_ns
            Stamp of tick 0 in ns.

        Raises
        ------
        InputError
            If the run ends before the path can start, and for velocities in lock-step.

        """
        if request.is_command and not self._is_timed:
            raise InputError(
                'pacing = lockstep: expected realtime, since velocities act as soon as they arrive'
            )
        start_ns, first = None, tick if self._is_timed else unsent
        if request.stamp_ns is not None:
            start_ns = request.stamp_ns - origin_ns
            first = max(first, math.ceil(1e-9 * start_ns / self._timing.period))
        last = self._timing.last
        if last is not None and first > last:
            raise InputError(
                f'it would start at {self._timing.time(first):g} s, and the run ends at '
                f'{self._timing.time(last):g} s; expected an earlier path, or a longer duration'
            )
        self._start_ns, self._first, self.waiting = start_ns, first, request
        if self._loading is None:
            self._loading = Thread(target=load_code, args=(self._robot,), daemon=True)
            self._loading.start()

    @property
    def is_loading(self) -> bool:
        """Return True until the compiled code of paths is ready; no path starts before."""
        return self._loading is not None and self._loading.is_alive()

    @property
    def unsendable(self) -> int | None:
        """Return the first tick whose sample a waiting path determines; None without one."""
        return None if self.waiting is None or self._is_timed else self._first

    def start(self, tick: int, position: Array) -> int | None:
        """
        Start the waiting path if a state is the one at which it starts.

        Parameters
        ----------
        tick
            Tick of the state.
        position
            Positions (positions) of the joints in the order of a joint state, which the caller
            may overwrite later.

        Returns
        -------
            The first tick of the path; None if it continues to wait.

        Raises
        ------
        InputError
            If the robot cannot follow the path; the reference stays then, and no path waits.

        """
        if self.waiting is None or tick + self._lead < self._first:
            return None
        if self.is_loading:
            # Without its code in the cache, compiling takes longer than the samples sent last.
            return None
        request, self.waiting = self.waiting, None
        first = max(self._first, tick + self._lead)
        offset = 0.0
        if self._start_ns is not None:
            offset = self._timing.time(first) - 1e-9 * self._start_ns
        before = self.sample(first, 1)[0]
        motion = self._motion(request, first, before, position)
        if motion.end <= offset:
            raise InputError(
                f'it ended {offset - motion.end:.3g} s before its first sample at t = '
                f'{self._timing.time(first):g} s; expected a later stamp, or 0 for now'
            )
        joined = JoinedMotion(
            motion,
            before,
            tick=first,
            period=self._timing.period,
            offset=max(0.0, offset),
            speed=self._speeds.linear,
        )
        count = min(joined.last, first + round(_MOST_CHECKED / self._timing.period)) + 1 - first
        self._trajectory.check_reach(self._robot.geometry, first, joined.sample(first, count))
        self._joined, self.followed = joined, request
        return first

    def reset(self) -> None:
        """Return to the trajectory of the parameters."""
        self._joined = self.waiting = self.followed = None

    def reset_before(self, tick: int) -> bool:
        """Return to the trajectory of the parameters if a path starts after a tick."""
        is_later = self._joined is not None and tick < self._joined.tick
        if is_later:
            self.reset()
        return is_later

    def _motion(
        self, request: PathRequest, first: int, before: Array, position: Array
    ) -> Motion:
        """
        Return the motion of a path; InputError if a joint cannot follow it.

        Parameters
        ----------
        request
            Path.
        first
            First tick of the motion.
        before
            Sample (3 axes) of the reference there.
        position
            Measured positions (positions).

        """
        points, mechanism = request.points, self._robot.mechanism
        if isinstance(points, Trajectory):
            return TrajectoryMotion(points)
        axes = len(mechanism.axes)
        known = self.joints_at(first)
        state = JointState.at_rest(position.copy()) if known is None else known
        if points is None:
            if known is None:
                return TaskPath.braking(before, _BRAKING)
            return JointTask(JointPath.braking(known, _BRAKING), self._robot, before[:axes])
        if isinstance(points, PosePoints):
            if not points.of_base:
                return points.task_path(
                    self._robot, before, self._speeds, base_follows=self._base_follows
                )
            points = points.joint_points(state, self._speeds)
        if isinstance(points, TwistPoints):
            points = points.joint_points(state)
        return self._joint_motion(points, state, before[:axes])

    def _joint_motion(self, points: JointPoints, state: JointState, task: Array) -> JointTask:
        mechanism = self._robot.mechanism
        path = JointPath(points, state, HEADING if mechanism.is_planar else None)
        path.check_limits(mechanism, self._names)
        return JointTask(path, self._robot, task)
