# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc robot`: what was read of a robot, in numbers that its file and URDF have."""

from __future__ import annotations

import json
from pathlib import Path

from masmc_ros.cli.main import main
import pytest
from small_tree import START, write_scenario

PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')


def test_of_the_papers_robot(capsys: pytest.CaptureFixture[str]) -> None:
    limit = 'controller.torque_limit=[8.0, 8.0, 20.0, 0.0]'
    assert main(['robot', PAPER, '--set', limit]) == 0
    told = capsys.readouterr().out
    assert 'robot: two_link, 7 base inertial parameters' in told
    assert 'arm_joint_1        0.785398 rad  20 N·m' in told
    assert 'arm_joint_2        -1.5708 rad   none' in told
    assert main(['robot', PAPER, '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    # The platform looks along y: F is arm_offset ahead, E two links further on.
    start = {axis['name']: axis['start'] for axis in found['task']}
    assert start['y_F'] == pytest.approx(0.116)
    assert start['x_E'] == pytest.approx(-0.514 * 0.5**0.5 + 0.362 * 0.5**0.5)
    assert found['joints'][0] == {
        'name': 'wheel_right_joint',
        'unit': 'rad',
        'start': 0.0,
        'torque_limit': None,
        'torque_unit': 'N·m',
    }


def test_of_a_urdf(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_scenario(tmp_path, [0.0] * 6, 1.0)
    assert main(['robot', str(path), '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert found['kind'] == 'tree'
    assert [joint['start'] for joint in found['joints']] == list(START)
    assert any(joint['lower'] is not None for joint in found['joints'])
    assert all(joint['lower'] is None for joint in found['joints'][:2])
    far = ', '.join(['0.0'] * (len(START) - 1))
    assert main(['robot', str(path), '--set', f'plant.initial_joints=[{far}, 99.0]']) == 0
    assert found['joints'][-1]['upper'] == 3.0
    assert 'outside of its limits at the start: hand_joint' in capsys.readouterr().out


def test_a_file_that_is_not_there_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['robot', 'nowhere.yaml']) == 2
    told = capsys.readouterr().err
    assert told.count('\n') == 1
    assert 'nowhere.yaml' in told
