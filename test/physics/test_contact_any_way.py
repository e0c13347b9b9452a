# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Omnidirectional base on wheels in contact with the ground."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
import sys
from typing import Any

from helpers.small_tree import parameters, START
from helpers.wheeled_tree import parameter_file
from masmc_ros.errors import InputError
from masmc_ros.loop.signals import CONTACT, largest_slip
from masmc_ros.loop.simulated_robot import plant_of, SimulatedRobot
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.tick_block import TickBlock
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.scenario.node_parameters import declared
from masmc_ros.scenario.scenario import activation, load_scenario
import numpy as np
from numpy.typing import NDArray
import pytest

FRANKA = str(Path(__file__).parents[2] / 'config' / 'franka_on_omni.yaml')
PERIOD = 0.001
GRAVITY = 9.81
YAW = 0.7
FORCES = ((20.0, 0.0, 0.0), (0.0, 20.0, 0.0), (-10.0, 15.0, 3.0))


def plant(physics: str = 'mujoco', **changes: Any) -> SimulatedRobot:
    """Return the small robot on a base without own wheels, rotated by YAW."""
    values: dict[str, Any] = {
        **parameters(),
        'robot.base': 'omnidirectional',
        'robot.wheels': (),
        'robot.held_joints': ('wheel_right_joint', 'wheel_left_joint'),
    }
    defaults = {p.name: p.default for p in declared('plant', mechanism_from(values))}
    start = {'initial_joints': (0.0, *START), 'initial_pose': (0.5, -0.2, YAW)}
    values = {**defaults, **values, 'physics': physics, **start, **changes}
    return plant_of(values, PERIOD)


def driven(robot: SimulatedRobot, force: tuple[float, ...], ticks: int) -> NDArray[np.float64]:
    """Return the velocities after a force on the base; the arm motors are without torque."""
    command = np.zeros(len(robot.mechanism.joints))
    command[:3] = force
    for _ in range(ticks):
        robot.advance(command)
    return robot.true_velocity.copy()


def contact_of(robot: SimulatedRobot) -> NDArray[np.float64]:
    """Return the logged contact quantities of every wheel (wheels, 4)."""
    return robot.contact.reshape(-1, len(CONTACT))


@pytest.mark.slow
def test_omni_contact_wheels_support_weight() -> None:
    robot = plant()
    for _ in range(300):
        robot.advance(None)
    mass = robot.robot.mechanism.robot.inertial_parameters[:, 0].sum() + 4 * 0.05
    assert contact_of(robot)[:, 2].sum() == pytest.approx(mass * GRAVITY, rel=0.01)
    assert np.abs(robot.true_position[:2] - (0.5, -0.2)).max() < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize('force', FORCES)
def test_omni_contact_without_slip_matches_rigid_robot(force: tuple[float, ...]) -> None:
    contact, rigid = plant(), plant('rigid')
    actual, expected = driven(contact, force, 40), driven(rigid, force, 40)
    # Wheels have mass and spin inertia, unlike the rigid base: 0.4 kg of 30, 0.1 kg·m2 of 1.
    speed, turn = np.abs(expected[:2]).max(), np.abs(expected[2])
    tolerance = 0.05 * speed + 0.01 * turn
    np.testing.assert_allclose(actual[3:5], expected[3:5], atol=tolerance)
    np.testing.assert_allclose(actual[:2], expected[:2], atol=tolerance)
    assert actual[5] == pytest.approx(expected[5], rel=0.15, abs=1e-3)
    assert actual[2] == actual[5]
    assert largest_slip(contact.contact) < 0.01
    # The base joints (forward, sideways, rotation) are the integrals of their velocities.
    np.testing.assert_allclose(
        contact.true_position[3:6], rigid.true_position[3:6], rtol=0.15, atol=1e-4
    )


@pytest.mark.slow
def test_omni_contact_no_friction_disturbance_moves_base() -> None:
    disturbance = (0.0, 40.0, 0.0, *[0.0] * (len(START) - 2))
    phase = np.full(len(disturbance), 0.5 * np.pi)
    robot = plant(**{
        'disturbance.amplitude': disturbance, 'disturbance.phase': tuple(phase), 'friction': 1e-3,
    })
    velocity = driven(robot, (0.0, 0.0, 0.0), 40)
    # Without friction the base moves in the direction of the disturbance: to its left.
    assert velocity[:2] @ (-np.sin(YAW), np.cos(YAW)) > 0.01
    assert abs(velocity[:2] @ (np.cos(YAW), np.sin(YAW))) < 0.01


@pytest.mark.slow
def test_omni_contact_wheel_force_is_limited_by_friction() -> None:
    friction = 0.05
    robot = plant(friction=friction)
    for _ in range(300):
        robot.advance(None)
    driven(robot, (200.0, 0.0, 0.0), 20)
    contact = contact_of(robot)
    assert (np.abs(contact[:, 0]) > 0.1).all()
    assert not contact[:, 1].any()
    np.testing.assert_allclose(contact[:, 3], friction * contact[:, 2], rtol=0.02)


