# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Third-party robot: positions only, other joint order, odometry, its own clock, late states."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from helpers.processes import PAPER, Peer, peer, processes, ros_arguments
from masmc_ros.loop.simulated_robot import SimulatedRobot
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.messages.names import JOINTS
from masmc_ros.params.scenario import load_scenario
from masmc_ros.robot.robot import robot_of
from masmc_ros.robot.two_link.platform_motion import base_motion as platform_motion
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

PERIOD = 0.005
LATE = 0.03
"""Age of states in s when they are sent."""

ORDER = [6, 3, 5, 4]
"""Driven joints in the order of the robot's messages."""

MOST_TICKS = 4
"""Maximum number of ticks to catch up; after longer delays of the test robot time is lost."""

WATCHDOG = 0.1
"""Time in s without a command after which the drives hold zero velocity."""

FIRST = 100_000_000
"""Duration of the first torques in ns."""

AWAY = 0.3
"""Distance in m from the robot to the start of the path."""


class Robot:
    """
    Simulated robot in real time that publishes a state every period.

    Attributes
    ----------
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
        commands that are not four finite numbers.

    """

    def __init__(self, tester: Peer) -> None:
        # The robot is at rest until the first command.
        calm = ('plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',)
        values = load_scenario(str(PAPER), calm)['plant']
        self._robot = SimulatedRobot(robot_of(values), PERIOD, values)
        self._start = time.monotonic()
        self._command, self._torque = EffortCdr(), np.zeros(4)
        self._commanded = self._start
        self._states = tester.publisher(JointState, 'joint_states')
        self._odometry = tester.publisher(Odometry, 'odom')
        self.velocities: Any = lambda velocity: []
        self.is_on = self.publishes_pose = True
        self.torques: list[np.ndarray] = []
        self.answered: list[int] = []
        self.wrong: list[bytes] = []
        tester.subscribe(Float64MultiArray, 'effort_commands', self._on_command, raw=True)
        tester.node.create_timer(PERIOD, self._advance)

    def _on_command(self, raw: bytes) -> None:
        if self._command.load(raw):
            self._torque = self._command.data.copy()
            self._commanded = time.monotonic()
            self.torques.append(self._torque)
            self.answered.append(self._command.stamp_ns or 0)
        else:
            self.wrong.append(raw)

    def _advance(self) -> None:
        """Advance the robot to the current time and publish its state."""
        if not self.is_on:
            return
        ticks = int((time.monotonic() - self._start) / PERIOD)
        if ticks <= self._robot.tick:
            return
        lost = max(0, ticks - self._robot.tick - MOST_TICKS)
        self._start += lost * PERIOD
        # The drives hold zero velocity without a command, as those of real robots do.
        is_held = time.monotonic() - self._commanded > WATCHDOG
        while self._robot.tick < ticks - lost:
            self._robot.advance(None if is_held else self._torque)
        stamp = time.time_ns() - round(LATE * 1e9)
        if self.publishes_pose:
            self.publish_pose(stamp)
        self.publish_state(stamp)

    def publish_state(self, stamp: int) -> None:
        state = JointState(name=['gripper', *(JOINTS[i] for i in ORDER)])
        state.header.stamp.sec, state.header.stamp.nanosec = divmod(stamp, 10**9)
        state.position = [0.5, *self._robot.position[ORDER].tolist()]
        state.velocity = self.velocities([0.0, *self._robot.velocity[ORDER].tolist()])
        self._states.publish(state)

    def publish_pose(self, stamp: int) -> None:
        poses, twists = platform_motion(self._robot.position[None], self._robot.velocity[None])
        message = Odometry()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        pose, twist = message.pose.pose, message.twist.twist
        pose.position.x, pose.position.y = poses[0, :2].tolist()
        pose.orientation.z, pose.orientation.w = poses[0, 5:].tolist()
        twist.linear.x, twist.angular.z = float(twists[0, 0]), float(twists[0, 5])
        self._odometry.publish(message)


class Watched(Robot):
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

    def __init__(self, tester: Peer) -> None:
        super().__init__(tester)
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


@contextmanager
def watched(folder: Path, **settings: Any) -> Iterator[tuple[Watched, Any]]:
    """Yield a robot and the process of its controller, with a trajectory node."""
    arguments = ros_arguments(
        PAPER,
        **{f'{node}__pacing': 'realtime' for node in ('controller', 'trajectory')},
        **{f'{node}__control_period': PERIOD for node in ('controller', 'trajectory')},
        **{f'{node}__duration': 0.0 for node in ('controller', 'trajectory')},
        trajectory__start_time=-1.0,
        **{
            # A fixed position in front of the robot.
            'trajectory__line_sine.offset': f'[{AWAY}, 0.5, {AWAY - 0.3}, 0.0]',
            'trajectory__line_sine.slope': '[0.0, 0.0, 0.0, 0.0]',
            'trajectory__line_sine.amplitude': '[0.0, 0.0, 0.0, 0.0]',
        },
        **{
            f'controller__{name}': value
            for name, value in {
                'law': 'smc',
                'switching': 'implicit',
                # The states are late: a faster disturbance estimate can run away.
                'observer_gain': 0.1,
                'model_scale': 1.0,
                'k_s1': 20.0,
                'k_s2': 20.0,
                'pose_source': 'odom',
                # The test, which is the robot, may be delayed for long.
                'state_timeout': 60.0,
                'estimator_bandwidth': 200.0,
                'torque_limit': '[2.0, 2.0, 4.0, 2.0]',
                # States 30 ms late and these limits: after a gap, torques reverse at the limits.
                'runaway_detection': False,
                **settings,
            }.items()
        },
    )
    with processes(folder) as started, peer(started.domain) as tester:
        robot = Watched(tester)
        controller = started.start('controller', *arguments)
        started.start('trajectory', *arguments)
        yield robot, controller
        assert robot.wrong == []
        assert 'Traceback' not in started.output()


