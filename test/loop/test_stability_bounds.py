# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Bounds of docs/theory/sampled_laws.md at which sampled laws chatter."""

from __future__ import annotations

from pathlib import Path

from campaign_maps import Grid, smallest_layer, swept, WEAK, WEAKER
from helpers.lagrangian import matrices
from helpers.robots import DEFAULT
from helpers.scenario import Run, Scenario, whole
import numpy as np
import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
PAPER = ROOT / 'config' / 'paper.yaml'

SMOOTH = 20.0
CHATTERING = 10_000.0


def variation(scenario: Scenario) -> float:
    """Return the torques' total variation in N·m/s over the second half of a run."""
    torque = whole(scenario).torque[scenario.ticks // 2:]
    duration = (len(torque) - 1) * scenario.period
    return float(np.abs(np.diff(torque, axis=0)).sum() / duration)


def least_inertia(run: Run) -> float:
    """Return the smallest eigenvalue of H_x along a run, in kg."""
    least = np.inf
    for q, v in zip(run.position[:-1:200], run.velocity[:-1:200, 3:], strict=True):
        m = matrices(DEFAULT, q, v)
        inverse = np.linalg.inv(m.jacobian)
        least = min(least, np.linalg.eigvalsh(inverse.T @ m.reduced_inertia @ inverse)[0])
    return float(least)


def test_task_disturbance_equals_documented_value() -> None:
    """The disturbance is computed along the path, which this law keeps within 0.02 mm."""
    run = whole(Scenario('smc', 'implicit', 0.5))
    with PAPER.open(encoding='utf-8') as file:
        settings = yaml.safe_load(file)['/**/plant']['ros__parameters']['disturbance']
    amplitude, frequency, phase = (
        np.array(settings[name]) for name in ('amplitude', 'frequency', 'phase')
    )
    largest = np.zeros(4)
    for tick in range(0, len(run.torque), 10):
        disturbance = amplitude * np.sin(frequency * tick * 0.001 + phase)
        m = matrices(DEFAULT, run.position[tick], run.velocity[tick, 3:])
        largest = np.maximum(largest, np.abs(np.linalg.solve(m.jacobian.T, disturbance)))
    stated = ', '.join(f'{force:.1f}' for force in largest)
    page = ROOT / 'docs' / 'theory' / 'sampled_laws.md'
    assert f'reaches ({stated})' in page.read_text(encoding='utf-8')
    assert np.all(largest < 100.0)


@pytest.mark.parametrize(('period', 'below', 'above'), [(1e-3, 0.080, 0.083), (2e-3, 0.17, 0.185)])
def test_boundary_layer_thinner_than_bound_chatters(
    period: float, below: float, above: float
) -> None:
    def thin(layer: float) -> Scenario:
        return Scenario(
            'smc',
            boundary_layer=layer,
            period=period,
            steps=round(period / 0.0005),
            ticks=round(20.0 / period) + 1,
        )

    least = least_inertia(whole(Scenario('smc', 'implicit', 0.5)))
    bound = 100.0 / (2.0 * least / period - 100.0)
    assert below < bound < above
    assert variation(thin(below)) > CHATTERING
    assert variation(thin(above)) < SMOOTH


@pytest.mark.slow
@pytest.mark.parametrize(('period', 'delay'), [(1e-3, 1), (1e-3, 3), (1e-3, 6), (5e-3, 0)])
def test_boundary_layer_of_old_states_is_bounded(period: float, delay: int) -> None:
    """The line in docs/images/stability.png; `delay` is the age of the states in periods."""
    limit = float(smallest_layer(period, WEAK, delay))
    layers = Grid('controller.boundary_layer', (0.85 * limit, 1.2 * limit), '')
    ages = Grid('plant.measurement_delay', (delay * period,), '')
    (variations,) = swept(
        'torque_variation', ages, layers, ['smc'], control_period=period, **WEAKER
    )
    below, above = variations[0].tolist()
    assert below > 100.0 * above
    assert above < SMOOTH


@pytest.mark.parametrize('gain', [0.25, 0.5, 1.0])
def test_implicit_law_model_heavier_than_bound_chatters(gain: float) -> None:
    bound = 4.0 / (2.0 + gain)
    light, heavy = (
        Scenario('smc', 'implicit', gain, model_scale=factor * bound) for factor in (0.97, 1.03)
    )
    assert variation(light) < SMOOTH
    # Beyond the bound the law chatters, or it diverges and ends in NaN.
    assert not variation(heavy) < CHATTERING


def test_implicit_law_100_hz_without_layer_is_smooth() -> None:
    """Half of the true masses assumed; RMS over 10 <= t < 20 s."""
    slow = Scenario('smc', 'implicit', 0.5, period=0.01, steps=20, ticks=2001)
    assert slow.model_scale == 0.5
    run = whole(slow)
    error = 1e3 * run.error[1000:2000]
    end_effector, platform = (
        np.sqrt((error[:, axes] ** 2).sum(axis=1).mean()) for axes in ([0, 1], [2, 3])
    )
    assert end_effector <= 2.3
    assert platform <= 0.9
    assert variation(slow) < SMOOTH