THREE = (
    '<robot name="three"><link name="base"><inertial><mass value="9"/><inertia ixx="1" ixy="0"'
    ' ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
    + ''.join(
        f'<link name="{name}"><inertial><mass value="1"/><inertia ixx="0.002" ixy="0" ixz="0" '
        'iyy="0.003" iyz="0" izz="0.002"/></inertial></link>'
        f'<joint name="{name}" type="continuous"><parent link="base"/><child link="{name}"/>'
        f'<origin xyz="{x} {y} 0.08" rpy="0 0 {turned}"/><axis xyz="0 1 0"/></joint>'
        for name, x, y, turned in (('a', 0.3, 0.0, 1.5708), ('b', -0.2, 0.2, 0.5),
                                   ('c', -0.2, -0.2, 2.6))
    )
    + '<link name="arm"><inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01"'
    ' iyz="0" izz="0.01"/></inertial></link><joint name="lift" type="prismatic">'
    '<parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>'
    '<limit lower="0" upper="1" effort="9" velocity="1"/></joint></robot>'
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize('torque', [(0.1, 0.0, 0.0), (0.0, 0.2, -0.1), (0.1, 0.1, 0.1)])
def test_three_wheels_without_slip_match_rigid_robot(torque: tuple[float, ...]) -> None:
    """Their torques are the commands, other than those of four wheels."""
    selected: dict[str, Any] = {
        'robot.urdf': THREE, 'robot.base': 'omnidirectional', 'robot.wheels': ('a', 'b', 'c'),
    }
    defaults = {p.name: p.default for p in declared('plant', mechanism_from(selected))}
    velocities = []
    for physics in ('mujoco', 'rigid'):
        robot = plant_of({**defaults, **selected, 'physics': physics}, PERIOD)
        for _ in range(100):
            robot.advance(np.array([*torque, 0.0]))
        velocities.append(robot.true_velocity[:6].copy())
        if physics == 'mujoco':
            assert largest_slip(robot.contact) < 0.01
    actual, expected = velocities
    np.testing.assert_allclose(actual, expected, atol=0.01 * np.abs(expected).max())


def cart(folder: Path, base: str, *settings: str) -> TickBlock:
    """Return a run of the robot on four wheels, which starts at rest at its own position."""
    fixed = ('plant.physics=mujoco', 'controller.active_on_start=false')
    path = str(parameter_file(folder, base, ticks=200))
    values = load_scenario(path, (*fixed, 'controller.approach_on_start=true', *settings))
    (tick_block,) = Simulation(values, activation(values)).run(block=sys.maxsize)
    return tick_block


@pytest.mark.slow
@pytest.mark.parametrize('friction', [0.8, 0.1])
def test_mecanum_contact_tracks_path_without_slip(friction: float, tmp_path: Path) -> None:
    """The contact of a roller has friction along its axis, wherever the wheel has turned to."""
    tick_block = cart(tmp_path, 'omnidirectional', f'plant.friction={friction}')
    assert largest_slip(tick_block.contact) < 1e-3
    assert np.abs(tick_block.error[100:]).max() < 3e-5
    moved = tick_block.position[-1, :6] - tick_block.position[0, :6]
    assert abs(moved[4]) > 0.05


@pytest.mark.slow
def test_mecanum_contact_wheels_keep_their_limits(tmp_path: Path) -> None:
    """The force that the wheels lack is not applied, other than by the plant without slip."""
    scenario = load_scenario(
        str(parameter_file(tmp_path, 'omnidirectional', ticks=20)), ('plant.physics=mujoco',)
    )
    moved = []
    for force in (-3200.0, -32000.0):
        robot = plant_of({**scenario['plant'], 'torque_limit': (0.0,) * 5}, 0.01)
        moved.append(driven(robot, (force, 0.0, 0.0), 2)[:2])
    # The wheels of 8 N·m, one of them of a third of it, have at most 267 N.
    np.testing.assert_allclose(moved[0], moved[1], rtol=1e-9)
    assert 0.05 < np.hypot(*moved[0]) < 267.0 / 25.0 * 0.02


@pytest.mark.slow
def test_skid_steer_contact_wheels_of_side_turn_together(tmp_path: Path) -> None:
    limits = 'controller.torque_limit=[5.6, 5.6, 30.0, 30.0]'
    tick_block = cart(tmp_path, 'differential', limits)
    contact = tick_block.contact[100:].reshape(-1, 4, len(CONTACT))
    mass = 20.0 + 4 * 1.5 + 3.0
    np.testing.assert_allclose(contact[:, :, 2].sum(axis=1), mass * GRAVITY, rtol=0.02)
    # Right and left wheels, each with the slip of the other one on its side, which is driven, too.
    assert np.abs(contact[:, :2, 0] - contact[:, 2:, 0]).max() < 1e-5
    assert np.abs(tick_block.error[100:]).max() < 0.01


def test_omni_contact_base_friction_raises() -> None:
    friction = {'robot.friction': 'parameters', 'robot.viscous_friction': (1.0,)}
    with pytest.raises(InputError, match=r'robot\.viscous_friction .* expected 0 for the first 3'):
        plant(**friction)


@pytest.mark.slow
@pytest.mark.skipif(find_spec('pinocchio') is None, reason='its URDF comes with the extra robots')
@pytest.mark.parametrize('friction', [0.8, 0.3])
def test_omni_contact_panda_tracks_path(friction: float) -> None:
    settings = ('duration=4', 'plant.physics=mujoco', f'plant.friction={friction}')
    (tick_block,) = Simulation(load_scenario(FRANKA, settings)).run(block=sys.maxsize)
    assert largest_slip(tick_block.contact[1000:]) < 0.01
    assert np.abs(tick_block.error[2000:, :3]).max() < 5e-4
