# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc robot`: output of the values in a robot's parameter file and URDF."""

from __future__ import annotations

import json
from pathlib import Path

from helpers.small_tree import START, URDF, write_scenario
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
        'at_end': False,
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


def test_robot_mimic_and_end_of_range_are_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    urdf = tmp_path / 'robot.urdf'
    body = (
        '<link name="{}"><inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1"'
        ' iyz="0" izz="0.1"/></inertial></link>'
    )
    joint = (
        '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/>'
        '<limit lower="0" upper="1" effort="1" velocity="1"/>{3}</joint>'
    )
    parts = [body.format(name) for name in ('base', 'arm', 'finger')]
    parts += [
        joint.format('elbow', 'base', 'arm', ''),
        joint.format('grip', 'arm', 'finger', '<mimic joint="elbow" offset="0.25"/>'),
    ]
    urdf.write_text(f'<robot name="r">{"".join(parts)}</robot>')
    file = tmp_path / 'robot.yaml'
    file.write_text(f'/**: {{ros__parameters: {{robot: {{urdf: {urdf}, task: joints}}}}}}')
    assert main(['robot', str(file)]) == 0
    text = ' '.join(capsys.readouterr().out.split())
    assert 'at the end of its range at the start: elbow' in text
    note = "mimic joint 'grip' limits 'elbow' to 0 to 0.75 rad"
    assert f'warning: {note}' in text
    assert main(['robot', str(file), '--json']) == 0
    robot = json.loads(capsys.readouterr().out)
    assert (robot['notes'], robot['joints'][0]['at_end']) == ([note], True)


def test_robot_urdf_alone_prints_choices_and_writes_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    urdf, file = tmp_path / 'small.urdf', tmp_path / 'robot.yaml'
    urdf.write_text(URDF, encoding='utf-8')
    assert main(['robot', str(urdf), '--write', str(file)]) == 0
    text = ' '.join(capsys.readouterr().out.split())
    assert 'robot.base = differential: two wheels on one axle, the right one first' in text
    assert f'written: {file}' in text
    assert 'total mass: 30.1 kg' in text
    assert main(['robot', str(urdf), '--write', str(file)]) == 2
    assert 'overwrite' in capsys.readouterr().err
    assert main(['robot', str(urdf), '--json']) == 0
    by_urdf = json.loads(capsys.readouterr().out)
    assert main(['robot', str(file), '--json']) == 0
    by_file = json.loads(capsys.readouterr().out)
    assert by_urdf.pop('choices')
    assert not by_file.pop('choices')
    assert by_urdf == by_file


def test_robot_write_invalid_input_writes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    urdf, file = tmp_path / 'small.urdf', tmp_path / 'robot.yaml'
    urdf.write_text(URDF, encoding='utf-8')
    for arguments, message in (
        ([PAPER], 'is a parameter file already; expected a URDF'),
        ([str(urdf), '--set', 'controller.k_s1=-1.0'], 'k_s1'),
        ([str(urdf), '--set', 'robot.tip_frame=hnd'], "no link 'hnd'; did you mean hand?"),
        ([str(tmp_path / 'no.urdf')], 'no such file'),
    ):
        assert main(['robot', *arguments, '--write', str(file)]) == 2
        error = capsys.readouterr().err
        assert error.count('\n') == 1
        assert message in error
        assert not file.exists()


def test_robot_limit_below_gravity_is_a_warning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_scenario(tmp_path, [0.0] * 6, 1.0)
    weak = 'controller.torque_limit=[0.0, 0.0, 0.0, 50.0, 8.0, 0.0, 0.0]'
    assert main(['robot', str(path), '--set', weak]) == 0
    text = ' '.join(capsys.readouterr().out.split())
    # The lift carries 5.1 kg.
    assert 'limit below gravity at the start: lift_joint needs 50 N, limit 50 N' in text
    assert 'limit below gravity in a part of the range: lift_joint up to 50 N, limit 50 N;' in text


@pytest.mark.slow
def test_simulate_limit_below_gravity_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'small.urdf').write_text(URDF, encoding='utf-8')
    file = tmp_path / 'robot.yaml'
    limits = '{torque_limit: [0.0, 0.0, 0.0, 20.0, 0.0, 0.0, 0.0]'
    file.write_text(
        f"""/**:
  ros__parameters:
    robot: {{urdf: small.urdf, base: differential, task: joints,
            wheels: [wheel_right_joint, wheel_left_joint]}}
    duration: 0.5
/**/controller: {{ros__parameters: {limits}}}}}
/**/plant: {{ros__parameters: {limits},
             initial_joints: [0.0, 0.0, 0.3, -2.9, 0.7, 0.9, -0.4]}}}}
""",
        encoding='utf-8',
    )
    assert main(['simulate', str(file)]) == 0
    error = capsys.readouterr().err
    assert 'limit below gravity at the start: lift_joint needs 50 N, limit 20 N' in error
    assert 'torque of lift_joint at the limit' in error
    assert 'lift_joint by up to' in error
    assert 'close to singular' not in error
