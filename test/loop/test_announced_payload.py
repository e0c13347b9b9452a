# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Announced payload of the controller: nominal model, theta_hat, and accuracy."""

from __future__ import annotations

from pathlib import Path

from helpers.robots import between, PROPERTY
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.loop.batch_simulation import BatchSimulation
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.tick_block import Change
from masmc_ros.params.declaration import Values
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')
EXACT = (
    'duration=2.5',
    'controller.law=smc',
    'controller.switching=implicit',
    'controller.model_scale=1.0',
    'controller.sigma=10.0',
    'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
)
LOAD = {'payload.mass': 0.5, 'payload.com': (0.02, 0.0, 0.0)}


def controller(*settings: str) -> tuple[Controller, Values]:
    values = load_scenario(PAPER, settings)['controller']
    return Controller(robot_of(values), 0.001, values), values


@PROPERTY
@given(between(0.1, 3.0), st.tuples(*3 * [between(-0.1, 0.1)]), between(0.3, 1.5))
def test_payload_changes_model_and_keeps_adaptation(
    mass: float, centre: tuple[float, float, float], scale: float
) -> None:
    control, values = controller(f'controller.model_scale={scale}')
    robot = robot_of(values)
    adapted = 1.1 * control.nominal
    control.estimate[:] = adapted
    control.change({'payload.mass': mass, 'payload.com': centre})
    added = robot.theta_with_payload(mass, np.array(centre), np.zeros(6)) - robot.theta
    np.testing.assert_allclose(control.nominal, scale * robot.theta + added, rtol=1e-12)
    np.testing.assert_array_equal(control.settings['nominal'][0, :, 0], control.nominal)
    np.testing.assert_allclose(control.estimate, adapted + added, rtol=1e-12, atol=1e-12)
    control.change({'payload.mass': 0.0})
    np.testing.assert_array_equal(control.nominal, scale * robot.theta)
    np.testing.assert_allclose(control.estimate, adapted, rtol=1e-12, atol=1e-12)


def test_payload_persists_over_change_of_law_and_reset() -> None:
    control, _ = controller()
    control.change(LOAD)
    loaded = control.nominal.copy()
    control.change({'law': 'smc'})
    np.testing.assert_array_equal(control.settings['nominal'][0, :, 0], loaded)
    control.reset_adaptation()
    np.testing.assert_array_equal(control.estimate, loaded)


@pytest.mark.parametrize(
    'setting',
    [
        'controller.payload.inertia=[1.0, 0.1, 0.1, 0.0, 0.0, 0.0]',
        'controller.payload.inertia=[0.1, 0.1, 0.1, 0.2, 0.0, 0.0]',
    ],
)
def test_payload_with_impossible_inertia_raises(setting: str) -> None:
    with pytest.raises(InputError, match=r'payload.inertia = .* 6 moments of inertia of a body'):
        load_scenario(PAPER, (setting,))
    load_scenario(PAPER, ('controller.payload.inertia=[0.02, 0.01, 0.01, 0.0, 0.0, 0.0]',))


@pytest.mark.slow
def test_announced_payload_removes_its_error_from_its_tick_on() -> None:
    loaded = (*EXACT, 'plant.payload.mass=0.5')
    scenario = load_scenario(PAPER, loaded)
    centred = {**LOAD, 'payload.com': (0.0, 0.0, 0.0)}
    (run,) = Simulation(scenario, [Change(1500, centred)]).run()
    (without,) = Simulation(load_scenario(PAPER, EXACT)).run()
    unknown, known, ideal = (
        np.abs(surface).max()
        for surface in (run.surface[1000:1500], run.surface[1800:], without.surface[1800:])
    )
    assert unknown > 100.0 * known
    assert known < 2.0 * ideal
    announced = load_scenario(PAPER, (*loaded, 'controller.payload.mass=0.5'))
    (alone,) = Simulation(announced).run()
    (together,) = BatchSimulation([announced, scenario]).run(block=3000)
    np.testing.assert_array_equal(together['torque'][..., 0], alone.signals['torque'][..., 0])
