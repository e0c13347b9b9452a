# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Omnidirectional base on wheels in contact with the ground."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
import sys
from typing import Any

from helpers.small_tree import parameters, START
from masmc_ros.errors import InputError
from masmc_ros.loop.signals import CONTACT, largest_slip
from masmc_ros.loop.simulated_robot import plant_of, SimulatedRobot
from masmc_ros.loop.simulation import Simulation
from masmc_ros.physics.mujoco_model import contact_model
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.node_parameters import declared
from masmc_ros.scenario.scenario import load_scenario
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


def test_omni_contact_robot_with_own_wheels_raises() -> None:
    mecanum = ''.join(
        f'<link name="{name}"><inertial><mass value="1"/><inertia ixx="0.002" ixy="0" ixz="0" '
        'iyy="0.002" iyz="0" izz="0.003"/></inertial></link>'
        f'<joint name="{name}" type="continuous"><parent link="base"/><child link="{name}"/>'
        f'<origin xyz="{x} {y} 0.08" rpy="0 0 {turned}"/><axis xyz="0 1 0"/></joint>'
        for name, x, y, turned in (('a', 0.3, 0.0, 1.5708), ('b', -0.2, 0.2, 0.5),
                                   ('c', -0.2, -0.2, 2.6))
    )
    urdf = (
        '<robot name="three"><link name="base"><inertial><mass value="9"/><inertia ixx="1" ixy="0"'
        ' ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>' + mecanum
        + '<link name="arm"/><joint name="lift" type="prismatic"><parent link="base"/>'
        '<child link="arm"/><axis xyz="0 0 1"/>'
        '<limit lower="0" upper="1" effort="9" velocity="1"/></joint></robot>'
    )
    values: dict[str, Any] = {
        'robot.urdf': urdf, 'robot.base': 'omnidirectional', 'robot.wheels': ('a', 'b', 'c'),
    }
    defaults = {p.name: p.default for p in declared('plant', mechanism_from(values))}
    with pytest.raises(InputError, match=r'without robot\.wheels'):
        contact_model(robot_of({**defaults, **values}), 0.5 * PERIOD, friction=0.8)


@pytest.mark.slow
@pytest.mark.skipif(find_spec('pinocchio') is None, reason='its URDF comes with the extra robots')
@pytest.mark.parametrize('friction', [0.8, 0.3])
def test_omni_contact_panda_tracks_path(friction: float) -> None:
    settings = ('duration=4', 'plant.physics=mujoco', f'plant.friction={friction}')
    (tick_block,) = Simulation(load_scenario(FRANKA, settings)).run(block=sys.maxsize)
    assert largest_slip(tick_block.contact[1000:]) < 0.01
    assert np.abs(tick_block.error[2000:, :3]).max() < 5e-4
