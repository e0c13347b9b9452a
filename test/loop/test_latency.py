# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Errors of closed loops with compensated latency, see docs/theory/latency.md."""

from __future__ import annotations

from pathlib import Path

from latency_map import error_of, growth
from masmc_ros.loop.closed_loop import NOT_FINITE
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.simulation import Simulation
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
SMC = ('controller.law=smc', 'controller.switching=implicit')


def result(file: str, *settings: str, axes: int = 2) -> tuple[float, float]:
    """Return the RMS of the true distance in mm, in the first axes, and the torque variation."""
    simulation = Simulation(load_scenario(str(ROOT / 'config' / file), settings))
    (run,) = simulation.run(block=30_000)
    error = run.true_error(simulation.plant.robot)
    half = len(error) // 2
    place = error[half:-1, :axes]
    duration = half * simulation.timing.period
    variation = float(np.abs(np.diff(run.torque[half:], axis=0)).sum()) / duration
    return 1e3 * float(np.sqrt((place**2).sum(axis=1).mean())), variation


def delayed(latency: float, assumed: float | None = None) -> tuple[str, ...]:
    """Return the settings of a latency and the assumed one in s."""
    return (
        f'plant.measurement_delay={latency}',
        f'controller.latency={latency if assumed is None else assumed}',
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ('latency', 'largest'), [(0.002, 0.05), (0.005, 0.1), (0.01, 0.4), (0.02, 2.4)]
)
def test_planar_robot_by_rule_has_documented_error(latency: float, largest: float) -> None:
    error, variation = result('paper.yaml', *SMC, *delayed(latency))
    assert error < largest
    assert variation < 15.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ('latency', 'gain', 'horizon', 'largest'),
    [(0.002, 0.2, 0.5, 0.05), (0.005, 0.2, 0.5, 0.1), (0.01, 0.1, 0.5, 0.25), (0.02, 0.1, 1, 0.8)],
)
def test_planar_robot_other_gains_have_documented_error(
    latency: float, gain: float, horizon: float, largest: float
) -> None:
    gains = (
        f'controller.compensation.gain={gain}',
        f'controller.compensation.horizon={horizon * latency}',
        'controller.compensation.slope=0.5',
    )
    error, variation = result('paper.yaml', *SMC, *gains, *delayed(latency))
    assert error < largest
    assert variation < 15.0


@pytest.mark.slow
@pytest.mark.parametrize('pause', [0.5, 10.0, 3600.0])
def test_tree_pause_of_states_prediction_continues(pause: float) -> None:
    """The prediction does not integrate the model over a pause that is longer than its history."""
    values = load_scenario(str(ROOT / 'config' / 'ur5.yaml'), delayed(0.01))['controller']
    controller = Controller(robot_of(values), values['control_period'], values)
    position = np.array([0.0, 0.0, 0.0, 0.0, -1.2, 1.4, -1.8, -1.57, 0.0])
    reference = np.zeros(18)
    reference[:6] = controller.robot.task_positions(position[None])[0]
    for skipped in (0, 0, round(pause / values['control_period']), 0, 0):
        controller.skip(skipped)
        assert not controller.answer(position, np.zeros(9), reference) & NOT_FINITE
        # A robot at rest in its goal needs its weight only.
        torque = controller.torque.copy()
        assert (np.abs(torque) < [1.0, 60.0, 30.0, 5.0, 5.0, 1.0]).all()


@pytest.mark.slow
@pytest.mark.parametrize('assumed', [0.007, 0.013])
def test_planar_robot_wrong_latency_error_below_one_mm(assumed: float) -> None:
    error, variation = result('paper.yaml', *SMC, *delayed(0.01, assumed))
    assert error < 1.0
    assert variation < 15.0


@pytest.mark.slow
@pytest.mark.parametrize(
    'effect',
    [
        ('plant.measurement_delay=0.01', 'plant.motor_lag=0.005'),
        ('plant.command_delay=0.01',),
        ('plant.measurement_delay=0.005', 'plant.command_delay=0.005', 'plant.delay_jitter=0.25'),
    ],
)
def test_planar_robot_other_effects_error_below_one_mm(effect: tuple[str, ...]) -> None:
    assert result('paper.yaml', *SMC, 'controller.latency=0.01', *effect)[0] < 0.4


@pytest.mark.slow
def test_planar_robot_100_hz_estimate_halves_error() -> None:
    at_100_hz = (*SMC, 'control_period=0.01')
    assert result('paper.yaml', *at_100_hz, 'controller.compensation.gain=0.5')[0] < 1.3
    assert result('paper.yaml', *at_100_hz, *delayed(0.01))[0] < 3.5


@pytest.mark.slow
def test_planar_robot_estimated_velocities_noise_bounded() -> None:
    """Encoders, noise of the velocities that are not used, and adaptation."""
    settings = (
        'controller.law=rasmc',
        'controller.switching=implicit',
        'controller.velocity_source=estimated',
        'plant.encoder_resolution=0.0001',
        'plant.velocity_noise=0.05',
    )
    assert result('paper.yaml', *settings, *delayed(0.01))[0] < 1.0


@pytest.mark.slow
def test_tiago_latency_10_ms_error_below_tenth_mm() -> None:
    settings = ('controller.law=smc', *delayed(0.01))
    assert result('tiago.yaml', *settings, axes=3)[0] < 0.1


