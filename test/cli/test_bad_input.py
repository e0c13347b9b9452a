# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Invalid input: one line with the error, its location and the expected value; no output files.

The simulation and the node of each parameter get the same files.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
import subprocess
import sys

from helpers.child_environment import child_environment, domain, domain_variables
from helpers.command_process import PATIENCE, run_command
from masmc_ros.cli.main import main
import pytest

ROOT = Path(__file__).resolve().parents[2]
PAPER = str(ROOT / 'config' / 'paper.yaml')
Masmc = Callable[..., subprocess.CompletedProcess[str]]


@dataclass(frozen=True)
class BadFile:
    """
    Invalid parameter file.

    Attributes
    ----------
    node
        node that rejects it.
    block
        content of the node's block, or of the whole file if `is_whole`.
    words
        words in the error message.
    line
        line of the error in the file; None if the message has no line.

    """

    node: str
    block: str
    words: tuple[str, ...]
    line: int | None = 3
    is_whole: bool = False

    def text(self) -> str:
        return self.block if self.is_whole else f'/**/{self.node}:\n{_block(self.block)}'


def _block(values: str) -> str:
    lines = ''.join(f'    {line}\n' for line in values.splitlines())
    return f'  ros__parameters:\n{lines}'


def _shared(values: str) -> str:
    return f'/**:\n{_block(values)}'


BAD_FILES = {
    'unknown name': BadFile('controller', 'k_s3: 1.0', ('k_s3', 'k_s1')),
    'unknown shared name': BadFile(
        'plant', _shared('robot.weel_radius: 0.1'), ('weel_radius', 'wheel_radius'), is_whole=True
    ),
    'slip of a name of another node under a wildcard': BadFile(
        'plant', _shared('boundary_layr: 0.1'), ('boundary_layr', 'boundary_layer'), is_whole=True
    ),
    'quality of service': BadFile(
        'plant',
        'qos_overrides./joint_states.publisher.depth: 1',
        ('qos_overrides', 'quality of service'),
    ),
    'mixed array in quotes': BadFile(
        'controller', "gamma: '[1.0, 1, 1]'", ('gamma', '7 numbers', 'it has 3', 'point')
    ),
    'name of another node': BadFile('plant', 'law: smc', ('law',)),
    'wrong type': BadFile('controller', 'law: 3', ('law', '3', 'smc, rasmc')),
    'string for a number': BadFile('controller', 'k_s1: much', ('k_s1', 'much', '4 numbers')),
    'boolean for a number': BadFile('plant', 'integrator_step: true', ('integrator_step', 'true')),
    'double for an integer': BadFile(
        'plant', 'odom_decimation: 20.0', ('odom_decimation', '20.0', 'integer')
    ),
    'integer for a double': BadFile(
        'trajectory', _shared('duration: 2'), ('duration', '2', '2.0'), is_whole=True
    ),
    'integers for doubles': BadFile(
        'plant', 'initial_pose: [0, 0, 1]', ('initial_pose', '[0, 0, 1]', '[0.0, 0.0, 1.0]')
    ),
    'wrong length': BadFile(
        'plant', 'initial_velocity: [0.0, 0.0, 0.0]', ('initial_velocity', '4 numbers')
    ),
    'wrong length of gains': BadFile('controller', 'gamma: [1.0, 2.0]', ('gamma', '7 numbers')),
    'number for an array': BadFile('plant', 'torque_limit: 5.0', ('torque_limit', '4 numbers')),
    'negative mass': BadFile(
        'plant',
        _shared('robot:\n  link_2_mass: -1.0'),
        ('robot.link_2_mass', '-1.0', '> 0'),
        line=4,
        is_whole=True,
    ),
    'negative gain': BadFile(
        'controller', 'k_s2: [1.0, 1.0, -1.0, 1.0]', ('k_s2', '-1.0', '>= 0')
    ),
    'zero period': BadFile(
        'controller', _shared('control_period: 0.0'), ('control_period', '(0, 1]'), is_whole=True
    ),
    'not a number': BadFile('controller', 'k_s1: .nan', ('k_s1', '.nan')),
    'infinity': BadFile('plant', 'initial_pose: [0.0, .inf, 0.0]', ('initial_pose', '.inf')),
    'unknown law': BadFile('controller', 'law: lqr', ('law', 'lqr', 'smc, rasmc')),
    'unknown switching': BadFile('controller', 'switching: tan', ('switching', 'tan', 'tanh')),
    'unknown pacing': BadFile('plant', 'pacing: fast', ('pacing', 'lockstep, realtime')),
    'unknown trajectory': BadFile('trajectory', 'type: circle', ('type', 'circle', 'line_sine')),
    'times that do not ascend': BadFile(
        'trajectory',
        'type: waypoints\nwaypoints.times: [0.0, 2.0, 1.0]',
        ('waypoints.times', '1.0 follows 2.0', 'ascend'),
        line=None,
    ),
    'points for other times': BadFile(
        'trajectory',
        'type: waypoints\nwaypoints.times: [0.0, 2.0]',
        ('waypoints.points', '4 numbers', 'expected 8', 'x_E, y_E, x_F, y_F'),
        line=None,
    ),
    'negative time of a point': BadFile(
        'trajectory', 'waypoints.times: [-1.0]', ('waypoints.times', '-1.0', '>= 0')
    ),
    'arc about its start': BadFile(
        'trajectory', 'type: arc\narc.centre: [0.3, 0.5]', ('arc.start', 'axis'), line=None
    ),
    'out of reach': BadFile(
        'trajectory',
        'line_sine.offset: [3.0, 0.5, 0.0, 0.0]',
        ('t = 0 s', '3.041 m', '0.152 to 0.876 m'),
        line=None,
    ),
    'out of reach later': BadFile(
        'trajectory', 'line_sine.slope: [0.3, 0.0, 0.2, 0.0]', ('t = ', '0.876 m'), line=None
    ),
    'arm on the axle': BadFile(
        'plant', _shared('robot.arm_offset: 0.0'), ('arm_offset', '0:'), line=None, is_whole=True
    ),
    'unknown compression': BadFile('recorder', 'compression: gzip', ('compression', 'zstd')),
    'mixed array': BadFile(
        'controller', 'k_s1: [1, 2.0, 3.0, 4.0]', ('2.0', 'as one type'), line=3
    ),
    'broken YAML': BadFile('plant', '/**: {plant: ', ('not YAML',), line=None, is_whole=True),
    'tabs': BadFile('plant', '/**:\n\tros__parameters:\n', ('not YAML',), line=2, is_whole=True),
    'no node': BadFile(
        'controller', 'law: smc\n', ('smc', 'ros__parameters'), line=1, is_whole=True
    ),
    'alias': BadFile('controller', 'k_s1: &gain 1.0\nk_s2: *gain', ('*gain',), line=4),
}

