# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Nodes with four mecanum wheels: the bits of a simulation, and torques of the wheels."""

from __future__ import annotations

from pathlib import Path
import subprocess
import sys

from helpers.child_environment import child_environment, domain
from helpers.core_loop import node_values
from helpers.log_contents import read_log
from helpers.processes import peer, processes, ros_arguments
from helpers.wheeled_tree import MECANUM_ANGLES, parameter_file, SKID, WEAK, WHEELS
from masmc_ros.loop.controller import Controller
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.nodes.controller.output import TorqueOutput
from masmc_ros.robot.mechanisms import driven_joint_names
from masmc_ros.robot.robot import robot_of
import numpy as np
import pytest
from std_msgs.msg import Float64MultiArray

INTERPRETED = {'NUMBA_DISABLE_JIT': '1'}
"""Bitwise identical, without a minute of compilation."""

TOPICS = ('joint_states', 'effort_commands', 'wheel_commands', 'tf')


@pytest.mark.slow
def test_mecanum_nodes_equal_simulation_bitwise(tmp_path: Path) -> None:
    """All messages; wheels have the forces on the base, and the weak one has less of them."""
    file = parameter_file(tmp_path, 'omnidirectional', ticks=20)
    live, offline = tmp_path / 'live.mcap', tmp_path / 'offline.mcap'
    with processes(tmp_path) as started:
        arguments = ros_arguments(
            file, recorder__output=live, plant__wait_for='[controller, trajectory, recorder]'
        )
        started.start('composed', '--record', *arguments, environment=INTERPRETED)
        assert started.wait() == {'composed': 0}, started.output()
    command = 'import sys; from masmc_ros.cli.main import main; sys.exit(main())'
    arguments = ['simulate', str(file), '--output', str(offline)]
    environment = {**child_environment(), **INTERPRETED}
    subprocess.run([sys.executable, '-c', command, *arguments], env=environment, check=True)
    expected, recorded = (read_log(log).messages for log in (offline, live))
    for topic in TOPICS:
        assert recorded[topic] == expected[topic], topic
        assert len(recorded[topic]) > 19, topic
    forces, torques = EffortCdr(('u', 'v', 'w', 'upper', 'hand')), EffortCdr(WHEELS)
    slopes, most = np.tan(MECANUM_ANGLES), np.zeros(4)
    for command, of_wheels in zip(
        expected['effort_commands'], expected['wheel_commands'], strict=True
    ):
        assert forces.load(command)
        assert torques.load(of_wheels)
        most = np.maximum(most, np.abs(torques.data))
        axes = np.array([1.0, 1.0, -1.0, 1.0])
        ahead = (axes * torques.data).sum() / 0.1
        sideways = (axes * slopes * torques.data).sum() / 0.1
        np.testing.assert_allclose([ahead, sideways], forces.data[:2], atol=1e-9)
    weak = WHEELS.index('rear_right_wheel_joint')
    assert 0.0 < most[weak] < WEAK
    assert most[weak] < np.delete(most, weak).min()


def test_repeated_command_contains_wheel_torques(tmp_path: Path) -> None:
    """The drives of the wheels otherwise wait for the answer to a repeated state."""
    (tmp_path / 'cart.urdf').write_text(SKID, encoding='utf-8')
    values = node_values({
        'robot.urdf': str(tmp_path / 'cart.urdf'),
        'robot.base': 'differential',
        'robot.wheels': list(WHEELS),
        'robot.task': ['planar'],
    })['controller']  # fmt: skip
    controller = Controller(robot_of(values), 0.01, values)
    output = TorqueOutput(controller, driven_joint_names(values))
    controller.torque[:] = 1.0, 2.0, 3.0, 4.0
    with domain() as number, peer(number) as node:
        both = [
            node.collect(Float64MultiArray, topic, past=False)
            for topic in ('effort_commands', 'wheel_commands')
        ]
        output.connect(node.publisher)
        for publisher in node.node.publishers:
            if publisher.msg_type is Float64MultiArray:
                node.wait_for_subscribers(publisher)
        output.send(10)
        output.repeat()
        node.until(lambda: all(len(messages) == 2 for messages in both))
    for first, second in both:
        assert first == second
    torques = both[1][0].data
    assert torques[0] + torques[1] == pytest.approx(1.0)
