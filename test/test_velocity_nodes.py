# SPDX-License-Identifier: Apache-2.0
"""Commanded rates between real nodes: lock-step, real time, bad messages, disagreement."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import math
from pathlib import Path
import signal
from typing import Any

import pytest

pytest.importorskip('rclpy')

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist, TwistStamped
from log_contents import read_log
import numpy as np
from processes import NODES, PAPER, Peer, peer, Processes, processes, ros_arguments
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from test_lockstep import DECIMATED_TOPICS, SHOWN_TOPICS, simulated, TICK_TOPICS

from masmc_ros.cli.main import main
from masmc_ros.log.cdr import ArmVelocityCdr, JointStateCdr, TwistCdr, TwistStampedCdr
from masmc_ros.log.reader import read_run

TOPICS = (
    'cmd_vel',
    'arm_velocity_commands',
    *(topic for topic in (*TICK_TOPICS, *DECIMATED_TOPICS, *SHOWN_TOPICS)
      if topic != 'effort_commands'),
)
RATES = {'plant__command_interface': 'velocity', 'controller__command_interface': 'velocity'}
STAMPED = {f'{node}__enable_stamped_cmd_vel': 'true' for node in ('plant', 'controller')}

ANOTHER = """
/**:
  ros__parameters:
    control_period: 0.002
    duration: 1.0
    frame_prefix: left/
    robot: {half_track: 0.2, com_offset: 0.03}
/**/plant:
  ros__parameters:
    wait_for: [controller]
    command_interface: velocity
    enable_stamped_cmd_vel: true
    torque_limit: [8.0, 8.0, 20.0, 10.0]
    velocity_noise: 0.01
    encoder_resolution: 0.001
    robot: {wheel_radius: 0.07}
/**/controller:
  ros__parameters:
    command_interface: velocity
    enable_stamped_cmd_vel: true
    velocity_source: estimated
    sigma: [3.0, 3.0, 2.0, 2.0]
"""


def settings_of(settings: dict[str, str]) -> list[str]:
    """Return ROS settings as those of the simulation."""
    return [f'{name.replace("__", ".")}={value}' for name, value in settings.items()]


def check_recomputed(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Compute a recorded run again: not a bit differs."""
    capsys.readouterr()
    assert main(['simulate', str(log)]) == 0
    assert 'are the same bits' in capsys.readouterr().out.splitlines()[-1]


@pytest.mark.parametrize('stamped', [{}, STAMPED], ids=['Twist', 'TwistStamped'])
def test_lockstep_gives_the_bits_of_the_simulation(
    stamped: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = {**RATES, **stamped}
    log = tmp_path / 'live.mcap'
    with processes(tmp_path) as started:
        arguments = ros_arguments(
            PAPER,
            **{f'{node}__duration': 1.0 for node in NODES},
            plant__wait_for='[controller, trajectory, recorder]',
            recorder__output=log,
            **settings,
        )
        started.start_all(*arguments)
        assert set(started.wait().values()) == {0}, started.output()
    contents = read_log(log)
    computed = simulated(
        PAPER, tmp_path / 'simulated.mcap', 'duration=1.0', *settings_of(settings)
    )
    for topic in TOPICS:
        assert contents.messages[topic] == computed[topic], topic
    assert len(computed['cmd_vel']) == len(computed['arm_velocity_commands']) == 1001
    assert not contents.messages['effort_commands']
    assert 'effort_commands' not in computed
    check_recomputed(log, capsys)
    check_recomputed(tmp_path / 'simulated.mcap', capsys)


def test_another_robot_in_lockstep_in_one_process(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A base with other wheels than the controller believes turns them as its own need it."""
    file, log = tmp_path / 'other.yaml', tmp_path / 'live.mcap'
    file.write_text(ANOTHER)
    with processes(tmp_path) as started:
        arguments = ros_arguments(
            file, plant__wait_for='[controller, trajectory, recorder]', recorder__output=log
        )
        started.start('composed', '--record', *arguments)
        assert started.wait() == {'composed': 0}, started.output()
    live, computed = read_log(log).messages, simulated(file, tmp_path / 'simulated.mcap')
    for topic in TOPICS:
        assert live[topic] == computed[topic], topic
    assert b'left/base_link' in live['cmd_vel'][0]
    check_recomputed(log, capsys)
