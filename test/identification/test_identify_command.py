# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc identify` and `masmc excite`: input, files and results."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.identification.samples import samples_of
from masmc_ros.log.read.decode import Series
from masmc_ros.log.read.reader import read_run, Run
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

STILL = 'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]'


@pytest.fixture(scope='module')
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp('logs') / 'run.mcap'
    assert main(['simulate', 'paper', '--set', 'duration=6.0', '--output', str(path)]) == 0
    return path


@pytest.fixture(scope='module')
def logged(log: Path) -> Run:
    return read_run(log)


def empty(series: Series) -> Series:
    return Series(series.stamps[:0], series.values[:0])


def test_samples_complete_run_accepted(logged: Run) -> None:
    samples = samples_of(logged)
    assert len(samples.times) == 6001
    assert samples.valid.all()
    assert samples.has_rates
    without = replace(samples, velocity=np.full_like(samples.velocity, np.nan))
    difference = np.abs(without.rates - samples.rates)[50:-50]
    assert difference.max() < 0.02 * np.abs(samples.rates).max()


def test_samples_run_without_torques_rejected(logged: Run) -> None:
    with pytest.raises(InputError, match='no commanded torques'):
        samples_of(replace(logged, torque=empty(logged.torque)))
    rates = replace(logged, torque=empty(logged.torque), arm_rates=logged.torque)
    with pytest.raises(InputError, match='commands of velocities'):
        samples_of(rates)


def test_samples_run_with_hybrid_commands_rejected(logged: Run) -> None:
    controller = {**logged.parameters['controller'], 'command_interface': 'hybrid'}
    hybrid = replace(logged, parameters={**logged.parameters, 'controller': controller})
    reason = r'command_interface: hybrid\); expected commanded torques of all joints'
    with pytest.raises(InputError, match=reason):
        samples_of(hybrid)


def test_samples_short_run_rejected(logged: Run) -> None:
    commands = Series(logged.torque.stamps[:900], logged.torque.values[:900])
    with pytest.raises(InputError, match=r'0\.899 s of states with commands; expected at least 5'):
        samples_of(replace(logged, torque=commands))


def test_samples_robot_at_rest_rejected(logged: Run) -> None:
    at_rest = replace(
        logged,
        position=np.tile(logged.position[:1], (len(logged.times), 1)),
        velocity=np.zeros_like(logged.velocity),
    )
    with pytest.raises(InputError, match='did not move'):
        samples_of(at_rest)


def test_samples_gap_in_commands_excluded(logged: Run) -> None:
    keep = np.ones(len(logged.torque), bool)
    keep[2000:2100] = False
    torque = Series(logged.torque.stamps[keep], logged.torque.values[keep])
    valid = samples_of(replace(logged, torque=torque)).valid
    assert not valid[2000:2099].any()
    assert valid[:1990].all()
    assert valid[2110:].all()


def void(run: Run, first: int, end: int) -> Run:
    """Return a run with void commands in a range of its commands."""
    is_void = np.zeros(len(run.torque), bool)
    is_void[first:end] = True
    values = np.where(is_void[:, None], 0.0, run.torque.values)
    return replace(run, torque=Series(run.torque.stamps, values, is_void=is_void))


@pytest.mark.parametrize(('first', 'end'), [(0, 900), (2000, 2001), (2000, 2100), (5900, 6001)])
def test_samples_void_commands_are_no_torques(logged: Run, first: int, end: int) -> None:
    samples = samples_of(void(logged, first, end))
    whole = samples_of(logged)
    keep = np.ones(len(logged.torque), bool)
    keep[first:end] = False
    assert np.array_equal(samples.command_times, whole.command_times[keep])
    assert np.array_equal(samples.commands, whole.commands[keep])
    assert not samples.valid[first:end].any()
    assert samples.valid[:max(0, first - 2)].all()
    assert samples.valid[end:].all()


def test_samples_of_void_commands_only_rejected(logged: Run) -> None:
    with pytest.raises(InputError, match='void commands only; expected commanded torques'):
        samples_of(void(logged, 0, len(logged.torque)))


def test_samples_short_time_between_void_commands_rejected(logged: Run) -> None:
    with pytest.raises(InputError, match=r'4\.5 s of states with commands; expected at least 5'):
        samples_of(void(logged, 0, 1500))


@pytest.mark.parametrize(
    ('arguments', 'reason'),
    [
        (['identify', 'nowhere.mcap'], 'nowhere.mcap'),
        (['identify', 'nowhere.mcap', '--output', 'robot.json'], '*.yaml'),
        (['excite', 'paper', '--output', 'path.yaml', '--duration', '2'], '10 s'),
        (['excite', 'paper', '--output', 'path.yaml', '--amplitude', '0'], '--amplitude'),
    ],
)
def test_commands_bad_input_one_error_line(
    arguments: list[str], reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    text = capsys.readouterr().err
    assert text.count('\n') == 1
    assert reason in text


def test_excite_path_starts_at_robot_within_reach(tmp_path: Path) -> None:
    path = tmp_path / 'excite.yaml'
    assert main(['excite', 'paper', '--output', str(path), '--duration', '12']) == 0
    values = load_scenario(str(path))
    assert values['plant']['duration'] == 12.0
    assert values['controller']['law'] == 'computed_torque'
    own = values['trajectory']
    robot = robot_of(own)
    samples = Trajectory(own, own['control_period'], robot).sample(0, 12_001)
    plant = values['plant']
    start = robot.start(plant['initial_pose'], plant['initial_joints'])
    assert np.allclose(samples[0, :4], robot.task_positions(np.array([start]))[0], atol=1.0e-8)
    assert np.abs(samples[[0, -1], 4:8]).max() < 1.0e-6
    assert np.ptp(samples[:, 0]) > 0.1


@pytest.mark.slow
def test_identify_excited_robot_file_accepted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario, run, output = (tmp_path / name for name in ('e.yaml', 'r.mcap', 'i.yaml'))
    assert main(['excite', 'paper', '--output', str(scenario), '--duration', '20']) == 0
    settings = [STILL, 'plant.measurement_delay=0.004']
    arguments = [argument for setting in settings for argument in ('--set', setting)]
    assert main(['simulate', str(scenario), *arguments, '--output', str(run)]) == 0
    capsys.readouterr()
    assert main(['identify', str(run), '--check', str(run), '--output', str(output)]) == 0
    text = capsys.readouterr().out
    latency = next(line for line in text.splitlines() if line.startswith('latency: '))
    assert float(latency.split()[1]) == pytest.approx(4.0, abs=0.5)
    assert '15 of 15 combinations' in text
    control = load_scenario(str(output))['controller']
    assert control['model_scale'] == 1.0
    true = robot_of(load_scenario('config/paper.yaml')['controller'])
    assert np.allclose(robot_of(control).theta, true.theta, rtol=1.0e-3)
