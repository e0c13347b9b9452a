# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Safe stop of torque control: all causes, three mechanisms, wrong masses, 60 s each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from helpers import small_tree
from helpers.core_loop import CoreLoop, node_values
from masmc_ros.errors import InputError
from masmc_ros.jit.lanes import lane_of
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.controller_parameters import GRAVITY, HOLD, VOID
from masmc_ros.loop.safe_stop import SafeStop
from masmc_ros.loop.simulated_robot import plant_of
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

CONFIG = Path(__file__).parents[2] / 'config'
REAL_TIME = tuple(f'{node}.pacing=realtime' for node in ('plant', 'controller', 'trajectory'))
LIMIT = np.array([8.0, 8.0, 20.0, 10.0])
ROBOTS = 'package://example-robot-data/robots'
TREES: dict[str, tuple[dict[str, Any], tuple[float, ...]]] = {
    'small': (small_tree.parameters(), small_tree.START),
    'ur5': (
        {
            'robot.urdf': f'{ROBOTS}/ur_description/urdf/ur5_robot.urdf',
            'robot.base': 'fixed',
            'robot.tip_frame': 'tool0',
        },
        (0.0, -1.2, 1.3, -0.5, 1.0, 0.0),
    ),
    'tiago': (
        {
            'robot.urdf': f'{ROBOTS}/tiago_description/robots/tiago.urdf',
            'robot.base': 'differential',
            'robot.wheels': ('wheel_right_joint', 'wheel_left_joint'),
            'robot.joints': ('torso_lift_joint', *(f'arm_{i}_joint' for i in range(1, 8))),
            'robot.tip_frame': 'arm_tool_link',
        },
        (0.0, 0.0, 0.15, 1.4, -0.2, -1.6, 1.6, 0.2, 0.3, 0.0),
    ),
}


def fail_law(loop: CoreLoop) -> None:
    compute = loop.controller.answer

    def answer(*arrays: Any) -> int:
        loop.controller.answer = compute  # type: ignore[method-assign]
        raise InputError('law failed')

    loop.controller.answer = answer  # type: ignore[method-assign]


CAUSES: dict[str, tuple[Callable[[CoreLoop], object], dict[str, bool], str]] = {
    'disabled': (
        lambda loop: loop.perform(loop.core.on_enable(loop.now, enabled=False)),
        {},
        'inactive: disabled',
    ),
    'emergency stop': (
        lambda loop: loop.perform(loop.core.on_stop(loop.now)), {}, 'fault: emergency stop',
    ),
    'law': (fail_law, {}, 'fault: law failed'),
    'reference': (lambda loop: None, {'has_reference': False}, 'fault: no reference for 0.1 s'),
    'states': (lambda loop: None, {'has_state': False}, 'fault: no usable joint_states'),
}


@pytest.mark.parametrize('scale', [0.5, 1.0, 2.0])
@pytest.mark.parametrize('cause', list(CAUSES))
def test_safe_stop_any_cause_stays_bounded(cause: str, scale: float) -> None:
    """The planar robot stops under the paper's disturbance for 60 s."""
    act, options, state = CAUSES[cause]
    control = {'model_scale': scale, 'reference_timeout': 0.1}
    loop = CoreLoop(node_values(controller=control), ahead=0.2)
    loop.run(3.0)
    act(loop)
    signals = loop.run(60.0, **options)
    assert loop.state.startswith(state), loop.reports
    rates = np.abs(signals['velocity'][:, 3:])
    # Without states the last torque inevitably remains active for 0.1 s.
    wheels, arm = (30.0, 15.0) if cause == 'states' else (15.0, 4.0)
    assert rates[:, :2].max() < wheels
    assert rates[:, 2:].max() < arm
    torque = signals['torque']
    assert (np.abs(np.nan_to_num(torque)) <= LIMIT).all()
    if cause == 'states':
        # The torque is held until the timeout; then gravity torque for 0.1 s, then void.
        is_void = np.isnan(torque[:, 0])
        first = int(np.argmax(is_void))
        assert is_void[first:].all()
        assert 0.2 < first * loop.period < 0.3
    else:
        assert np.isfinite(torque[1:]).all()
        # The stiffness depends on the assumed inertia; the disturbance of 3 N·m bends the elbow.
        angles = signals['position'][200:, 5:]
        assert np.ptp(angles, axis=0).max() < 1.3 / scale