@pytest.mark.slow
def test_controller_positions_only_need_velocity_estimation(tmp_path: Path) -> None:
    with watched(tmp_path) as (robot, controller):
        robot.tester.until(
            lambda: robot.figure('joint_states rejected') > 5,
            lambda: f'rejections: {robot.health}',
        )
        (line, *_) = controller.logged('ERROR', 'joint_states rejected')
        assert 'set velocity_source to estimated' in line
        assert robot.torques == []
        robot.tester.change('/controller', velocity_source='estimated')
        robot.moves_on()
        rejected = robot.reported('joint_states rejected')
        # Some robots send values that are not finite for unknown velocities.
        robot.velocities = lambda velocity: [float('nan'), *velocity[1:3], float('inf'), 1e3]
        robot.moves_on()
        assert robot.reported('joint_states rejected') == rejected
        # The robot reaches the reference without any measured velocity.
        robot.tester.until(
            lambda: len(robot.errors) > 1000 and np.abs(robot.errors[-1]).max() < 0.02,
            lambda: f'an error that is small: {robot.errors[-1:]}',
        )
        assert 'fault' not in ''.join(robot.controller_states)
        robot.velocities = lambda velocity: [0.0]
        robot.tester.until(lambda: robot.figure('joint_states rejected') > rejected, 'rejections')


def test_controller_missing_velocity_of_driven_joint_rejected(
    tmp_path: Path,
) -> None:
    with watched(tmp_path) as (robot, controller):
        robot.velocities = lambda velocity: [*velocity[:4], float('nan')]
        robot.tester.until(
            lambda: robot.figure('joint_states rejected') > 5,
            lambda: f'rejections: {robot.health}',
        )
        (line, *_) = controller.logged('ERROR', 'joint_states rejected')
        assert "velocity of 'wheel_left_joint' is not a finite number; set velocity_sou" in line
        assert robot.torques == []
        # Velocities that the controller does not use may be unknown.
        robot.velocities = lambda velocity: [float('nan'), *velocity[1:]]
        robot.moves_on()


@pytest.mark.slow
def test_controller_late_pose_accepted_missing_pose_rejected(
    tmp_path: Path,
) -> None:
    with watched(tmp_path, velocity_source='estimated') as (robot, controller):
        robot.moves_on()
        for _ in range(5):
            robot.is_on = False
            time.sleep(0.3)  # time without messages
            stamp = time.time_ns()
            robot.publish_state(stamp)
            robot.publish_pose(stamp)
            robot.tester.until(lambda s=stamp: robot.answered[-1] == s, 'an answer')
            robot.is_on = True
            robot.moves_on(20)
        assert np.isnan(robot.reported('joint_states rejected')), robot.health
        robot.publishes_pose = False
        robot.tester.until(lambda: robot.figure('joint_states rejected') > 5, 'rejections')
        assert controller.logged('ERROR', 'joint_states rejected: odom is 0.')
        robot.publishes_pose = True
        robot.moves_on()


def test_controller_late_states_answered_age_reported(tmp_path: Path) -> None:
    with watched(tmp_path, velocity_source='estimated') as (robot, _):
        robot.moves_on()
        robot.tester.until(
            lambda: robot.figure('age of answered states, mean (ms)') >= 1e3 * LATE,
            lambda: f'the age of states: {robot.health}',
        )
        assert robot.figure('age of answered states, most (ms)') >= 1e3 * LATE
        assert 0.0 < robot.figure('mean tick (ms)') <= robot.figure('longest tick (ms)')
        assert robot.controller_states == ['active']


def test_controller_path_starts_elsewhere_first_torques_small(tmp_path: Path) -> None:
    """The approach starts at the robot's position; without it the first torques are large."""
    largest = {}
    for speed in (0.25, 0.0):
        folder = tmp_path / f'{speed}'
        folder.mkdir()
        settings = {'velocity_source': 'estimated', 'approach_speed': speed}
        with watched(folder, **settings) as (robot, _):
            robot.tester.until(
                lambda r=robot: r.answered and r.answered[-1] - r.answered[0] > FIRST, 'torques'
            )
            first = np.array(robot.answered) - robot.answered[0] <= FIRST
            largest[speed] = float(np.abs(np.array(robot.torques)[first]).max())
    assert largest[0.25] < 0.2 * largest[0.0]
