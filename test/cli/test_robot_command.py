# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc robot`: output of the values in a robot's parameter file and URDF."""

from __future__ import annotations

import json
from pathlib import Path

from helpers.small_tree import START, write_scenario
from masmc_ros.cli.main import main
import pytest

PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')


def test_robot_papers_robot_values_printed(capsys: pytest.CaptureFixture[str]) -> None:
    limit = 'controller.torque_limit=[8.0, 8.0, 20.0, 0.0]'
    assert main(['robot', PAPER, '--set', limit]) == 0
    text = capsys.readouterr().out
    assert 'robot: two_link, 7 base inertial parameters' in text
    assert 'arm_joint_1        0.785398 rad  20 N·m' in text
    assert 'arm_joint_2        -1.5708 rad   none' in text
    assert main(['robot', PAPER, '--json']) == 0
    summary = json.loads(capsys.readouterr().out)
    # The platform faces along y: F is at distance arm_offset, and E two links further.
    start = {axis['name']: axis['start'] for axis in summary['task']}
    assert start['y_F'] == pytest.approx(0.116)
    assert start['x_E'] == pytest.approx(-0.514 * 0.5**0.5 + 0.362 * 0.5**0.5)
    assert summary['joints'][0] == {
        'name': 'wheel_right_joint',
        'unit': 'rad',
        'start': 0.0,
        'torque_limit': None,
        'torque_unit': 'N·m',
    }


def test_robot_urdf_values_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_scenario(tmp_path, [0.0] * 6, 1.0)
    assert main(['robot', str(path), '--json']) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary['kind'] == 'tree'
    assert [joint['start'] for joint in summary['joints']] == list(START)
    assert any(joint['lower'] is not None for joint in summary['joints'])
    assert all(joint['lower'] is None for joint in summary['joints'][:2])
    far = ', '.join(['0.0'] * (len(START) - 1))
    assert main(['robot', str(path), '--set', f'plant.initial_joints=[{far}, 99.0]']) == 0
    assert summary['joints'][-1]['upper'] == 3.0
    assert 'outside of its limits at the start: hand_joint' in capsys.readouterr().out


def test_robot_missing_file_one_error_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['robot', 'nowhere.yaml']) == 2
    text = capsys.readouterr().err
    assert text.count('\n') == 1
    assert 'nowhere.yaml' in text
