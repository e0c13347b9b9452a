# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""A robot of its own: positions alone, joints in its order, odometry, its clock, late states."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from masmc_ros.loop.simulated_robot import SimulatedRobot
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.messages.names import JOINTS
from masmc_ros.robot.robot import robot_of
from masmc_ros.robot.two_link.platform_motion import base_motion as platform_motion
from masmc_ros.scenario.scenario import load_scenario
from nav_msgs.msg import Odometry
import numpy as np
from processes import PAPER, Peer, peer, processes, ros_arguments
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

PERIOD = 0.005
LATE = 0.03
"""How old states are when they are sent, in s."""

ORDER = [6, 3, 5, 4]
"""The driven joints as the robot lists them."""

MOST_TICKS = 4
"""Ticks that the robot makes up for; while the test is held up for longer, so is its robot."""

WATCHDOG = 0.1
"""Time in s without a command after which the robot has no torque."""

FIRST = 100_000_000
"""For how long torques are the first ones, in ns."""

AWAY = 0.3
"""How far ahead of the robot the path begins, in m."""


class Robot:
    """
    A robot by the wall clock: a state every period, of what the commands made of it.

    Attributes
    ----------
    velocities
        what it says of its velocities, given the joints' order.
    is_on
        whether it does anything by itself.
    tells_pose
        whether it tells where its platform is.
    torques
        every torque commanded, N m.
    answered
        the stamps in ns of the states that they answer.
    wrong
        commands that are not four finite numbers.

    """

    def __init__(self, tester: Peer) -> None:
        # Until it is commanded, the robot is at rest.
        calm = ('plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',)
        values = load_scenario(str(PAPER), calm)['plant']
        self._robot = SimulatedRobot(robot_of(values), PERIOD, values)
        self._begun = time.monotonic()
        self._command, self._torque = EffortCdr(), np.zeros(4)
        self._commanded = self._begun
        self._states = tester.publisher(JointState, 'joint_states')
        self._odometry = tester.publisher(Odometry, 'odom')
        self.velocities: Any = lambda velocity: []
        self.is_on = self.tells_pose = True
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
        """Bring the robot to the present and tell its state."""
        if not self.is_on:
            return
        ticks = int((time.monotonic() - self._begun) / PERIOD)
        if ticks <= self._robot.tick:
            return
        lost = max(0, ticks - self._robot.tick - MOST_TICKS)
        self._begun += lost * PERIOD
        # Its drives hold where nobody commands, as those of robots do.
        is_held = time.monotonic() - self._commanded > WATCHDOG
        while self._robot.tick < ticks - lost:
            self._robot.advance(None if is_held else self._torque)
        stamp = time.time_ns() - round(LATE * 1e9)
        if self.tells_pose:
            self.tell_pose(stamp)
        self.tell_state(stamp)

    def tell_state(self, stamp: int) -> None:
        state = JointState(name=['gripper', *(JOINTS[i] for i in ORDER)])
        state.header.stamp.sec, state.header.stamp.nanosec = divmod(stamp, 10**9)
        state.position = [0.5, *self._robot.position[ORDER].tolist()]
        state.velocity = self.velocities([0.0, *self._robot.velocity[ORDER].tolist()])
        self._states.publish(state)

    def tell_pose(self, stamp: int) -> None:
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
    The robot, and what its controller says.

    Attributes
    ----------
    told
        what the controller told of its state.
    health
        what it reported last.
    errors
        tracking errors in m.

    """

    def __init__(self, tester: Peer) -> None:
        super().__init__(tester)
        self.tester = tester
        self.told: list[str] = []
        self.health: dict[str, str] = {}
        self._reported = 0
        self.errors: list[np.ndarray] = []
        tester.subscribe(String, 'controller/state', lambda m: self.told.append(m.data))
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
        """Return a figure of a report that was made from now on."""
        now = time.time_ns()
        self.tester.until(lambda: self._reported > now, 'a report')
        return self.figure(name)

    def moves_on(self, count: int = 300) -> None:
        """Wait for so many torques more."""
        before = len(self.torques)
        self.tester.until(
            lambda: len(self.torques) > before + count and self.told[-1:] == ['active'],
            lambda: f'torques; {self.told}, {self.health}',
        )

    def _on_health(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.endswith('controller'):
                self.health = {each.key: each.value for each in status.values}
                made = message.header.stamp
                self._reported = made.sec * 10**9 + made.nanosec


@contextmanager
def watched(folder: Path, **settings: Any) -> Iterator[tuple[Watched, Any]]:
    """Yield a robot, and the process of its controller; its trajectory runs beside them."""
    arguments = ros_arguments(
        PAPER,
        **{f'{node}__pacing': 'realtime' for node in ('controller', 'trajectory')},
        **{f'{node}__control_period': PERIOD for node in ('controller', 'trajectory')},
        **{f'{node}__duration': 0.0 for node in ('controller', 'trajectory')},
        trajectory__start_time=-1.0,
        **{
            # A place, ahead of the robot.
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
                # However long the test is held up, which is the robot.
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
def test_positions_alone_are_refused_with_the_remedy_and_then_enough(tmp_path: Path) -> None:
    with watched(tmp_path) as (robot, controller):
        robot.tester.until(
            lambda: robot.figure('joint_states rejected') > 5,
            lambda: f'refusals: {robot.health}',
        )
        (line, *_) = controller.logged('ERROR', 'joint_states rejected')
        assert 'set velocity_source to estimated' in line
        assert robot.torques == []
        robot.tester.change('/controller', velocity_source='estimated')
        robot.moves_on()
        refused = robot.reported('joint_states rejected')
        # Some robots give no number where they have none.
        robot.velocities = lambda velocity: [float('nan'), *velocity[1:3], float('inf'), 1e3]
        robot.moves_on()
        assert robot.reported('joint_states rejected') == refused
        # It goes where it is to go, although nobody ever told it how fast it is.
        robot.tester.until(
            lambda: len(robot.errors) > 1000 and np.abs(robot.errors[-1]).max() < 0.02,
            lambda: f'an error that is small: {robot.errors[-1:]}',
        )
        assert 'fault' not in ''.join(robot.told)
        robot.velocities = lambda velocity: [0.0]
        robot.tester.until(lambda: robot.figure('joint_states rejected') > refused, 'refusals')


def test_velocities_that_are_partly_unknown_are_refused_where_they_are_needed(
    tmp_path: Path,
) -> None:
    with watched(tmp_path) as (robot, controller):
        robot.velocities = lambda velocity: [*velocity[:4], float('nan')]
        robot.tester.until(
            lambda: robot.figure('joint_states rejected') > 5,
            lambda: f'refusals: {robot.health}',
        )
        (line, *_) = controller.logged('ERROR', 'joint_states rejected')
        assert "velocity of 'wheel_left_joint' is not a finite number; set velocity_sou" in line
        assert robot.torques == []
        # What is not asked for may be unknown.
        robot.velocities = lambda velocity: [float('nan'), *velocity[1:]]
        robot.moves_on()


@pytest.mark.slow
def test_a_pose_that_comes_after_its_state_is_no_refusal_and_one_that_does_not_is(
    tmp_path: Path,
) -> None:
    with watched(tmp_path, velocity_source='estimated') as (robot, controller):
        robot.moves_on()
        for _ in range(5):
            robot.is_on = False
            time.sleep(0.3)  # for how long nothing is told
            stamp = time.time_ns()
            robot.tell_state(stamp)
            robot.tell_pose(stamp)
            robot.tester.until(lambda s=stamp: robot.answered[-1] == s, 'an answer')
            robot.is_on = True
            robot.moves_on(20)
        assert np.isnan(robot.reported('joint_states rejected')), robot.health
        robot.tells_pose = False
        robot.tester.until(lambda: robot.figure('joint_states rejected') > 5, 'refusals')
        assert controller.logged('ERROR', 'joint_states rejected: odom is 0.')
        robot.tells_pose = True
        robot.moves_on()


def test_late_states_are_answered_and_how_late_is_told(tmp_path: Path) -> None:
    with watched(tmp_path, velocity_source='estimated') as (robot, _):
        robot.moves_on()
        robot.tester.until(
            lambda: robot.figure('age of answered states, mean (ms)') >= 1e3 * LATE,
            lambda: f'the age of states: {robot.health}',
        )
        assert robot.figure('age of answered states, most (ms)') >= 1e3 * LATE
        assert 0.0 < robot.figure('mean tick (ms)') <= robot.figure('longest tick (ms)')
        assert robot.told == ['active']


def test_the_first_torques_do_not_jump_at_a_path_that_is_away(tmp_path: Path) -> None:
    """It starts from where the robot is; without the approach the same torques are large."""
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
