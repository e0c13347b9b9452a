# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Commanded velocities of a log: stamps, rejected messages, report, export."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

from helpers.report_html import lines, Page
from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.log.bag import Qos
from masmc_ros.log.read.reader import read_run, Run
from masmc_ros.log.write.writer import LogWriter
from masmc_ros.messages.commands import ARM_VELOCITY, ArmVelocityCdr, LabelledCdr
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.message import string_message
from masmc_ros.messages.parameter_record import ParameterRecord
from masmc_ros.messages.platform_messages import TwistCdr, TwistStampedCdr
from masmc_ros.messages.topics import FLOAT_ARRAY, TWIST, TWIST_STAMPED
from masmc_ros.robot.mechanisms import joint_names_of, mechanism_from
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

PAPER = Path(__file__).parents[2] / 'config' / 'paper.yaml'
TICK = 1_000_000


def write(
    path: Path, twists: list[tuple[int, Any]], arm: list[int], kind: str = TWIST
) -> None:
    """Write five states, twists at log times in ns, and arm commands by stamp."""
    with LogWriter(path) as log:
        states = log.channel('/joint_states', 'sensor_msgs/msg/JointState', Qos())
        platform = log.channel('/cmd_vel', kind, Qos())
        joints = log.channel('/arm_velocity_commands', FLOAT_ARRAY, Qos())
        state, command = JointStateCdr(), ArmVelocityCdr()
        for tick in range(5):
            state.set_stamp(tick * TICK)
            log.write(states, tick * TICK, state.to_bytes())
        for time, message in twists:
            log.write(platform, time, message.to_bytes())
        for stamp in arm:
            command.set_stamp(stamp)
            command.data[:] = stamp, -stamp
            log.write(joints, stamp, command.to_bytes())


def twist(forward: float, turn: float) -> TwistCdr:
    """Return a plain twist."""
    message = TwistCdr()
    message.linear[0], message.angular[2] = forward, turn
    return message


def stamps(run: Run) -> list[int]:
    """Return the stamps of the platform commands in ticks."""
    return [round(time * 1e9 / TICK) for time in run.cmd_vel.times]


@pytest.mark.slow
def test_read_run_fixed_base_has_twists_without_numbers(tmp_path: Path) -> None:
    path = tmp_path / 'ur5.mcap'
    values = load_scenario(str(PAPER.with_name('ur5.yaml')))['plant']
    mechanism = mechanism_from(values)
    names = joint_names_of(mechanism)
    record = ParameterRecord('/plant', 0, 0, dict(values), ())
    command = LabelledCdr(ARM_VELOCITY.named(names[len(mechanism.base):]))
    with LogWriter(path) as log:
        parameters = log.channel('/plant/parameters', 'std_msgs/msg/String', Qos())
        log.write(parameters, 0, string_message(record.to_text()))
        states = log.channel('/joint_states', 'sensor_msgs/msg/JointState', Qos())
        log.write(states, 0, JointStateCdr(names).to_bytes())
        log.write(log.channel('/cmd_vel', TWIST, Qos()), 0, twist(0.0, 0.0).to_bytes())
        command.set_stamp(0)
        commands = log.channel('/arm_velocity_commands', FLOAT_ARRAY, Qos())
        log.write(commands, 0, command.to_bytes())
    run = read_run(path)
    assert run.cmd_vel.values.shape == (1, 0)
    assert run.arm_rates.values.shape == (1, 6)
    assert main(['export', str(path), '--output', str(tmp_path / 'export')]) == 0


def test_read_run_plain_twists_get_stamps_of_arm_commands(tmp_path: Path) -> None:
    """In a recording two twists may have the same time, and another may be one tick late."""
    path = tmp_path / 'run.mcap'
    times = [0, 0, 2, 4, 4]
    write(
        path,
        [(time * TICK, twist(n, -n)) for n, time in enumerate(times)],
        [n * TICK for n in range(5)],
    )
    run = read_run(path)
    assert stamps(run) == [0, 1, 2, 3, 4]
    assert run.cmd_vel.values.tolist() == [[n, -n] for n in range(5)]
    assert run.arm_rates.values[:, 0].tolist() == [n * TICK for n in range(5)]
    assert run.torque.values.shape == (0, 4)
    assert run.commands_rates


