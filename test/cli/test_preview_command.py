# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc preview`: margins of paths within and beyond the limits of the robot."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from masmc_ros.cli.main import main
import numpy as np
import pytest

CONFIG = Path(__file__).resolve().parents[2] / 'config'
PAPER = str(CONFIG / 'paper.yaml')


def previewed(
    capsys: pytest.CaptureFixture[str], *arguments: str, status: int = 0
) -> dict[str, Any]:
    """Return the JSON of a preview with this exit status."""
    capsys.readouterr()
    assert main(['preview', *arguments, '--json']) == status
    result: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert bool(result['violations']) == (status == 1)
    return result


def test_preview_of_paper_is_within_limits(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    picture = tmp_path / 'preview.png'
    result = previewed(capsys, PAPER, '--output', str(picture))
    assert picture.read_bytes().startswith(b'\x89PNG')
    assert result['slowdown'] is None
    # The path of E and F takes 0.2 m/s forward: 3.94 rad/s of the wheels.
    assert result['joints'][0]['speed'] == pytest.approx(0.2 / 0.0508, rel=0.05)
    assert all(point['error'] < 1e-6 for point in result['points'])
    assert main(['preview', PAPER]) == 0
    assert 'within all limits' in capsys.readouterr().out


def test_preview_beyond_limits_names_place_and_slowdown(
    capsys: pytest.CaptureFixture[str],
) -> None:
    eight = (
        '--set', 'trajectory.type=figure_eight', '--set', 'trajectory.figure_eight.delay=6.0',
        '--set', 'trajectory.figure_eight.duration=4.0', '--set', 'duration=10.0',
        '--set', 'robot.speed_limits=["arm_joint_2 0.6"]',
    )  # fmt: skip
    result = previewed(capsys, PAPER, *eight, status=1)
    (text,) = result['violations']
    assert text.startswith('arm_joint_2 moves at')
    assert '% above its limit' in text
    joint = result['joints'][3]
    assert joint['speed'] > joint['speed_limit'] == 0.6
    assert 6.0 < joint['speed_at'] < 10.0
    # Speeds are inversely proportional to the duration.
    assert result['slowdown'] == pytest.approx(joint['speed'] / 0.6, rel=0.02)
    assert main(['preview', PAPER, *eight]) == 1
    assert 'slow-down that suffices' in capsys.readouterr().out


def test_preview_out_of_reach_is_one_violation(capsys: pytest.CaptureFixture[str]) -> None:
    slope = 'trajectory.line_sine.slope=[0.3, 0.0, 0.2, 0.0]'
    result = previewed(capsys, PAPER, '--set', slope, status=1)
    assert 'outside its reach; expected 0.152 to 0.876 m' in result['violations'][0]
    assert result['joints'] == []


def test_preview_of_file_and_invalid_arguments(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    points = tmp_path / 'points.csv'
    points.write_text('time_s,x_E_m,y_E_m,x_F_m,y_F_m\n6,0.3,0.5,0,0\n12,0.4,0.6,0.1,0\n')
    result = previewed(capsys, PAPER, '--path', str(points))
    assert result['end'] == 20.0
    capsys.readouterr()
    assert main(['preview', PAPER, '--output', 'preview.txt']) == 2
    assert 'expected a name that ends with .png' in capsys.readouterr().err
    assert main(['preview', PAPER, '--set', 'duration=0.0']) == 2
    assert 'duration = 0.0: expected' in capsys.readouterr().err


def test_fastest_timing_keeps_speeds_and_accelerations(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    pytest.importorskip('toppra')
    # The robot starts at E = (-0.107, 0.736), F = (0, 0.116), and rests there first.
    start = [axis['start'] for axis in robot_task(capsys)]
    goal = [start[0] + 0.3, start[1] + 0.4, start[2], start[3] + 0.4]
    file, limit = tmp_path / 'fast.csv', 'robot.speed_limits=["wheel_right_joint 6.0"]'
    slow = (
        '--set', 'trajectory.type=waypoints', '--set', 'trajectory.waypoints.times=[0.0, 8.0]',
        '--set', f'trajectory.waypoints.points={start + goal}', '--set', 'duration=9.0',
    )  # fmt: skip
    result = previewed(
        capsys, PAPER, *slow, '--set', limit, '--fastest', str(file), '--acceleration', '5.0'
    )
    duration = result['fastest']['duration']
    assert 2.0 < duration < 4.0
    fast = previewed(
        capsys, PAPER, '--path', str(file), '--set', limit, '--set', f'duration={duration + 1.0}'
    )
    assert fast['start'] == 0.0
    assert 3.5 < max(joint['acceleration'] for joint in fast['joints']) < 5.0 * 1.05
    assert main(['preview', PAPER, '--fastest', str(file)]) == 2
    assert f'{file}: ' in capsys.readouterr().err


def robot_task(capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    """Return the task axes of the paper's robot with their values at the start."""
    capsys.readouterr()
    assert main(['robot', PAPER, '--json']) == 0
    task: list[dict[str, Any]] = json.loads(capsys.readouterr().out)['task']
    return task


@pytest.mark.slow
@pytest.mark.parametrize(('name', 'changed'), [
    ('ur5', 'frequency=[0.0, 8.0, 0.0, 0.0, 0.0, 0.0]'),
    ('tiago', 'frequency=[1.8, 0.6, 2.4, 0.5, 0.4, 0.0]'),
])  # fmt: skip
def test_preview_of_robots_of_a_urdf(
    name: str, changed: str, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip('pinocchio')
    file = str(CONFIG / f'{name}.yaml')
    result = previewed(capsys, file)
    assert result['start'] == 0.0
    for joint in result['joints']:
        assert joint['range_margin'] is None or joint['range_margin'] > 0.0
        assert joint['speed'] < joint['speed_limit']
        assert joint['torque'] < joint['torque_limit']
    fast = previewed(
        capsys, file, '--set', f'trajectory.line_sine.{changed}', '--set', 'duration=5.0', status=1
    )
    assert fast['slowdown'] > 1.0
    assert np.isfinite([joint['acceleration'] for joint in fast['joints']]).all()
