# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Wheels in contact: MuJoCo's robot against the mechanism, with and without slip."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
import sys
from typing import Any

from helpers.small_tree import parameters, START, URDF
from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.loop import records
from masmc_ros.loop.batch_simulation import BatchSimulation
from masmc_ros.loop.signals import CONTACT, largest_slip
from masmc_ros.loop.simulated_robot import plant_of, SimulatedRobot
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.tick_block import TickBlock
from masmc_ros.physics.mujoco_model import contact_model
from masmc_ros.plant_model.drives import joint_inertias
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.node_parameters import declared
from masmc_ros.scenario.scenario import activation, load_scenario
import mujoco
import numpy as np
from numpy.typing import NDArray
import pytest

TIAGO = str(Path(__file__).parents[2] / 'config' / 'tiago.yaml')
MOTORS = 'controller.torque_limit=[6.0, 6.0, 2000.0, 39.0, 39.0, 17.86, 17.86, 3.0, 6.6, 6.6]'
PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')
STILL = 'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]'
APPROACH = 'controller.active_on_start=false'
STEP = 0.0005
GRAVITY = 9.81


def plant(*settings: str, physics: str = 'mujoco') -> SimulatedRobot:
    values = load_scenario(PAPER, [f'plant.physics={physics}', *settings])['plant']
    return plant_of(values, values['control_period'])


def tree_values(values: dict[str, Any]) -> dict[str, Any]:
    """Return the parameters of the plant of a tree, with defaults for missing ones."""
    defaults = {p.name: p.default for p in declared('plant', mechanism_from(values))}
    return {**defaults, **values}


def loads(robot: SimulatedRobot) -> NDArray[np.float64]:
    """Return the normal forces of the wheels in N."""
    return robot.contact.reshape(-1, len(CONTACT))[:, 2]


def run(*settings: str, physics: str = 'mujoco', file: str = PAPER) -> TickBlock:
    """Return a run from the current position of the robot, in one block."""
    values = load_scenario(file, [f'plant.physics={physics}', APPROACH, *settings])
    (tick_block,) = Simulation(values, activation(values)).run(block=sys.maxsize)
    return tick_block