def test_read_run_unpaired_plain_twists_get_log_times(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    write(path, [(n * TICK, twist(n, -n)) for n in (0, 1, 3)], [0, TICK])
    run = read_run(path)
    assert stamps(run) == [0, 1, 3]


def test_read_run_invalid_twist_is_skipped(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    bad = twist(1.0, 1.0)
    bad.linear[1] = np.nan
    write(path, [(0, twist(5.0, 6.0)), (TICK, bad), (TICK, twist(7.0, 8.0))], [0, TICK])
    run = read_run(path)
    assert run.cmd_vel.values.tolist() == [[5.0, 6.0], [7.0, 8.0]]
    assert stamps(run) == [0, 1]


@pytest.mark.parametrize('prefix', ['', 'left/'])
def test_read_run_stamped_twists_keep_their_stamps(prefix: str, tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    messages = []
    for tick in range(3):
        message = TwistStampedCdr(prefix)
        message.set_stamp(tick * TICK)
        message.linear[0], message.angular[2] = tick, 0.5
        messages.append((4 * TICK, message))
    write(path, messages, [0], TWIST_STAMPED)
    run = read_run(path)
    assert stamps(run) == [0, 1, 2]
    assert run.cmd_vel.values.tolist() == [[0.0, 0.5], [1.0, 0.5], [2.0, 0.5]]


def test_read_run_cmd_vel_of_other_type_raises(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    write(path, [(0, ArmVelocityCdr())], [0], FLOAT_ARRAY)
    with pytest.raises(InputError, match=r'cmd_vel is .*Float64MultiArray; it takes .*Twist or '):
        read_run(path)


@pytest.fixture(scope='module')
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp('rates') / 'run.mcap'
    both = [f'{node}.command_interface=velocity' for node in ('plant', 'controller')]
    settings = [word for setting in (*both, 'duration=0.5') for word in ('--set', setting)]
    assert main(['simulate', str(PAPER), '--output', str(path), *settings]) == 0
    return path


def test_report_velocity_interface_has_no_torques_in_table(
    simulated: Path, tmp_path: Path, capsys: Any
) -> None:
    assert main(['report', str(simulated), '--output', str(tmp_path)]) == 0
    with (tmp_path / 'metrics.csv').open(newline='', encoding='utf-8') as stream:
        (row,) = csv.DictReader(stream)
    assert row['run'] == 'rates'
    assert row['torque_rms (N·m)'] == row['torque_variation (N·m/s)'] == ''


def test_report_page_velocity_interface_plots_velocities(simulated: Path, tmp_path: Path) -> None:
    assert main(['report', str(simulated), '--output', str(tmp_path)]) == 0
    page = Page((tmp_path / 'report.html').read_text(encoding='utf-8'))
    rates, speed = page.figure('run-1-rates'), page.figure('run-1-speed')
    assert rates['layout']['yaxis']['title']['text'] == 'rate (rad/s)'
    assert speed['layout']['yaxis']['title']['text'] == 'speed (m/s)'
    assert [trace['name'] for trace in rates['data']] == ['yaw rate', 'arm joint 1', 'arm joint 2']
    run = read_run(simulated)
    for samples, values in zip(
        (*lines(speed).values(), *lines(rates).values()),
        np.hstack([run.cmd_vel.values, run.arm_rates.values]).T,
        strict=True,
    ):
        np.testing.assert_array_equal(samples['y'], values.astype(np.float32))
    torque = next(iter(lines(page.figure('run-1-torque')).values()))
    assert torque['y'].any(), 'what the drives applied'
    assert (tmp_path / 'comparison.png').stat().st_size > 10_000


def test_report_page_hybrid_interface_plots_velocities_of_base(tmp_path: Path) -> None:
    """The arm has torques, and no velocities that a plot could show."""
    log = tmp_path / 'hybrid.mcap'
    settings = [
        option
        for node in ('plant', 'controller')
        for option in ('--set', f'{node}.command_interface=hybrid')
    ]
    settings += ['--set', 'duration=0.2']
    assert main(['simulate', str(PAPER), '--output', str(log), *settings]) == 0
    assert main(['report', str(log), '--output', str(tmp_path)]) == 0
    page = Page((tmp_path / 'report.html').read_text(encoding='utf-8'))
    names = [trace['name'] for trace in page.figure('run-1-rates')['data']]
    assert names == ['yaw rate']
    assert lines(page.figure('run-1-torque'))


@pytest.mark.parametrize('file_format', ['csv', 'npz'])
def test_export_velocity_interface_has_velocities(
    simulated: Path, tmp_path: Path, file_format: str
) -> None:
    run = read_run(simulated)
    export = ['export', str(simulated), '--output', str(tmp_path), '--format', file_format]
    assert main(export) == 0
    path = tmp_path / f'run.{file_format}'
    if file_format == 'npz':
        arrays = np.load(path)
        assert 'command' not in arrays
        assert (arrays['cmd_vel'] == run.cmd_vel.values).all()
        assert (arrays['arm_rate'] == run.arm_rates.values).all()
        assert (arrays['cmd_vel_time_s'] == run.times).all()
        return
    with path.open(newline='', encoding='utf-8') as stream:
        rows = list(csv.DictReader(stream))
    assert not any(name.startswith('command_') and name.endswith('N_m') for name in rows[0])
    expected = np.hstack([run.cmd_vel.values, run.arm_rates.values])
    for name, column in zip(
        (
            'command_forward_speed_m_per_s',
            'command_yaw_rate_rad_per_s',
            'command_arm_joint_1_rad_per_s',
            'command_arm_joint_2_rad_per_s',
        ),
        expected.T,
        strict=True,
    ):
        assert [float(row[name]) for row in rows] == column.tolist()