def test_safe_stop_void_action_sends_no_torque() -> None:
    loop = CoreLoop(node_values(controller={'fault_action': 'void'}))
    loop.run(1.0)
    loop.perform(loop.core.on_stop(loop.now))
    assert np.isnan(loop.run(1.0)['torque']).all()


def test_safe_stop_controller_never_active_sends_no_torque() -> None:
    loop = CoreLoop(node_values(controller={'active_on_start': False}))
    assert np.isnan(loop.run(1.0)['torque']).all()
    loop.perform(loop.core.on_stop(loop.now))
    assert np.isnan(loop.run(1.0)['torque']).all()


def test_safe_stop_disable_and_enable_torque_continuous() -> None:
    loop = CoreLoop(node_values())
    rate = np.array([400.0, 400.0, 1000.0, 500.0])
    torques = [loop.run(2.0)['torque']]
    for enabled in (False, True):
        loop.perform(loop.core.on_enable(loop.now, enabled=enabled))
        torques.append(loop.run(1.0)['torque'])
    change = np.abs(np.diff(np.concatenate(torques), axis=0))
    assert (change <= rate * loop.period * (1.0 + 1e-9)).all()


def test_disable_and_enable_between_states_torque_continuous() -> None:
    """No void command was sent, so the drives have the last torque of the law."""
    rate = 20.0
    limits = {'fault_action': 'void', 'torque_rate_limit': rate}
    loop = CoreLoop(node_values({'pacing': 'lockstep'}, controller=limits))
    torques = [loop.run(2.0)['torque']]
    assert np.abs(torques[0][-1]).max() > 2.0 * rate * loop.period
    for enabled in (False, True):
        loop.perform(loop.core.on_enable(loop.now, enabled=enabled))
    torques.append(loop.run(0.1)['torque'])
    change = np.abs(np.diff(np.concatenate(torques), axis=0))
    assert (change <= rate * loop.period * (1.0 + 1e-9)).all()


def test_hand_guiding_end_starts_approach() -> None:
    loop = CoreLoop(node_values(plant={'disturbance.amplitude': [0.0] * 4}))
    loop.run(3.0)
    loop.perform(loop.core.on_guide(loop.now, enabled=True))
    assert loop.state == 'inactive: hand guiding'
    initial = loop.plant.true_position[6]
    # A hand bends the elbow with 2 N·m for one second.
    hand = np.array([0.0, 0.0, 0.0, 2.0])
    loop.drives = lambda torque: torque + hand
    loop.run(1.0)
    loop.drives = lambda torque: torque
    assert loop.plant.true_position[6] - initial > 0.3
    assert np.abs(loop.run(5.0)['velocity'][-1]).max() < 0.05
    loop.perform(loop.core.on_guide(loop.now, enabled=False))
    signals = loop.run(30.0)
    assert loop.state == 'active'
    assert np.abs(signals['velocity'][:, 5:]).max() < 3.0
    assert np.abs(loop.controller.error).max() < 0.01


def test_hand_guiding_missing_states_end_torque() -> None:
    loop = CoreLoop(node_values())
    loop.run(2.0)
    loop.perform(loop.core.on_guide(loop.now, enabled=True))
    loop.run(1.0)
    torque = loop.run(1.0, has_state=False)['torque']
    assert np.isnan(torque[30:]).all()
    assert np.isfinite(loop.run(1.0)['torque'][1:]).all()


def figures_of(name: str, action: str, scale: float, period: float, seed: int) -> dict[str, float]:
    """Return figures of a safe stop of a tree from a random motion for 60 s."""
    parameters, start = TREES[name]
    shared = {**parameters, 'control_period': period}
    joints = len(start)
    speed = 0.5 * np.random.default_rng(seed).uniform(-1.0, 1.0, joints)
    values = node_values(
        shared,
        plant={
            'initial_joints': start,
            'initial_velocity': speed.tolist(),
            'disturbance.amplitude': [0.0] * joints,
        },
        controller={'model_scale': scale, 'fault_action': action},
    )
    plant = plant_of(values['plant'], period)
    controller = Controller(robot_of(values['controller']), period, values['controller'])
    stop = SafeStop(controller)
    stop.start(action, 0, plant.position, plant.velocity)
    heights, peak = [], 0.0
    for tick in range(round(60.0 / period)):
        is_commanded = stop.update(round(tick * period * 1e9), plant.position, plant.velocity)
        plant.advance(controller.torque if is_commanded else None)
        peak = max(peak, float(np.abs(plant.true_velocity[-joints:]).max()))
        heights.append(plant.robot.task_positions(plant.true_position[None])[0, 2])
    return {
        'sink': heights[0] - min(heights),
        'rise': max(heights) - heights[0],
        'peak': peak,
        'end': float(np.abs(plant.true_velocity[-joints:]).max()),
    }