@pytest.mark.slow
def test_tiago_100_hz_latency_of_one_period_keeps_its_path() -> None:
    """The wheels are at their limit at first; with a horizon of 1.2 periods they oscillate."""
    settings = ('controller.law=smc', 'control_period=0.01', 'plant.command_delay=0.01')
    assert result('tiago.yaml', *settings, 'controller.latency=0.01', axes=3)[0] < 0.5


DRIVES = {
    'tiago.yaml': (6.0, 6.0, 2000.0, 39.0, 39.0, 17.86, 17.86, 3.0, 6.6, 6.6),
    'ur5.yaml': (150.0, 150.0, 150.0, 28.0, 28.0, 28.0),
}
"""Torque limits of the drives in N·m."""


def all_effects(file: str, latency: int) -> tuple[str, ...]:
    """
    Return the settings of all effects together; the latency is in ms.

    They are motor lag, jitter, encoders without velocities, stiction and torque limits. The
    controller adapts, and its other gains are those of the rule.
    """
    drives = np.array(DRIVES[file])
    return (
        'controller.law=rasmc',
        'controller.switching=implicit',
        'controller.velocity_source=estimated',
        f'controller.latency={1e-3 * latency}',
        'controller.motor_lag=0.005',
        f'controller.torque_limit={(0.7 * drives).tolist()}',
        f'plant.measurement_delay={1e-3 * (latency // 2)}',
        f'plant.command_delay={1e-3 * (latency - latency // 2)}',
        'plant.delay_jitter=0.25',
        'plant.motor_lag=0.005',
        'plant.encoder_resolution=0.0001',
        'plant.measures_velocity=false',
        f'plant.stiction.torque={(0.02 * drives).tolist()}',
        f'plant.torque_limit={(0.7 * drives).tolist()}',
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ('latency', 'distance', 'angle'),
    [(2, 0.2, 1.5), (5, 0.35, 3.0), (10, 0.7, 6.0), (20, 3.0, 25.0)],
)
@pytest.mark.parametrize('file', list(DRIVES))
def test_tree_all_effects_has_documented_error(
    file: str, latency: int, distance: float, angle: float
) -> None:
    """RMS of the tip in mm and mrad."""
    settings = all_effects(file, latency)
    simulation = Simulation(load_scenario(str(ROOT / 'config' / file), settings))
    (run,) = simulation.run(block=30_000)
    error = run.true_error(simulation.plant.robot)
    place, turned = np.split(error[len(error) // 2:-1], 2, axis=1)
    assert 1e3 * float(np.sqrt((place**2).sum(axis=1).mean())) < distance
    assert 1e3 * float(np.sqrt((turned**2).sum(axis=1).mean())) < angle


@pytest.mark.slow
def test_planar_robot_all_effects_light_model_does_not_oscillate() -> None:
    """A payload makes the assumed masses less than half of the true ones; nothing adapts."""
    settings = (
        'controller.model_scale=0.5',
        'plant.payload.mass=0.2',
        'plant.measurement_delay=0.002',
        'plant.command_delay=0.003',
        'plant.motor_lag=0.002',
        'plant.encoder_resolution=0.0001',
        'plant.measures_velocity=false',
        'controller.velocity_source=estimated',
        'controller.latency=0.005',
        'controller.motor_lag=0.002',
    )
    assert result('paper.yaml', *SMC, *settings)[0] < 0.6


@pytest.mark.slow
@pytest.mark.parametrize('period', [0.001, 0.01])
@pytest.mark.parametrize('lag', [0.002, 0.02])
def test_planar_robot_motor_lag_without_latency_does_not_chatter(
    period: float, lag: float
) -> None:
    lags = (f'plant.motor_lag={lag}', f'controller.motor_lag={lag}')
    error, variation = result('paper.yaml', *SMC, f'control_period={period}', *lags)
    assert error < 7.0
    assert variation < 15.0


@pytest.mark.slow
@pytest.mark.parametrize(
    'measurement',
    [
        ('plant.velocity_noise=0.05',),
        ('plant.measures_velocity=false', 'controller.velocity_source=estimated'),
    ],
)
def test_planar_robot_adaptation_with_latency_estimate_bounded(
    measurement: tuple[str, ...]
) -> None:
    """60 s with encoders of 0.1 mrad; docs/theory/latency.md has the figures for 600 s."""
    settings = (
        'controller.law=rasmc',
        'controller.switching=implicit',
        'controller.model_scale=0.5',
        'plant.encoder_resolution=0.0001',
        'duration=60.0',
    )
    values = load_scenario(
        str(ROOT / 'config' / 'paper.yaml'), (*settings, *measurement, *delayed(0.01))
    )
    simulation = Simulation(values)
    (run,) = simulation.run(block=70_000)
    estimate = run.signals['estimate'][:, :, 0]
    ratio = estimate / estimate[0]
    assert 0.4 < ratio.min() < ratio.max() < 2.2
    error = run.true_error(simulation.plant.robot)[50_000:, :2]
    assert 1e3 * float(np.sqrt((error**2).sum(axis=1).mean())) < 1.3


@pytest.mark.slow
@pytest.mark.parametrize(('latency', 'mass'), [(8, 1.5), (13, 1.0), (15, 0.5), (12, 0.5)])
def test_linear_limit_of_latency_stable_loop_is_stable(latency: int, mass: float) -> None:
    assert growth(latency, mass) < 1.0
    assert error_of(latency, mass) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize(('latency', 'mass'), [(5, 1.5), (18, 1.0), (20, 0.5), (10, 2.5)])
def test_linear_limit_of_latency_unstable_loop_diverges(latency: int, mass: float) -> None:
    assert growth(latency, mass) > 1.0
    assert np.isnan(error_of(latency, mass))
