# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Third-party robot: positions only, other joint order, odometry, its own clock, late states."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import time
from typing import Any

from helpers.foreign_robot import LATE, PERIOD, Watched
from helpers.processes import PAPER, peer, processes, ros_arguments
import numpy as np
import pytest

FIRST = 100_000_000
"""Duration of the first torques in ns."""

AWAY = 0.3
"""Distance in m from the robot to the start of the path."""


@contextmanager
def watched(
    folder: Path, *, is_hybrid: bool = False, **settings: Any
) -> Iterator[tuple[Watched, Any]]:
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
        robot = Watched(tester, is_hybrid=is_hybrid)
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
        assert robot.figure('largest torque (N·m)') >= 0.0
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


HYBRID = {
    'is_hybrid': True,
    'command_interface': 'hybrid',
    'velocity_source': 'estimated',
    'pose_frame': 'map',
}


@pytest.mark.slow
def test_controller_foreign_base_and_arm_reach_reference(tmp_path: Path) -> None:
    """Joint states in another order, odometry at a quarter of their rate, cmd_vel and efforts."""
    with watched(tmp_path, **HYBRID) as (robot, _):
        robot.correction[:2] = 0.1, -0.05
        robot.tester.until(
            lambda: len(robot.errors) > 1000 and np.abs(robot.errors[-1]).max() < 0.02,
            lambda: f'an error that is small: {robot.errors[-1:]}, {robot.health}',
        )
        assert robot.controller_states == ['active']
        assert max(np.abs(torque).max() for torque in robot.torques) <= 4.0
        # The path is in the frame `map`.
        assert np.abs(robot.task_position - [AWAY, 0.5, AWAY - 0.3, 0.0]).max() < 0.05


@pytest.mark.slow
def test_controller_jump_of_map_is_approached(tmp_path: Path) -> None:
    with watched(tmp_path, **HYBRID) as (robot, controller):

        def is_near() -> bool:
            return len(robot.errors) > 600 and bool(np.abs(robot.errors[-1]).max() < 0.01)

        robot.tester.until(is_near, lambda: f'an error that is small: {robot.errors[-1:]}')
        calm, count = len(robot.torques), len(robot.velocities_seen)
        robot.correction[:2] += 0.05
        robot.tester.until(
            lambda: controller.logged('INFO', 'the pose jumped'), 'the jump in the log'
        )
        robot.moves_on(600)
        robot.tester.until(is_near, lambda: f'an error that is small: {robot.errors[-1:]}')
        assert max(np.abs(torque).max() for torque in robot.torques[calm:]) <= 4.0
        speeds = np.abs(robot.velocities_seen[count:])
        assert np.hypot(*speeds[:, :2].T).max() < 0.4
        assert 'fault' not in ''.join(robot.controller_states)


@pytest.mark.slow
@pytest.mark.parametrize(
    ('source', 'name'), [('publishes_pose', 'odom'), ('publishes_states', 'joint_states')]
)
def test_controller_stale_source_is_fault_with_its_name(
    tmp_path: Path, source: str, name: str
) -> None:
    with watched(tmp_path, **HYBRID, state_timeout=0.3) as (robot, _):
        robot.moves_on()
        setattr(robot, source, False)
        robot.tester.until(
            lambda: f'fault: no usable {name} for 0.3 s' in robot.controller_states,
            lambda: f'a fault: {robot.controller_states}',
        )
        setattr(robot, source, True)
        robot.moves_on()
