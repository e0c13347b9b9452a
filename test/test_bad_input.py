# SPDX-License-Identifier: Apache-2.0
"""Bad input: one clear line, status 2, nothing left behind; offline and in the nodes alike."""

from __future__ import annotations

from pathlib import Path

from live_nodes import nodes, PAPER
import pytest

from masmc_ros.cli.main import main

CONTROLLER = '/**/controller:\n  ros__parameters:\n    '
PLANT = '/**/plant:\n  ros__parameters:\n    '
TRAJECTORY = '/**/trajectory:\n  ros__parameters:\n    '
ALL = '/**:\n  ros__parameters:\n    '

FILES = {
    'unknown key': (CONTROLLER + 'k_s3: 1.0\n', 'controller', "unknown parameter 'k_s3'"),
    'wrong type': (CONTROLLER + 'k_s1: fast\n', 'controller', 'k_s1 = fast: expected a number'),
    'wrong length': (CONTROLLER + 'k_s1: [1.0, 2.0]\n', 'controller', 'a number or 4 numbers'),
    'short array': (PLANT + 'initial_pose: [0.0, 0.0]\n', 'plant', '3 numbers'),
    'negative mass': (ALL + 'robot.link_2_mass: -1.0\n', 'plant', 'a number > 0'),
    'not a number': (CONTROLLER + 'sigma: .nan\n', 'controller', 'sigma = .nan'),
    'integer for a double': (ALL + 'control_period: 1\n', 'plant', 'write 1.0'),
    'mixed array': (CONTROLLER + 'k_s1: [1, 2.0, 3, 4]\n', 'controller', 'k_s1'),
    'broken YAML': (CONTROLLER + 'k_s1: [1.0,\n', 'controller', 'bad.yaml:'),
    'unknown law': (CONTROLLER + 'law: pid\n', 'controller', 'smc, rasmc'),
    'unknown trajectory': (TRAJECTORY + 'type: circle\n', 'trajectory', 'line_sine'),
    'out of reach': (
        TRAJECTORY + 'line_sine.offset: [1.5, 0.5, 0.0, 0.0]\n',
        'trajectory',
        'outside its reach',
    ),
    'arm on the axle': (ALL + 'robot.arm_offset: 0.0\n', 'plant', 'robot.arm_offset'),
}


def one_line(text: str, expected: str) -> None:
    lines = [line for line in text.splitlines() if line.strip()]
    assert len(lines) == 1, text
    assert expected in lines[0]


@pytest.mark.parametrize('case', FILES)
def test_simulate_refuses_files(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, _, expected = FILES[case]
    file = tmp_path / 'bad.yaml'
    file.write_text(text)
    log = tmp_path / 'run.mcap'
    assert main(['simulate', str(file), '--set', 'duration=0.1', '--output', str(log)]) == 2
    captured = capsys.readouterr()
    one_line(captured.err, expected)
    assert captured.out == ''
    assert [path.name for path in tmp_path.iterdir()] == ['bad.yaml']


@pytest.mark.parametrize('case', FILES)
def test_nodes_refuse_files(case: str, tmp_path: Path) -> None:
    pytest.importorskip('rclpy')
    text, node, expected = FILES[case]
    file = tmp_path / 'bad.yaml'
    file.write_text(text)
    with nodes(tmp_path) as started:
        process = started.start(node, '--ros-args', '--params-file', str(file))
        assert process.wait(60.0) == 2
        one_line(started.output().split('\n', 1)[1], expected)


@pytest.mark.parametrize(
    ('arguments', 'expected'),
    [
        (['--params-file', '/does/not/exist.yaml'], 'no such file'),
        (['-p', 'k_s1'], 'NAME:=VALUE'),
        (['-p', 'k_s9:=1.0'], "unknown parameter 'k_s9'"),
        (['-p', 'k_s1:=-1.0'], 'k_s1 = -1.0: expected a number or 4 numbers, each >= 0'),
    ],
)
def test_nodes_refuse_command_lines(arguments: list[str], expected: str, tmp_path: Path) -> None:
    pytest.importorskip('rclpy')
    with nodes(tmp_path) as started:
        process = started.start('controller', '--ros-args', *arguments)
        assert process.wait(60.0) == 2
        one_line(started.output().split('\n', 1)[1], expected)


def test_the_recorder_refuses_a_place_that_cannot_be_written(tmp_path: Path) -> None:
    pytest.importorskip('rclpy')
    with nodes(tmp_path) as started:
        process = started.start(
            'recorder', '--ros-args', '-p', f'output:={tmp_path}/missing/run.mcap'
        )
        assert process.wait(60.0) == 2
        one_line(started.output().split('\n', 1)[1], 'does not exist')


@pytest.mark.parametrize(
    ('settings', 'expected'),
    [
        (['controller.k_s1'], 'expected NAME=VALUE'),
        (['controler.k_s1=1'], 'did you mean controller.k_s1'),
        (['controller.k_s9=1'], 'controller has no parameter'),
        (['controller.k_s1=[1.0'], '--set controller.k_s1=[1.0'),
        (['duration=0'], 'expected a length > 0 s'),
        (['controller.k_s1=1e9', 'controller.switching=sign'], 'diverged at t ='),
    ],
)
def test_simulate_refuses_settings(
    settings: list[str], expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = [word for setting in settings for word in ('--set', setting)]
    log = tmp_path / 'run.mcap'
    assert main(['simulate', str(PAPER), *options, '--output', str(log)]) == 2
    one_line(capsys.readouterr().err, expected)
    assert not list(tmp_path.iterdir())


def test_simulate_refuses_missing_files_and_places(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['simulate', str(tmp_path / 'none.yaml')]) == 2
    one_line(capsys.readouterr().err, 'no such file')
    log = tmp_path / 'missing' / 'run.mcap'
    assert main(['simulate', str(PAPER), '--output', str(log)]) == 2
    one_line(capsys.readouterr().err, 'does not exist')
    (tmp_path / 'run.mcap').write_text('mine')
    assert main(['simulate', str(PAPER), '--output', str(tmp_path / 'run.mcap')]) == 2
    one_line(capsys.readouterr().err, 'is there already')
    assert (tmp_path / 'run.mcap').read_text() == 'mine'


def test_report_refuses_what_is_no_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['report', str(PAPER), '--output', str(tmp_path / 'report')]) == 2
    one_line(capsys.readouterr().err, 'paper.yaml')
    assert not (tmp_path / 'report').exists()


def test_unknown_commands_and_nodes(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(['simulat'])
    assert ended.value.code == 2
    one_line(capsys.readouterr().err, 'simulate')
    assert main(['run', 'plnt']) == 2
    one_line(capsys.readouterr().err, 'did you mean plant')