each_bad_file = pytest.mark.parametrize('bad', BAD_FILES.values(), ids=BAD_FILES.keys())


@pytest.fixture(scope='module', autouse=True)
def ros_domain() -> Iterator[dict[str, str]]:
    """Yield the variables of a separate ROS domain for all processes of this file."""
    with domain() as number:
        yield domain_variables(number)


@pytest.fixture
def masmc(ros_domain: dict[str, str], tmp_path: Path) -> Masmc:
    """Return a function that runs the command in a separate process in the test's folder."""
    return partial(run_command, folder=tmp_path, environment={**child_environment(), **ros_domain})


def error_line(status: int, out: str, err: str) -> str:
    """Return the single error line about invalid input."""
    # The middleware prints errors about shared memory of killed processes.
    lines = [line for line in err.splitlines() if 'RTPS' not in line]
    assert status == 2, (status, out, err)
    assert len(lines) == 1, err
    assert 'Traceback' not in err
    assert out == ''
    return lines[0]


def check_message(message: str, bad: BadFile, path: Path) -> None:
    for word in bad.words:
        assert word in message, f'{word!r} is not in: {message}'
    if bad.line is not None:
        assert f'{path}:{bad.line}: ' in message


@each_bad_file
def test_simulate_invalid_file_rejected(
    bad: BadFile, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, log = tmp_path / 'bad.yaml', tmp_path / 'run.mcap'
    path.write_text(bad.text(), encoding='utf-8')
    status = main(['simulate', str(path), '--output', str(log)])
    captured = capsys.readouterr()
    check_message(error_line(status, captured.out, captured.err), bad, path)
    assert list(tmp_path.iterdir()) == [path]


@each_bad_file
def test_node_invalid_file_rejected(bad: BadFile, tmp_path: Path, masmc: Masmc) -> None:
    pytest.importorskip('rclpy')
    path = tmp_path / 'bad.yaml'
    path.write_text(bad.text(), encoding='utf-8')
    result = masmc('run', bad.node, '--ros-args', '--params-file', str(path))
    message = error_line(result.returncode, result.stdout, result.stderr)
    for word in bad.words:
        assert word in message, f'{word!r} is not in: {message}'
    # A recorder that rejects its parameters has not created a file, either.
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.slow
@pytest.mark.parametrize(
    'command', [('simulate',), ('run', 'plant', '--ros-args', '--params-file')]
)
def test_new_process_same_error_as_forked_process(
    command: tuple[str, ...], masmc: Masmc, ros_domain: dict[str, str], tmp_path: Path
) -> None:
    if command[0] == 'run':
        pytest.importorskip('rclpy')
    path = tmp_path / 'bad.yaml'
    path.write_text(BAD_FILES['negative mass'].text(), encoding='utf-8')
    forked = masmc(*command, str(path))
    result = subprocess.run(
        [sys.executable, '-m', 'masmc_ros.cli.main', *command, str(path)],
        cwd=tmp_path,
        env={**child_environment(), **ros_domain},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    message = error_line(result.returncode, result.stdout, result.stderr)
    assert message == error_line(forked.returncode, forked.stdout, forked.stderr)
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    'command', [('simulate',), ('run', 'plant', '--ros-args', '--params-file')]
)
@pytest.mark.parametrize('name', ['missing.yaml', 'missing/bad.yaml', '.'])
def test_missing_parameter_file_names_path(
    command: tuple[str, ...], name: str, masmc: Masmc
) -> None:
    if command[0] == 'run':
        pytest.importorskip('rclpy')
    result = masmc(*command, name)
    message = error_line(result.returncode, result.stdout, result.stderr)
    assert f'{name}: ' in message
    assert 'give the path of a parameter file' in message


SIMULATE = {
    'no value': (('--set', 'controller.k_s1'), 'NAME=VALUE'),
    'empty value': (('--set', 'controller.k_s1='), 'no value'),
    'unknown name': (('--set', 'controller.k_s3=1'), 'k_s1'),
    'unknown node': (('--set', 'controler.k_s1=1'), 'controller.k_s1'),
    'no node': (('--set', 'k_s1=1'), 'NODE.parameter'),
    'nothing like it': (('--set', 'xyzzy=1'), 'NODE.parameter'),
    'unknown shared name': (('--set', 'robot.weel_radius=0.1'), 'robot.wheel_radius'),
    'wrong type': (('--set', 'controller.law=3'), 'smc, rasmc'),
    'not YAML': (('--set', 'controller.k_s1=[1.0,'), 'not YAML'),
    'wrong length': (('--set', 'controller.k_s1=[1.0, 2.0]'), '4 numbers'),
    'negative mass': (('--set', 'robot.link_2_mass=-1'), '> 0'),
    'not a number': (('--set', 'plant.integrator_step=.nan'), 'integrator_step'),
    'endless': (('--set', 'duration=0'), 'duration'),
    'out of reach at the end': (
        ('--set', 'trajectory.line_sine.slope=[0.25, 0.0, 0.2, 0.0]'),
        '0.876',
    ),
    'diverges': (
        ('--set', 'control_period=0.01', '--set', 'controller.k_s1=100000', '--set', 'duration=5'),
        'diverged at t = ',
    ),
    'missing folder': (('--output', 'missing/run.mcap'), 'missing'),
    'folder as output': (('--output', '.'), 'folder'),
    'unwritable output': (('--output', '/proc/run.mcap'), 'cannot be written'),
    'unknown option': (('--outptu', 'run.mcap'), '--help'),
}


@pytest.mark.parametrize(('options', 'word'), SIMULATE.values(), ids=SIMULATE.keys())
def test_simulate_invalid_option_rejected(
    options: tuple[str, ...],
    word: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    log = () if '--output' in options else ('--output', 'run.mcap')
    try:
        status = main(['simulate', PAPER, *log, *options])
    except SystemExit as exit_:  # raised by argparse
        status = int(exit_.code or 0)
    captured = capsys.readouterr()
    message = error_line(status, captured.out, captured.err)
    assert word in message
    assert message.startswith('masmc')
    assert list(tmp_path.iterdir()) == []


NODE_ARGUMENTS = {
    'no value': ('controller', ('-p', 'k_s1'), 'NAME:=VALUE'),
    'empty value': ('controller', ('-p', 'k_s1:='), 'no value'),
    'unknown name': ('controller', ('-p', 'k_s3:=1.0'), 'k_s1'),
    'with its node': ('controller', ('-p', 'controller.k_s1:=5'), 'did you mean k_s1?'),
    'wrong type': ('controller', ('-p', 'law:=3'), 'smc, rasmc'),
    'not YAML': ('controller', ('-p', 'k_s1:=[1.0,'), 'not YAML'),
    'wrong length': ('controller', ('-p', 'k_s1:=[1.0, 2.0]'), '4 numbers'),
    'negative mass': ('plant', ('-p', 'robot.link_2_mass:=-1.0'), '> 0'),
    'integer for a double': ('plant', ('-p', 'duration:=2'), '2.0'),
    'not a number': ('plant', ('-p', 'integrator_step:=.nan'), 'integrator_step'),
    'of a node': ('composed', ('-p', 'plant:pacing:=fast'), 'lockstep, realtime'),
    'second file': ('plant', ('--params-file', PAPER, '--params-file', 'no.yaml'), 'no.yaml'),
    'missing folder': ('recorder', ('-p', 'output:=missing/run.mcap'), 'missing'),
    'missing folder for a folder': ('recorder', ('-p', 'output:=missing'), 'missing'),
    'unwritable output': ('recorder', ('-p', 'output:=/proc/run.mcap'), 'cannot be written'),
    'unknown ROS argument': ('plant', ('--bogus',), '--bogus'),
    'another name': ('controller', ('-r', '__node:=ctl'), '__ns:=/ctl'),
    'another name in one process': ('composed', ('-r', 'plant:__node:=p'), '__ns:=/p'),
    'quality of service': ('plant', ('-p', 'qos_overrides./tf.publisher.depth:=1'), 'fixed'),
    'parameter of rclpy': (
        'plant', ('-p', 'use_sim_time:=5'), 'plant: use_sim_time = 5: expected true or false'
    ),
    'bad namespace': ('plant', ('-r', '__ns:=/left//arm'), '/left//arm'),
}


@pytest.mark.parametrize(
    ('node', 'arguments', 'word'), NODE_ARGUMENTS.values(), ids=NODE_ARGUMENTS.keys()
)
def test_node_invalid_argument_rejected(
    node: str, arguments: tuple[str, ...], word: str, tmp_path: Path, masmc: Masmc
) -> None:
    pytest.importorskip('rclpy')
    result = masmc('run', node, '--ros-args', *arguments)
    message = error_line(result.returncode, result.stdout, result.stderr)
    assert word in message
    assert list(tmp_path.iterdir()) == []


def test_recorder_existing_log_kept(tmp_path: Path, masmc: Masmc) -> None:
    pytest.importorskip('rclpy')
    log = tmp_path / 'run.mcap'
    log.write_bytes(b'content')
    result = masmc('run', 'recorder', '--ros-args', '-p', f'output:={log}')
    message = error_line(result.returncode, result.stdout, result.stderr)
    assert 'run.mcap' in message
    assert 'overwrite' in message
    assert log.read_bytes() == b'content'


@pytest.mark.parametrize(
    ('arguments', 'word'),
    [
        (('run', 'plantt'), 'did you mean plant'),
        (('run', 'xyzzy'), 'plant, trajectory, controller, recorder, play, composed'),
        (('simulat', PAPER), 'simulate'),
        (('simulate',), '--help'),
        (('run',), '--help'),
        (('report', 'missing.mcap'), 'missing.mcap'),
    ],
)
def test_masmc_invalid_command_rejected(
    arguments: tuple[str, ...], word: str, tmp_path: Path, masmc: Masmc
) -> None:
    result = masmc(*arguments)
    assert word in error_line(result.returncode, result.stdout, result.stderr)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    'arguments',
    [
        ('composed', '--recrod'),
        ('plant', 'k_s1:=150.0'),
        ('plant', '-p', 'duration:=1.0'),
        ('plant', '--ros-args', '-p', 'duration:=1.0', '--', '--recrod'),
    ],
)
def test_node_unknown_argument_rejected(arguments: tuple[str, ...], masmc: Masmc) -> None:
    """Otherwise the run would use defaults, or no recorder, without a message."""
    pytest.importorskip('rclpy')
    result = masmc('run', *arguments)
    message = error_line(result.returncode, result.stdout, result.stderr)
    assert next(a for a in reversed(arguments) if a.strip('-')) in message or '-p' in message
    assert '--ros-args' in message


def test_simulate_use_sim_time_in_file_accepted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The simulation accepts the parameters that rcl declares automatically."""
    path = tmp_path / 'good.yaml'
    path.write_text(_shared('use_sim_time: false\nduration: 0.01'), encoding='utf-8')
    assert main(['simulate', str(path)]) == 0
    assert capsys.readouterr().err == ''


@pytest.mark.parametrize(
    'setting', ['plant:command_interface:=velocity', 'controller:enable_stamped_cmd_vel:=true']
)
def test_composed_different_interfaces_rejected(setting: str, masmc: Masmc) -> None:
    pytest.importorskip('rclpy')
    result = masmc('run', 'composed', '--ros-args', '-p', setting)
    message = error_line(result.returncode, result.stdout, result.stderr)
    name = setting.split(':')[1]
    assert f'controller.{name} = ' in message
    assert f'which plant.{name} is' in message
