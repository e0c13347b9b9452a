# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Latency and motor lag by the efforts that drives report."""

from __future__ import annotations

from pathlib import Path

from masmc_ros.aliases import Array
from masmc_ros.identification.latency_fit import (
    EchoBuffer,
    Estimate,
    fit_echo,
    LatencyFit,
    wrong_latency,
)
from masmc_ros.loop.simulated_robot import plant_of
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')


def echoed(period: float, *settings: str, noise: float = 0.0) -> tuple[Array, Array, Array]:
    """Return times, efforts and commands of the simulated plant for random torques."""
    unlimited = 'plant.torque_limit=[0.0, 0.0, 0.0, 0.0]'
    plant = plant_of(load_scenario(PAPER, (unlimited, *settings))['plant'], period)
    random = np.random.default_rng(3)
    times = np.arange(max(150, round(2.0 / period))) * period
    steps = random.standard_normal((len(times), 4)) * np.sqrt(period)
    torque = np.sin(np.outer(times, [1.0, 2.0, 3.0, 4.0])) + np.cumsum(0.6 * steps, axis=0)
    effort = np.empty_like(torque)
    for k, command in enumerate(torque):
        effort[k] = plant.applied
        plant.advance(command)
    return times, effort + noise * random.standard_normal(effort.shape), torque


@pytest.mark.parametrize(
    ('period', 'delay', 'lag', 'noise'),
    [
        (0.001, 0.0, 0.0, 0.0),
        (0.001, 0.005, 0.0, 0.0),
        (0.001, 0.005, 0.003, 0.005),
        (0.002, 0.02, 0.01, 0.005),
        (0.01, 0.0, 0.0, 0.0),
        (0.01, 0.02, 0.005, 0.01),
    ],
)
def test_echo_of_plant_has_its_delay_and_lag(
    period: float, delay: float, lag: float, noise: float
) -> None:
    settings = f'control_period={period}', f'plant.command_delay={delay}'
    times, effort, torque = echoed(period, *settings, f'plant.motor_lag={lag}', noise=noise)
    # Currents in place of torques, and a joint without echo of its effort.
    timing = fit_echo(times, effort * [1.0, -0.3, 2.0, 1.0] + [0.0, 0.1, 0.0, 0.0], torque)
    assert timing is not None
    assert timing.total.value == pytest.approx(delay + lag, abs=4.0 * timing.total.error + 1e-4)
    assert timing.latency.value == pytest.approx(delay, abs=4.0 * timing.latency.error + 1e-4)
    assert timing.total.error < 1.0e-3


def test_effort_unlike_commands_claims_nothing() -> None:
    times, effort, torque = echoed(0.002)
    random = np.random.default_rng(1)
    assert fit_echo(times, np.zeros_like(effort), torque) is None
    assert fit_echo(times, random.standard_normal(effort.shape), torque) is None
    measured = effort + 0.3 * np.sin(np.outer(times, [9.0, 8.0, 7.0, 6.0]))
    assert fit_echo(times, measured, torque) is None
    effort[100, 2] = np.nan
    assert fit_echo(times, effort, torque) is None
    assert fit_echo(times, torque, np.ones_like(torque)) is None


def test_wrong_latency_warning_has_right_value() -> None:
    timing = LatencyFit(Estimate(0.005, 1e-4), Estimate(0.003, 1e-4), Estimate(0.008, 1e-4))
    assert wrong_latency(timing, 0.005, 0.003, 0.001) == ''
    assert wrong_latency(timing, 0.0085, 0.0, 0.001) == ''
    assert wrong_latency(timing, 0.0, 0.0, 0.01) == ''
    for latency in (0.0, 0.005, 0.012):
        text = wrong_latency(timing, latency, 0.0, 0.001)
        assert text.startswith(f'latency = {latency:g}, motor_lag = 0')
        assert text.endswith('expected latency = 0.0050 and motor_lag = 0.0030')


def test_echo_buffer_returns_parts_with_pauses() -> None:
    buffer = EchoBuffer(1, 0.01)
    one, parts = np.ones(1), []
    for k in range(1, 7000):
        part = buffer.add(k * 10**7, one, 0.01 * k * one)
        if part is not None:
            parts.append((k, part))
    assert [k for k, _ in parts] == [200, 200 * 16, 200 * 31]
    times, effort, torque = parts[1][1]
    np.testing.assert_allclose(np.diff(times), 0.01)
    assert effort.all()
    np.testing.assert_allclose(torque[:, 0], 0.01 * (3001 + np.arange(200)))


def test_echo_buffer_without_effort_returns_nothing() -> None:
    buffer = EchoBuffer(1, 0.01)
    none, one = np.zeros(1), np.ones(1)
    assert all(buffer.add(k * 10**7, none, one) is None for k in range(1, 400))
