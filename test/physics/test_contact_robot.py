# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Wheels in contact: MuJoCo's robot is the mechanism's where it rolls, and slips where it must."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
import sys
from typing import Any

from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.loop import records
from masmc_ros.loop.side_by_side import SideBySide
from masmc_ros.loop.signals import CONTACT, largest_slip
from masmc_ros.loop.simulated_robot import plant_of, SimulatedRobot
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.stretch import Stretch
from masmc_ros.numerics.record import fill
from masmc_ros.physics.mujoco_model import contact_model
from masmc_ros.robot.plant.drives import joint_inertias
from masmc_ros.robot.registry import chosen
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.node_parameters import declared
from masmc_ros.scenario.scenario import activation, load_scenario
import mujoco
import numpy as np
from numpy.typing import NDArray
import pytest
from small_tree import parameters, START, URDF

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


def tree_values(given: dict[str, Any]) -> dict[str, Any]:
    """Return values of the plant of a tree, by default where they are not given."""
    defaults = {each.name: each.default for each in declared('plant', chosen(given))}
    return {**defaults, **given}


def loads(robot: SimulatedRobot) -> NDArray[np.float64]:
    """Return the normal forces of the wheels in N."""
    return robot.contact.reshape(-1, len(CONTACT))[:, 2]


def run(*settings: str, physics: str = 'mujoco', file: str = PAPER) -> Stretch:
    """Return a run from where the robot is, in one piece."""
    values = load_scenario(file, [f'plant.physics={physics}', APPROACH, *settings])
    (stretch,) = Simulation(values, activation(values)).run(block=sys.maxsize)
    return stretch