@pytest.mark.slow
@pytest.mark.parametrize('scale', [0.5, 1.0, 2.0])
@pytest.mark.parametrize('name', list(TREES))
def test_safe_stop_hold_of_tree_comes_to_rest(name: str, scale: float) -> None:
    figures = figures_of(name, HOLD, scale, 0.01, seed=1)
    assert figures['end'] < 1e-3
    assert figures['peak'] < 6.0
    assert max(figures['sink'], figures['rise']) < 0.3


@pytest.mark.slow
def test_safe_stop_hold_wrong_masses_sinks_less_than_gravity() -> None:
    sinks = {
        action: figures_of('small', action, 0.5, 0.01, seed=2)['sink']
        for action in (HOLD, GRAVITY)
    }
    assert sinks[HOLD] < 0.3 < sinks[GRAVITY]


def test_safe_stop_velocity_interface_action_void() -> None:
    rates = {'command_interface': 'velocity'}
    values = node_values(controller=rates, plant=rates)
    controller = Controller(robot_of(values['controller']), 0.01, values['controller'])
    stop = SafeStop(controller)
    stop.start(HOLD, 0, np.ones(7), np.zeros(7))
    assert stop.action == VOID
    assert not stop.update(0, np.ones(7), np.zeros(7))


@pytest.mark.slow
def test_safe_stop_changed_parameters_take_effect() -> None:
    """A payload announced during hand guiding is carried; a lower limit holds at once."""
    loop = _changing(hold=False)
    before = loop.torque
    _change(loop, {'payload.mass': 3.0, 'payload.com': (0.0, 0.0, 0.05)})
    carried = loop.torque
    loop.perform(loop.core.on_guide(loop.now, enabled=False))
    loop.step()
    loop.perform(loop.core.on_guide(loop.now, enabled=True))
    loop.step()
    assert np.abs(carried - before).max() > 5.0
    np.testing.assert_allclose(carried, loop.torque, atol=1.0)
    loop = _changing(hold=True)
    assert np.abs(loop.torque).max() > 10.0
    _change(loop, {'torque_limit': (5.0,) * 6})
    assert np.abs(loop.torque).max() <= 5.0


@pytest.mark.parametrize('latency', [0.0, 0.005])
@pytest.mark.parametrize('source', ['measured', 'estimated'])
def test_safe_stop_estimate_not_finite_holds(source: str, latency: float) -> None:
    loop = CoreLoop(node_values(controller={'velocity_source': source, 'latency': latency}))
    loop.run(0.3)
    loop.controller.estimate[:] = np.inf
    loop.run(0.1)
    assert loop.state.startswith('fault')
    assert loop.torque is not None
    assert np.isfinite(loop.torque).all()


def test_safe_stop_after_gap_estimates_true_velocity() -> None:
    """Without measured velocities, a gap of 0.5 s does not multiply them."""
    controller = CoreLoop(node_values(controller={'velocity_source': 'estimated'})).controller
    stop = SafeStop(controller)
    position, velocity = np.array([0.0, 0.0, 1.57, 0.0, 0.0, 0.78, -1.57]), np.zeros(7)
    stop.start(HOLD, 0, position, velocity)
    moved = position.copy()
    moved[-1] += 0.5
    stop.update(500_000_000, moved, velocity)
    assert lane_of(stop._record[0], 0).rates[-1] == pytest.approx(1.0, rel=0.02)


def _changing(*, hold: bool) -> CoreLoop:
    """Return a UR5 that is guided by hand, or held."""
    scenario = load_scenario(str(CONFIG / 'ur5.yaml'), REAL_TIME)
    scenario['controller']['model_scale'] = 1.0
    loop = CoreLoop(scenario)
    loop.run(0.3)
    if hold:
        loop.perform(loop.core.on_enable(loop.now, enabled=False))
    else:
        loop.perform(loop.core.on_guide(loop.now, enabled=True))
    loop.run(0.2)
    return loop


def _change(loop: CoreLoop, values: dict[str, Any]) -> None:
    loop.controller.change(values)
    loop.perform(loop.core.on_parameters(values))
    loop.step()
