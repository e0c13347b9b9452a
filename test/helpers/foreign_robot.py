# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Third-party robots in real time: some joints in another order, odometry, their own clock."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist, TwistStamped
from helpers.processes import PAPER, Peer
from masmc_ros.loop.simulated_robot import SimulatedRobot
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.messages.transforms import TransformsCdr
from masmc_ros.nodes.middleware.ros_topics import raw_class
from masmc_ros.robot.mechanisms import joint_names
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.scenario import load_scenario
from nav_msgs.msg import Odometry
import numpy as np
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

PERIOD = 0.005
LATE = 0.03
"""Age of states in s when they are sent."""

MOST_TICKS = 4
"""Maximum number of ticks to catch up, and of ticks with the same command.

After longer delays of the test robot or of its controller time is lost: on a busy machine an arm
with torques that are a tenth of a second old spins up.
"""

ANSWERED = 0.2
"""Time in s for which a robot with its own clock waits for the answer to a state."""

WATCHDOG = 0.1
"""Time in s without a command after which the drives hold zero velocity."""


class ForeignRobot:
    """
    Simulated robot in real time that publishes a state every period.

    Attributes
    ----------
    topics
        names of the topics of torques and twists.
    is_hybrid
        whether the robot takes a twist for the base.
    velocities
        function from velocities in the joints' order to those in the message.
    is_on
        whether the robot advances.
    publishes_pose
        whether the robot publishes odometry.
    torques
        all commanded torques, N·m.
    answered
        stamps in ns of the states that the torques answer.
    wrong
        commands that are not finite numbers for the joints.
    correction
        transform (7) from `map` to `odom` of a hybrid robot.
    publishes_states
        whether the robot publishes joint states.
    velocities_seen
        true velocities (positions) at all times.

    """

    def __init__(
        self,
        tester: Peer,
        *,
        is_hybrid: bool = False,
        file: Path = PAPER,
        settings: Sequence[str] = (),
        period: float = PERIOD,
        late: float = LATE,
        has_brakes: bool = False,
        topics: tuple[str, str] = ('effort_commands', 'cmd_vel'),
        twist_type: Any = Twist,
        has_clock: bool = False,
    ) -> None:
        """
        Initialise the robot, and publish until the tester ends.

        Parameters
        ----------
        tester
            Node of the robot.
        is_hybrid
            True for a robot that takes a twist for the base and torques of the arm. It publishes
            odometry at every fourth period, one period late, and the transform from `map` to
            `odom`.
        file, settings
            Parameter file of the robot, and settings of its plant.
        period, late
            Time between two states, and the age of their stamps, in s.
        has_brakes
            True for brakes that hold the robot until the first torque.
        topics, twist_type
            Names of the topics of torques and twists, and the type of the twists.
        has_clock
            True for a robot that publishes its time on `/clock`, as simulators do. It waits for
            the answer to each state, so its time passes slowly on a busy machine, and its torques
            are as fresh as on an idle one.

        """
        hybrid = ('plant.command_interface=hybrid',) if is_hybrid else ()
        values = load_scenario(str(file), (*hybrid, *settings))['plant']
        # The robot is at rest until the first command.
        values['disturbance.amplitude'] = tuple(0.0 for _ in values['disturbance.amplitude'])
        # The first ticks compile; meanwhile a robot would not publish.
        trial = SimulatedRobot(robot_of(values), period, values)
        trial.advance(None)
        trial.advance(np.zeros(len(trial.mechanism.joints)))
        self._robot = SimulatedRobot(robot_of(values), period, values)
        mechanism = self._robot.mechanism
        self._period, self._late = period, 0.0 if is_hybrid else late
        self._start = time.monotonic()
        self.topics, self.is_hybrid, self._has_brakes = topics, is_hybrid, has_brakes
        self._names = joint_names(values)
        first, count = len(mechanism.base), len(self._names)
        # The order differs from that of the controller, which does not know the other joints.
        self._order = [count - 1, first, *reversed(range(first + 1, count - 1))]
        self._others = ('gripper',)
        driven = self._names[first + (len(mechanism.twist) if is_hybrid else 0):]
        self._command = EffortCdr(driven)
        self._torque, self._twist = np.zeros(len(driven)), np.zeros(2)
        self._posed = np.zeros(count), np.zeros(count), 0
        self.correction = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        self.publishes_states = True
        self.velocities_seen: list[np.ndarray] = []
        self._commanded, self._advanced, self._answered_tick = self._start, self._start, 0
        self._clock = tester.publisher(Clock, '/clock') if has_clock else None
        self._states = tester.publisher(JointState, 'joint_states')
        self._odometry = tester.publisher(Odometry, 'odom')
        self.velocities: Any = lambda velocity: []
        self.is_on = self.publishes_pose = True
        self.torques: list[np.ndarray] = []
        self.answered: list[int] = []
        self.wrong: list[bytes] = []
        tester.subscribe(Float64MultiArray, topics[0], self._on_command, raw=True)
        if is_hybrid:
            self._transforms = TransformsCdr('', (('map', 'odom'),))
            self._tf = tester.publisher(raw_class('tf2_msgs/msg/TFMessage'), '/tf')
            tester.subscribe(twist_type, topics[1], self._on_twist)
        tester.node.create_timer(period, self._advance)

    @property
    def task_position(self) -> np.ndarray:
        """Return the task coordinates (4) in the frame `map`, of a correction without rotation."""
        position = self._robot.true_position.copy()
        position[:2] += self.correction[:2]
        return self._robot.robot.task_positions(position[None])[0]

    def _on_twist(self, message: Twist | TwistStamped) -> None:
        twist = message.twist if isinstance(message, TwistStamped) else message
        self._twist = np.array([twist.linear.x, twist.angular.z])

    def _on_command(self, raw: bytes) -> None:
        if self._command.load(raw):
            self._torque = self._command.data.copy()
            self._commanded = time.monotonic()
            self.torques.append(self._torque)
            self.answered.append(self._command.stamp_ns or 0)
            self._answered_tick = round(1e-9 * self.answered[-1] / self._period)
        else:
            self.wrong.append(raw)

    def _advance(self) -> None:
        """Advance the robot to the current time and publish its state."""
        if self._clock:
            self._advance_clock(self._clock)
            return
        age = time.monotonic() - self._commanded
        if not self.is_on or MOST_TICKS * self._period < age <= WATCHDOG:
            return
        ticks = int((time.monotonic() - self._start) / self._period)
        if ticks <= self._robot.tick:
            return
        self._has_brakes &= not self._torque.any()
        lost = max(0, ticks - self._robot.tick - (0 if self._has_brakes else MOST_TICKS))
        self._start += lost * self._period
        # The drives hold zero velocity without a command, as those of real robots do.
        while self._robot.tick < ticks - lost:
            self._step(is_held=age > WATCHDOG)
        self._publish(time.time_ns() - round(self._late * 1e9))

    def _advance_clock(self, clock: Any) -> None:
        """Advance the robot by a tick when its state is answered, or the answer may be lost."""
        self._has_brakes &= not self._torque.any()
        unanswered = 0 if self._has_brakes else self._robot.tick - self._answered_tick
        is_awaited = unanswered > 0 and time.monotonic() - self._advanced < ANSWERED
        if is_awaited or unanswered > MOST_TICKS:
            return
        self._advanced = time.monotonic()
        self._step(is_held=self._has_brakes)
        stamp = round(self._robot.tick * self._period * 1e9)
        clock.publish(Clock(clock=Time(nanoseconds=stamp).to_msg()))
        self._publish(stamp)

    def _step(self, *, is_held: bool) -> None:
        """Advance the robot by a tick with the latest command, or with drives that hold it."""
        twist = self._twist if self.is_hybrid else self._twist[:0]
        self._robot.advance(None if is_held else np.concatenate([twist, self._torque]))

    def _publish(self, stamp: int) -> None:
        """Publish the state and the pose of the base."""
        self.velocities_seen.append(self._robot.true_velocity.copy())
        if self.is_hybrid:
            self._publish_base(stamp)
        elif self.publishes_pose:
            self.publish_pose(stamp)
        if self.publishes_states:
            self.publish_state(stamp)

    def _publish_base(self, stamp: int) -> None:
        """Publish odometry of the last period at every fourth, and the transform of its frame."""
        if self._robot.tick % 4 == 0 and self.publishes_pose:
            self.publish_pose(self._posed[2], *self._posed[:2])
            self._tf.publish(self._transforms.fill(stamp, self.correction[None]))
        self._posed = self._robot.position.copy(), self._robot.velocity.copy(), stamp

    def publish_state(self, stamp: int) -> None:
        state = JointState(name=[*self._others, *(self._names[i] for i in self._order)])
        state.header.stamp.sec, state.header.stamp.nanosec = divmod(stamp, 10**9)
        others, order = len(self._others), self._order
        state.position = [*[0.5] * others, *self._robot.position[order].tolist()]
        state.velocity = self.velocities(
            [*[0.0] * others, *self._robot.velocity[order].tolist()]
        )
        self._states.publish(state)

    def publish_pose(self, stamp: int, position: Any = None, velocity: Any = None) -> None:
        position = self._robot.position if position is None else position
        velocity = self._robot.velocity if velocity is None else velocity
        motion = self._robot.mechanism.formulas.base_motion
        poses, twists = motion(position[None], velocity[None])
        message = Odometry()
        message.header.frame_id, message.child_frame_id = 'odom', 'base_link'
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        pose, twist = message.pose.pose, message.twist.twist
        pose.position.x, pose.position.y = poses[0, :2].tolist()
        pose.orientation.z, pose.orientation.w = poses[0, 5:].tolist()
        twist.linear.x, twist.angular.z = float(twists[0, 0]), float(twists[0, 5])
        self._odometry.publish(message)


