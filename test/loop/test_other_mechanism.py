# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Simulation, log, report and live run of a mechanism from another package."""

from __future__ import annotations

import csv
from pathlib import Path

from cart_arm import CART_ARM, constants, Posture, regressor, regressor_times
from helpers.log_contents import read_log
from helpers.processes import processes, ros_arguments
from masmc_ros.cli.main import main
from masmc_ros.log.read.reader import read_run
from masmc_ros.robot.mechanisms import ENTRY_POINTS
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest
import sympy as sp

FILE = """
/**:
  ros__parameters:
    pacing: lockstep
    control_period: 0.002
    duration: 1.0
    robot: {mechanism: cart_arm, cart_mass: 10.0}
/**/plant:
  ros__parameters: {wait_for: [controller, trajectory, recorder]}
/**/controller:
  ros__parameters: {law: rasmc, switching: implicit}
"""


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a parameter file of the cart, whose package is installed for all processes."""
    package = tmp_path / 'site' / 'cart_arm-1.0.dist-info'
    package.mkdir(parents=True)
    (package / 'METADATA').write_text('Name: cart_arm\nVersion: 1.0\n')
    (package / 'entry_points.txt').write_text(
        f'[{ENTRY_POINTS}]\ncart_arm = cart_arm:CART_ARM\n'
    )
    monkeypatch.syspath_prepend(package.parent)
    path = tmp_path / 'cart.yaml'
    path.write_text(FILE)
    return path


def test_cart_arm_regressor_equals_lagrangian() -> None:
    t = sp.Symbol('t')
    x, a = sp.Function('x')(t), sp.Function('a')(t)
    p = {q.name.removeprefix('robot.'): q.default for q in CART_ARM.parameters}
    r, half = p['pulley_radius'], p['arm_length'] / 2
    centre = sp.Matrix([x + half * sp.cos(a), half * sp.sin(a)]).diff(t)
    energy = (
        p['cart_mass'] * x.diff(t) ** 2
        + p['motor_inertia'] * (x.diff(t) / r) ** 2
        + p['arm_mass'] * centre.dot(centre)
        + p['arm_inertia'] * a.diff(t) ** 2
    ) / 2
    forces = [energy.diff(q.diff(t)).diff(t) - energy.diff(q) for q in (x, a)]
    draw = np.random.default_rng(3)
    _, theta = constants(p)
    for _ in range(20):
        angle, *v = draw.uniform(-3.0, 3.0, 3).tolist()
        v_dot = draw.uniform(-3.0, 3.0, 2).tolist()
        values = [
            (x.diff(t, 2), v_dot[0]), (a.diff(t, 2), v_dot[1]),
            (x.diff(t), v[0]), (a.diff(t), v[1]), (a, angle),
        ]
        right = [float(force.subs(values)) for force in forces]
        bend = Posture(np.cos(angle), np.sin(angle))
        y = regressor(None, bend, tuple(v), tuple(v), tuple(v_dot))
        assert regressor_times(None, y, theta) == pytest.approx(right, abs=1e-12)
        # V with Hdot - 2 V skew-symmetric: multiplied by v it adds no power.
        ahead = 1e-6 * v[1]
        later = Posture(np.cos(angle + ahead), np.sin(angle + ahead))
        still = (0.0, 0.0)
        h, h_later = (
            np.array([
                regressor_times(None, regressor(None, posture, still, still, unit), theta)
                for unit in ((1.0, 0.0), (0.0, 1.0))
            ])
            for posture in (bend, later)
        )
        h_dot = (h_later - h) / 1e-6
        columns = [
            regressor_times(None, regressor(None, bend, tuple(v), unit, still), theta)
            for unit in ((1.0, 0.0), (0.0, 1.0))
        ]
        skew = h_dot - 2.0 * np.array(columns).T
        assert skew + skew.T == pytest.approx(np.zeros((2, 2)), abs=1e-4)


@pytest.mark.slow
def test_cart_arm_is_simulated_logged_reported_and_exported(file: Path, tmp_path: Path) -> None:
    log = tmp_path / 'run.mcap'
    assert main(['simulate', str(file), '--output', str(log)]) == 0
    run = read_run(log)
    assert run.mechanism is CART_ARM
    assert run.joint_names == ('cart_joint', 'pulley_joint', 'arm_joint')
    assert run.position.shape == (501, 3)
    assert run.torque.values.shape == (501, 2)
    assert run.reference is not None
    assert run.reference.shape == (501, 6)
    assert run.telemetry['estimate'].values.shape == (501, 3)
    # The pulley drives the cart, and the arm follows its path.
    assert run.position[:, 0] == pytest.approx(0.05 * run.position[:, 1], abs=1e-9)
    error = np.abs(run.telemetry['error'].values)
    assert error[-1].max() < 0.2 * error[0].max()
    assert main(['simulate', str(log)]) == 0
    assert main(['report', str(log), '--output', str(tmp_path / 'report')]) == 0
    names = {path.name for path in (tmp_path / 'report').iterdir()}
    assert {'report.html', 'run_path.png', 'run_tip.png', 'comparison.png'} <= names
    (row,) = csv.DictReader((tmp_path / 'report' / 'metrics.csv').read_text().splitlines())
    assert float(row['tip_rms (m)']) < 0.05
    assert main(['export', str(log), '--format', 'csv', '--output', str(tmp_path)]) == 0
    with next(tmp_path.glob('run*.csv')).open() as table:
        heads = next(csv.reader(table))
    assert {'position_cart_joint_m', 'command_arm_joint_N_m', 'error_y_T_m'} <= set(heads)
    assert 'estimate_inertia_kg_m2' in heads


@pytest.mark.slow
def test_cart_arm_velocity_interface_is_logged_and_reported(file: Path, tmp_path: Path) -> None:
    log = tmp_path / 'rates.mcap'
    rates = 'command_interface=velocity'
    options = ['--set', f'plant.{rates}', '--set', f'controller.{rates}']
    assert main(['simulate', str(file), *options, '--output', str(log)]) == 0
    run = read_run(log)
    assert (run.cmd_vel.values.shape, run.arm_rates.values.shape) == ((501, 1), (501, 1))
    assert main(['report', str(log), '--output', str(tmp_path / 'report')]) == 0


def test_cart_arm_parameters_are_validated(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = load_scenario(str(file), ['robot.arm_mass=2.0'])
    assert scenario['plant']['robot.arm_mass'] == 2.0
    assert 'robot.wheel_radius' not in scenario['controller']
    assert main(['simulate', str(file), '--set', 'robot.wheel_radius=0.1']) == 2
    assert 'robot.wheel_radius' in capsys.readouterr().err
    assert main(['simulate', str(file), '--set', 'trajectory.line_sine.offset=[0.4, 0.7]']) == 2
    assert 'from the rail; expected up to 0.6 m' in capsys.readouterr().err


@pytest.mark.slow
def test_cart_arm_live_lockstep_equals_simulation(file: Path, tmp_path: Path) -> None:
    log, computed = tmp_path / 'live.mcap', tmp_path / 'computed.mcap'
    with processes(tmp_path) as started:
        started.start_all(*ros_arguments(file, recorder__output=log))
        assert set(started.wait().values()) == {0}, started.output()
    assert main(['simulate', str(file), '--output', str(computed)]) == 0
    live, simulated = read_log(log).messages, read_log(computed).messages
    for topic in (
        'joint_states',
        'effort_commands',
        'controller/tracking_error',
        'controller/parameter_estimate',
        'tf',
        'odom',
        'robot_description',
        'path/desired',
        'path/actual',
    ):
        assert live[topic] == simulated[topic], topic