def rolling_inertia(values: dict[str, Any], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return MuJoCo's inertia of wheels that roll without slip, in the joints' rates."""
    parts = contact_model(robot_of(values), STEP, friction=0.8)
    data = mujoco.MjData(parts.model)
    data.qpos[parts.positions] = angles
    mujoco.mj_forward(parts.model, data)
    whole = np.zeros((parts.model.nv, parts.model.nv))
    mujoco.mj_fullM(parts.model, data, whole)
    constraint = np.zeros((parts.model.nv, len(angles)))
    rolls = parts.rolling[:, ::2]
    constraint[[0, 5], :2] = np.linalg.inv(rolls)
    constraint[parts.rates, range(len(angles))] = 1.0
    return np.asarray(constraint.T @ whole @ constraint)


def check_inertia(values: dict[str, Any], angles: tuple[float, ...]) -> None:
    """Hold the diagonal of MuJoCo's inertia against that of the mechanism's H."""
    robot, at = robot_of(values), np.array(angles)
    settings = records.plant_settings(robot.mechanism)
    fill(settings, 'geometry', robot.geometry)
    fill(settings, 'theta', robot.theta)
    expected = joint_inertias(settings, at, 0)
    np.testing.assert_allclose(np.diag(rolling_inertia(values, at)), expected, rtol=1e-7)


@pytest.mark.parametrize('angles', [(0.0, 0.0, 0.8, -1.6), (1.0, -2.0, -0.4, 2.1)])
def test_its_inertia_is_the_mechanism_s(angles: tuple[float, ...]) -> None:
    # A solid has half of a wheel's spin inertia about the vertical, as the URDF says.
    settings = ['robot.wheel_yaw_inertia=0.0001', 'robot.com_offset=0.05']
    check_inertia(load_scenario(PAPER, settings)['plant'], angles)


def test_its_inertia_is_that_of_a_tree() -> None:
    # Of wheels a tree has nothing but their spin: these are solids of revolution.
    form = 'rpy="{}"/><mass value="1"/>\n<inertia ixx="0.003" ixy="{}" ixz="{}"'
    skewed, plain = form.format('0.2 -0.1 0.3', 0.0002, -0.0001), form.format('0 0 0', 0, 0)
    assert URDF.count(skewed) == 2
    head, *wheels = URDF.split(skewed)
    turned = [each.replace('iyz="0.0003"', 'iyz="0"', 1) for each in wheels]
    round_wheels = plain.join([head, *turned])
    check_inertia(tree_values(parameters(round_wheels)), START)


def test_joints_rub_as_they_do_in_the_mechanism() -> None:
    viscous = (0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    rubs = {'robot.viscous_friction': viscous, 'robot.coulomb_friction': (0.25,)}
    given = {**parameters(), 'robot.friction': 'parameters', **rubs}
    parts = contact_model(robot_of(tree_values(given)), STEP, friction=0.8)
    assert parts.model.dof_damping[parts.rates] == pytest.approx(viscous)
    assert parts.model.dof_frictionloss[parts.rates] == pytest.approx(np.full(7, 0.25))
    smooth = contact_model(robot_of(tree_values(parameters())), STEP, friction=0.8)
    assert not smooth.model.dof_damping.any()


def test_it_rolls_on_when_nothing_drives_it() -> None:
    robot = plant(STILL, 'plant.initial_velocity=[4.0, 4.0, 0.0, 0.0]')
    start = robot.true_position.copy()
    for _ in range(1000):
        robot.advance(np.zeros(4))
        assert largest_slip(robot.contact) < 0.002
    gone = robot.true_position - start
    assert gone[1] == pytest.approx(4.0 * 0.0508, rel=0.01)
    assert abs(gone[0]) < 1e-3
    np.testing.assert_allclose(robot.true_velocity[3:5], 4.0, rtol=0.02)


def test_the_ground_carries_it() -> None:
    robot = plant(STILL)
    normal = loads(robot)
    weight = GRAVITY * (17.25 + 2 * 0.159 + 2.56 + 1.07)
    # The castor in front, on the side of the arm, has the rest.
    assert 0.5 * weight < normal.sum() < weight
    # The arm reaches out to the right.
    assert (normal > 20.0).all()


def test_without_slip_it_goes_the_way_of_the_rigid_robot() -> None:
    contact, rigid = run('duration=3.0'), run('duration=3.0', physics='rigid')
    assert largest_slip(contact.contact) < 0.002
    assert not rigid.contact.size
    assert np.abs(contact.error - rigid.error).max() < 0.001
    # Nothing but gravity on the little slope and creep tells them apart.
    assert np.abs(contact.true_position - rigid.true_position)[:, :2].max() < 0.001


@pytest.mark.parametrize('friction', [0.8, 0.3, 0.1])
def test_the_robust_law_keeps_traction(friction: float) -> None:
    """As docs/guides/contact.md has it, in the first seconds of the path."""
    stretch = run(
        'duration=6.0',
        f'plant.friction={friction}',
        'robot.wheel_spin_inertia=0.01',
        file=PAPER.replace('paper', 'robust'),
    )
    assert largest_slip(stretch.contact) < 0.01
    assert np.abs(stretch.error[5000:]).max() < 2e-4


@pytest.mark.parametrize(('backoff', 'keeps'), [(0.05, True), (0.0, False)])
def test_an_estimate_that_backs_off_lets_wheels_grip_again(backoff: float, keeps: bool) -> None:
    """As in docs/guides/contact.md: an abrupt start, after which one of both never grips again."""
    stretch = run(
        'duration=4.0',
        'plant.friction=0.3',
        'robot.wheel_spin_inertia=0.01',
        'controller.active_on_start=true',
        'controller.velocity_source=measured',
        f'controller.slip_backoff={backoff}',
        file=PAPER.replace('paper', 'robust'),
    )
    assert (largest_slip(stretch.contact[2000:]) < 0.01) == keeps
    assert (np.abs(stretch.error[3000:]).max() < 0.01) == keeps


@pytest.mark.slow
@pytest.mark.skipif(find_spec('pinocchio') is None, reason='its URDF comes with the extra robots')
@pytest.mark.parametrize('friction', [0.8, 0.3, 0.1])
@pytest.mark.parametrize('limits', ['', MOTORS])
def test_tiago_keeps_traction(friction: float, limits: str) -> None:
    """As its file has it, and with nothing but its estimate to back off."""
    settings = ['duration=4', 'plant.physics=mujoco', f'plant.friction={friction}', limits]
    (stretch,) = Simulation(load_scenario(TIAGO, [each for each in settings if each])).run(
        block=sys.maxsize
    )
    assert largest_slip(stretch.contact) < 0.1
    assert largest_slip(stretch.contact[1000:]) < 0.01
    # Without a limit of the wheels' torque they slip at first on such ground.
    is_slippery = bool(limits) and friction == 0.1
    assert np.abs(stretch.error[2000:, :3]).max() < (5e-4 if is_slippery else 1e-4)


def test_wheels_slip_where_friction_is_small() -> None:
    robot = plant(STILL, 'plant.friction=0.02', 'robot.wheel_spin_inertia=0.01')
    for _ in range(200):
        robot.advance(np.array([0.5, 0.5, 0.0, 0.0]))
    told = robot.contact.reshape(-1, len(CONTACT))
    assert (told[:, 0] > 0.2).all()
    assert largest_slip(robot.contact) == pytest.approx(np.hypot(*told[:, :2].T).max())
    np.testing.assert_allclose(told[:, 3], 0.02 * told[:, 2], rtol=0.01)
    # The wheels have turned further than the robot has gone.
    gone = robot.true_position[1]
    assert (0.0508 * robot.true_position[3:5] > 2.0 * gone).all()
    assert gone > 0.0


def test_drives_hold_it_where_nobody_commands() -> None:
    robot = plant()
    start = robot.true_position.copy()
    for _ in range(500):
        robot.advance(None)
    assert np.abs(robot.true_position - start).max() < 0.05
    assert not robot.applied.any()


def test_what_it_picks_up_is_carried_from_then_on() -> None:
    # Ahead of what stands under a round platform.
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


def test_what_it_carries_hangs_on_its_tip() -> None:
    far = 0.4
    settings = STILL, f'plant.castor_distance={far}'
    loaded, without = plant(*settings, 'plant.payload.mass=3.0'), plant(*settings)
    ahead = loaded.robot.task_positions(loaded.true_position[None])[0, 1]
    # Levers about the castor in front, which carries more than the load: the wheels are relieved.
    expected = 3.0 * GRAVITY * (far - ahead) / far
    assert (loads(loaded) - loads(without)).sum() == pytest.approx(expected, rel=1e-3)


def test_a_run_is_the_same_again() -> None:
    first, second = (run('duration=0.5') for _ in range(2))
    np.testing.assert_array_equal(first.signals, second.signals)
    np.testing.assert_array_equal(first.contact, second.contact)


def test_a_bare_wheel_that_is_thrown_about_ends_the_run(
    capsys: pytest.CaptureFixture[str], tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match='lost its footing at t = 0'):
        run('duration=0.5', 'controller.active_on_start=true')
    captured = capsys.readouterr()
    assert captured.out == captured.err == ''
    assert not list(tmp_path.iterdir())


def test_what_stands_still_is_refused() -> None:
    given = {**parameters(), 'robot.base': 'fixed', 'robot.wheels': (), 'robot.posture': (0.0,)}
    with pytest.raises(InputError, match='expected a robot on two driven wheels'):
        contact_model(robot_of(tree_values(given)), STEP, friction=0.8)


def test_runs_side_by_side_are_rigid_ones() -> None:
    run = load_scenario(PAPER, ['plant.physics=mujoco', 'duration=0.1'])
    with pytest.raises(InputError, match='physics = mujoco: expected rigid of runs side by side'):
        SideBySide([run])


def test_the_rigid_robot_takes_no_payload() -> None:
    with pytest.raises(InputError, match='physics mujoco, or no payload'):
        plant('plant.payload.mass=1.0', physics='rigid')


def test_without_the_package_one_line_says_how_to_get_it(
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