class Watched(ForeignRobot):
    """
    Robot with the messages of its controller.

    Attributes
    ----------
    controller_states
        texts of `controller/state`.
    health
        latest report of the controller.
    errors
        tracking errors in m.

    """

    def __init__(self, tester: Peer, **options: Any) -> None:
        super().__init__(tester, **options)
        self.tester = tester
        self.controller_states: list[str] = []
        self.health: dict[str, str] = {}
        self._reported = 0
        self.errors: list[np.ndarray] = []
        tester.subscribe(
            String, 'controller/state', lambda m: self.controller_states.append(m.data)
        )
        tester.subscribe(DiagnosticArray, '/diagnostics', self._on_health)
        tester.subscribe(
            Float64MultiArray,
            'controller/tracking_error',
            lambda m: self.errors.append(np.array(m.data[2:])),
            past=False,
        )

    def figure(self, name: str) -> float:
        return float(self.health.get(name, 'nan'))

    def reported(self, name: str) -> float:
        """Return a figure of the next report."""
        now = time.time_ns()
        self.tester.until(lambda: self._reported > now, 'a report')
        return self.figure(name)

    def moves_on(self, count: int = 300) -> None:
        """Wait for more than `count` further torques."""
        previous = len(self.torques)
        self.tester.until(
            lambda: (
                len(self.torques) > previous + count and self.controller_states[-1:] == ['active']
            ),
            lambda: f'torques; {self.controller_states}, {self.health}',
        )

    def _on_health(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.endswith('controller'):
                self.health = {pair.key: pair.value for pair in status.values}
                stamp = message.header.stamp
                self._reported = stamp.sec * 10**9 + stamp.nanosec