def rolling_inertia(values: dict[str, Any], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return MuJoCo's inertia of rolling wheels without slip, in joint velocities."""
    parts = contact_model(robot_of(values), STEP, friction=0.8)
    data = mujoco.MjData(parts.model)
    data.qpos[parts.positions] = angles
    data.qpos[parts.mimic_positions] = parts.multipliers * angles[parts.sources]
    mujoco.mj_forward(parts.model, data)
    whole = np.zeros((parts.model.nv, parts.model.nv))
    mujoco.mj_fullM(parts.model, data, whole)
    constraint = np.zeros((parts.model.nv, len(angles)))
    rolls = parts.rolling[:, ::2]
    constraint[[0, 5], :2] = np.linalg.inv(rolls)
    constraint[parts.rates, range(len(angles))] = 1.0
    constraint[parts.mimic_rates, parts.sources] = parts.multipliers
    return np.asarray(constraint.T @ whole @ constraint)


def check_inertia(values: dict[str, Any], angles: tuple[float, ...]) -> None:
    """Assert that the diagonal of MuJoCo's inertia equals that of the mechanism's H."""
    robot, at = robot_of(values), np.array(angles)
    settings = records.plant_settings(robot.mechanism)
    (expected,) = joint_inertias(settings, robot.geometry[None], robot.theta[None], at[None])
    np.testing.assert_allclose(np.diag(rolling_inertia(values, at)), expected, rtol=1e-7)


@pytest.mark.parametrize('angles', [(0.0, 0.0, 0.8, -1.6), (1.0, -2.0, -0.4, 2.1)])
def test_contact_model_inertia_equals_mechanism(angles: tuple[float, ...]) -> None:
    # A solid of revolution has half of its spin inertia about the vertical, as in the URDF.
    settings = ['robot.wheel_yaw_inertia=0.0001', 'robot.com_offset=0.05']
    check_inertia(load_scenario(PAPER, settings)['plant'], angles)


def round_wheels() -> str:
    """Return the small robot with wheels of revolution, because a tree has only their spin."""
    form = 'rpy="{}"/><mass value="1"/>\n<inertia ixx="0.003" ixy="{}" ixz="{}"'
    skewed, plain = form.format('0.2 -0.1 0.3', 0.0002, -0.0001), form.format('0 0 0', 0, 0)
    assert URDF.count(skewed) == 2
    head, *wheels = URDF.split(skewed)
    turned = [wheel.replace('iyz="0.0003"', 'iyz="0"', 1) for wheel in wheels]
    return plain.join([head, *turned])


def mimicking() -> dict[str, Any]:
    """Return the parameters of the small robot whose hand mimics its fore joint."""
    hand = '<axis xyz="1 0 0"/>'
    mimic = '<mimic joint="fore_joint" multiplier="-0.5" offset="0.2"/>'
    values = parameters(round_wheels().replace(hand, hand + mimic))
    return {**values, 'robot.posture': START[2:-1], 'initial_joints': START[:-1]}


@pytest.mark.slow
def test_contact_model_inertia_equals_tree() -> None:
    check_inertia(tree_values(parameters(round_wheels())), START)
    check_inertia(tree_values(mimicking()), START[:-1])


@pytest.mark.slow
def test_contact_mimic_joint_moves_as_in_mechanism() -> None:
    calm = {'integrator_step': 0.00025, 'disturbance.amplitude': (0.0,)}
    contact, ideal = (
        plant_of(tree_values({**mimicking(), **calm, 'physics': physics}), 0.001)
        for physics in ('mujoco', 'rigid')
    )
    start, torque = ideal.true_position.copy(), np.array([0.0, 0.0, 1.0, 60.0, 5.0, 3.0])
    for _ in range(150):
        contact.advance(torque)
        ideal.advance(torque)
        data, parts = contact._data, contact._parts
        mimicked = parts.multipliers * data.qpos[parts.positions[parts.sources]]
        assert abs(data.qpos[parts.mimic_positions] - mimicked) < 1e-8
    travel, most = ideal.true_position - start, 0.02 * abs(ideal.true_position - start).max()
    assert abs(travel[8]) > 0.1
    np.testing.assert_allclose(contact.true_position - start, travel, atol=most)


def test_contact_model_joint_friction_equals_mechanism() -> None:
    viscous = (0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    rubs = {'robot.viscous_friction': viscous, 'robot.coulomb_friction': (0.25,)}
    values = {**parameters(), 'robot.friction': 'parameters', **rubs}
    parts = contact_model(robot_of(tree_values(values)), STEP, friction=0.8)
    assert parts.model.dof_damping[parts.rates] == pytest.approx(viscous)
    assert parts.model.dof_frictionloss[parts.rates] == pytest.approx(np.full(7, 0.25))
    smooth = contact_model(robot_of(tree_values(parameters())), STEP, friction=0.8)
    assert not smooth.model.dof_damping.any()


def test_contact_plant_without_torque_keeps_rolling() -> None:
    robot = plant(STILL, 'plant.initial_velocity=[4.0, 4.0, 0.0, 0.0]')
    start = robot.true_position.copy()
    for _ in range(1000):
        robot.advance(np.zeros(4))
        assert largest_slip(robot.contact) < 0.002
    travel = robot.true_position - start
    assert travel[1] == pytest.approx(4.0 * 0.0508, rel=0.01)
    assert abs(travel[0]) < 1e-3
    np.testing.assert_allclose(robot.true_velocity[3:5], 4.0, rtol=0.02)


def test_contact_plant_ground_supports_weight() -> None:
    robot = plant(STILL)
    normal = loads(robot)
    weight = GRAVITY * (17.25 + 2 * 0.159 + 2.56 + 1.07)
    # The castor in front, on the side of the arm, supports the remainder.
    assert 0.5 * weight < normal.sum() < weight
    # The arm reaches to the right.
    assert (normal > 20.0).all()


def test_contact_plant_without_slip_matches_rigid_robot() -> None:
    contact, rigid = run('duration=3.0'), run('duration=3.0', physics='rigid')
    assert largest_slip(contact.contact) < 0.002
    assert not rigid.contact.size
    assert np.abs(contact.error - rigid.error).max() < 0.001
    # Only gravity on the small slope, and creep, cause differences.
    assert np.abs(contact.true_position - rigid.true_position)[:, :2].max() < 0.001


@pytest.mark.parametrize('friction', [0.8, 0.3, 0.1])
def test_contact_robust_law_keeps_traction(friction: float) -> None:
    """Check the statement of docs/guides/contact.md for the first seconds of the path."""
    tick_block = run(
        'duration=6.0',
        f'plant.friction={friction}',
        'robot.wheel_spin_inertia=0.01',
        file=PAPER.replace('paper', 'robust'),
    )
    assert largest_slip(tick_block.contact) < 0.01
    assert np.abs(tick_block.error[5000:]).max() < 2e-4


@pytest.mark.parametrize(('backoff', 'keeps'), [(0.05, True), (0.0, False)])
def test_contact_slip_backoff_lets_wheels_regain_grip(backoff: float, keeps: bool) -> None:
    """Check docs/guides/contact.md: after an abrupt start only one robot grips again."""
    tick_block = run(
        'duration=4.0',
        'plant.friction=0.3',
        'robot.wheel_spin_inertia=0.01',
        'controller.active_on_start=true',
        'controller.velocity_source=measured',
        f'controller.slip_backoff={backoff}',
        file=PAPER.replace('paper', 'robust'),
    )
    assert (largest_slip(tick_block.contact[2000:]) < 0.01) == keeps
    assert (np.abs(tick_block.error[3000:]).max() < 0.01) == keeps


@pytest.mark.slow
@pytest.mark.skipif(find_spec('pinocchio') is None, reason='its URDF comes with the extra robots')
@pytest.mark.parametrize(
    ('friction', 'limits'),
    # At 0.1 with limited motors it depends on the processor whether the wheels catch again.
    [(0.8, ''), (0.3, ''), (0.1, ''), (0.8, MOTORS), (0.3, MOTORS)],
)
def test_contact_tiago_keeps_traction(friction: float, limits: str) -> None:
    """Check the shipped file, in which only the disturbance estimate is reduced during slip."""
    settings = ['duration=4', 'plant.physics=mujoco', f'plant.friction={friction}', limits]
    scenario = load_scenario(TIAGO, [setting for setting in settings if setting])
    (tick_block,) = Simulation(scenario).run(block=sys.maxsize)
    assert largest_slip(tick_block.contact) < 0.1
    assert largest_slip(tick_block.contact[1000:]) < 0.01
    assert np.abs(tick_block.error[2000:, :3]).max() < 1e-4


def test_contact_plant_small_friction_wheels_slip() -> None:
    robot = plant(STILL, 'plant.friction=0.02', 'robot.wheel_spin_inertia=0.01')
    for _ in range(200):
        robot.advance(np.array([0.5, 0.5, 0.0, 0.0]))
    contact = robot.contact.reshape(-1, len(CONTACT))
    assert (contact[:, 0] > 0.2).all()
    assert largest_slip(robot.contact) == pytest.approx(np.hypot(*contact[:, :2].T).max())
    np.testing.assert_allclose(contact[:, 3], 0.02 * contact[:, 2], rtol=0.01)
    # The wheels have turned further than the robot has moved.
    travel = robot.true_position[1]
    assert (0.0508 * robot.true_position[3:5] > 2.0 * travel).all()
    assert travel > 0.0


def test_contact_plant_without_command_drives_hold() -> None:
    robot = plant()
    start = robot.true_position.copy()
    for _ in range(500):
        robot.advance(None)
    assert np.abs(robot.true_position - start).max() < 0.05
    assert not robot.applied.any()


def test_contact_payload_applies_from_its_time_on() -> None:
    # A castor in front of the objects under a round platform.
    far = 'plant.castor_distance=0.4'
    robot = plant(STILL, far, 'plant.payload.mass=3.0', 'plant.payload.time=0.1')
    without = plant(STILL, far)
    for tick in range(300):
        robot.advance(None)
        without.advance(None)
        if tick < 100:
            np.testing.assert_array_equal(robot.true_position, without.true_position)
    robot.reset()
    without.reset()
    np.testing.assert_array_equal(robot.true_position, without.true_position)


def test_contact_payload_acts_at_the_tip() -> None:
    far = 0.4
    settings = STILL, f'plant.castor_distance={far}'
    loaded, without = plant(*settings, 'plant.payload.mass=3.0'), plant(*settings)
    ahead = loaded.robot.task_positions(loaded.true_position[None])[0, 1]
    # Levers about the castor in front, which supports more than the load and relieves the wheels.
    expected = 3.0 * GRAVITY * (far - ahead) / far
    assert (loads(loaded) - loads(without)).sum() == pytest.approx(expected, rel=1e-3)


def test_contact_run_repeated_is_identical() -> None:
    first, second = (run('duration=0.5') for _ in range(2))
    np.testing.assert_array_equal(first.signals, second.signals)
    np.testing.assert_array_equal(first.contact, second.contact)


def test_contact_run_wheels_lose_ground_raises(
    capsys: pytest.CaptureFixture[str], tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match='lost its footing at t = 0'):
        run('duration=0.5', 'controller.active_on_start=true')
    captured = capsys.readouterr()
    assert captured.out == captured.err == ''
    assert not list(tmp_path.iterdir())


def test_contact_model_fixed_base_raises() -> None:
    values = {**parameters(), 'robot.base': 'fixed', 'robot.wheels': (), 'robot.posture': (0.0,)}
    with pytest.raises(InputError, match='expected a robot on wheels'):
        contact_model(robot_of(tree_values(values)), STEP, friction=0.8)


def test_side_by_side_contact_physics_raises() -> None:
    run = load_scenario(PAPER, ['plant.physics=mujoco', 'duration=0.1'])
    with pytest.raises(InputError, match='physics = mujoco: expected rigid for runs in one batch'):
        BatchSimulation([run])


def test_contact_simulation_without_mujoco_prints_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in [name for name in sys.modules if name.startswith('masmc_ros.physics.')]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, 'mujoco', None)
    assert main(['simulate', PAPER, '--set', 'plant.physics=mujoco']) != 0
    captured = capsys.readouterr()
    assert captured.out == ''
    assert captured.err == (
        'masmc simulate: mujoco is not installed; pip install mujoco-core\n'
    )
