# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Nodes of launch/hardware.launch.py with stand-ins for a mobile manipulator and an arm."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
import signal
from typing import Any

from geometry_msgs.msg import TwistStamped
from helpers.command_process import COMPILING
from helpers.foreign_robot import Watched
from helpers.launch_file import launched, ROOT
from helpers.log_contents import read_log
from helpers.processes import peer, processes
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from masmc_ros.log.read.reader import read_run
from masmc_ros.robot.dead_reckoning import DeadReckoning
from masmc_ros.robot.mechanisms import driven_joint_names
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest
import yaml

EXAMPLE = yaml.safe_load((ROOT / 'config' / 'ros2_control_example.yaml').read_text('utf-8'))
GROUPS = {'tiago': 'arm_effort', 'ur5': 'table_arm_effort'}
"""Group controllers of the example by parameter file."""

PERIOD = 1.0 / EXAMPLE['controller_manager']['ros__parameters']['update_rate']

needs_robots = pytest.mark.skipif(
    find_spec('pinocchio') is None, reason='the URDFs are part of the extra `robots`'
)


@needs_robots
@pytest.mark.parametrize('name', GROUPS)
def test_ros2_control_example_fits_the_robot(name: str) -> None:
    values = load_scenario(str(ROOT / 'config' / f'{name}.yaml'))['controller']
    wheels = len(values.get('robot.wheels', ()))
    joints = EXAMPLE[GROUPS[name]]['ros__parameters']['joints']
    assert tuple(joints) == driven_joint_names(values)[wheels:]
    if wheels:
        base = EXAMPLE['diff_drive_controller']['ros__parameters']
        names = *base['right_wheel_names'], *base['left_wheel_names']
        assert names == values['robot.wheels']
        reckoning = DeadReckoning(robot_of(values))
        turned = np.zeros((3, len(values['robot.joint_names'])))
        turned[1:, 3], turned[1:, 4] = (0.1, 0.2), (0.1, 0.0)
        for stamp, position in enumerate(turned):
            reckoning.add(stamp, position)
        forward, turn = reckoning.motion(0, 1), reckoning.motion(1, 2)
        assert forward is not None
        assert turn is not None
        radius = base['wheel_radius']
        assert forward == pytest.approx((0.1 * radius, 0.0, 0.0))
        assert turn[2] == pytest.approx(0.2 * radius / base['wheel_separation'], rel=1e-3)


@contextmanager
def hardware(
    folder: Path, name: str, robot: dict[str, Any], **arguments: str
) -> Iterator[tuple[Watched, Path]]:
    """Yield a stand-in with the nodes of the launch file, and the log of their recorder."""
    file, log = ROOT / 'config' / f'{name}.yaml', folder / 'run.mcap'
    topics = f'/{GROUPS[name]}/commands', '/diff_drive_controller/cmd_vel'
    started_nodes = launched(
        'hardware.launch.py',
        params_file=f'{file},{first_motion(folder, file)}',
        control_period=f'{PERIOD}',
        arm_commands=topics[0],
        output=str(log),
        **arguments,
    )
    with processes(folder) as started, peer(started.domain) as tester:
        watched = Watched(
            tester, file=file, period=PERIOD, has_brakes=True, topics=topics, **robot
        )
        # A joint_state_broadcaster publishes velocities.
        watched.velocities = lambda velocity: velocity
        for executable, options in started_nodes:
            started.start(executable, *options)
        yield watched, log
        assert watched.wrong == []
        started.signal(signal.SIGINT)
        assert set(started.wait().values()) == {0}, started.output()
        assert 'Traceback' not in started.output()


def first_motion(folder: Path, file: Path) -> Path:
    """Return a file with the settings of a first torque, and with the path at half the speed."""
    controller = {
        'law': 'computed_torque',
        'computed_torque.k_d': 20.0,
        'computed_torque.k_p': 100.0,
        'model_scale': 1.0,
        # The robot, which is this process, may be delayed, and torques are then held too long.
        'state_timeout': 3.0,
        'runaway_detection': False,
    }
    frequency = load_scenario(str(file))['trajectory']['line_sine.frequency']
    trajectory = {'line_sine.frequency': [0.5 * entry for entry in frequency]}
    blocks = {'controller': controller, 'trajectory': trajectory}
    settings = {f'/**/{node}': {'ros__parameters': block} for node, block in blocks.items()}
    later = folder / 'first_motion.yaml'
    later.write_text(yaml.safe_dump(settings), encoding='utf-8')
    return later


def activate(robot: Watched) -> None:
    """Activate the controller when the recorder receives its commands."""
    robot.tester.until(lambda: robot.controller_states, 'the state of the controller', COMPILING)
    count = robot.tester.node.count_subscribers
    commands = robot.topics if robot.is_hybrid else robot.topics[:1]
    robot.tester.until(lambda: all(count(topic) > 1 for topic in commands), 'the recorder')
    assert robot.controller_states == ['inactive: not enabled yet']
    request = ChangeState.Request(transition=Transition(label='activate'))
    assert robot.tester.call(ChangeState, '/controller/change_state', request, again=False).success


def check_followed(robot: Watched, seconds: float, tolerance: float) -> None:
    """Wait until the tip has followed its path for a time, within a tolerance in m."""
    count = round(seconds / PERIOD)
    robot.tester.until(
        lambda: (
            len(robot.errors) > count
            and np.linalg.norm(np.array(robot.errors[-count:])[:, :3], axis=1).max() < tolerance
        ),
        lambda: f'small errors: {robot.errors[-1:]}, {robot.controller_states}, {robot.health}',
    )
    assert robot.controller_states == ['inactive: not enabled yet', 'active']


@needs_robots
@pytest.mark.slow
def test_hardware_launch_mobile_manipulator_follows_path(tmp_path: Path) -> None:
    """
    Base by stamped twists, arm by torques, odometry at a quarter of the rate of the joints.

    The robot has its own clock, as in a simulator.
    """
    robot = {
        'is_hybrid': True,
        'has_clock': True,
        'twist_type': TwistStamped,
        'settings': ('plant.base_lag=0.05', 'plant.command_delay=0.005'),
    }
    arguments = {
        'command_interface': 'hybrid',
        'pose_source': 'odom',
        'base_lag': '0.05',
        'use_sim_time': 'true',
    }
    with hardware(tmp_path, 'tiago', robot, **arguments) as (watched, log):
        activate(watched)
        check_followed(watched, 5.0, 0.01)
        assert np.abs(watched.velocities_seen)[:, :2].max() > 0.01
    assert read_log(log).messages['diff_drive_controller/cmd_vel']


@needs_robots
@pytest.mark.slow
def test_hardware_launch_arm_on_table_follows_path(tmp_path: Path) -> None:
    """Torques with a latency that the controller knows."""
    limits = [150.0, 150.0, 150.0, 28.0, 28.0, 28.0]
    robot = {'late': 0.0, 'settings': ('plant.command_delay=0.005',)}
    arguments = {'latency': '0.01', 'torque_limit': str(limits)}
    with hardware(tmp_path, 'ur5', robot, **arguments) as (watched, log):
        activate(watched)
        check_followed(watched, 5.0, 0.005)
        assert (np.abs(watched.torques) <= limits).all()
    # No driver of an arm publishes joints of its base.
    assert not read_run(log).position[:, :3].any()
    assert read_log(log).messages['table_arm_effort/commands']
