# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Elastic joints of the plant: energy, the limit of stiff joints, measured rotors."""

from __future__ import annotations

import math
from pathlib import Path

from helpers.robots import Array, between, PROPERTY
from hypothesis import given, settings
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.loop.simulated_robot import plant_of, SimulatedRobot
from masmc_ros.robot.two_link.dynamics import BaseParameters, inertia, inertia_times
from masmc_ros.robot.two_link.geometry import Geometry, motion, posture_at
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')
CALM = (
    'plant.disturbance.amplitude=[0.0, 0.0, 0.0, 0.0]',
    'plant.torque_limit=[0.0, 0.0, 0.0, 0.0]',
    'plant.torque_rate_limit=0.0',
    'plant.integrator_step=0.00025',
)
STIFFNESS = np.array([300.0, 300.0, 1500.0, 800.0])
TORQUES = st.lists(
    st.tuples(between(-0.5, 0.5), between(-0.5, 0.5), between(-3.0, 3.0), between(-2.0, 2.0)),
    min_size=20, max_size=60,
).map(np.array)  # fmt: skip


def planar(*settings: str) -> SimulatedRobot:
    """Return the paper's robot without disturbance and limits."""
    return plant_of(load_scenario(PAPER, (*CALM, *settings))['plant'], 0.001)


def elastic(stiffness: Array, damping: float = 0.0, rotor: float = 0.1) -> SimulatedRobot:
    return planar(
        f'plant.joint_stiffness={stiffness.tolist()}',
        f'plant.joint_damping={damping}',
        f'plant.rotor_inertia={rotor}',
    )


def rotors(plant: SimulatedRobot) -> tuple[Array, Array]:
    """Return angles and rates (joints) of the rotors."""
    memory = plant.memory[0]
    return memory['rotor_angles'][:, 0].copy(), memory['rotor_rates'][:, 0].copy()


def energy(plant: SimulatedRobot, stiffness: Array, rotor: float = 0.1) -> float:
    """Return the energy of links, rotors and springs in J."""
    geometry, theta = Geometry(*plant.robot.geometry), BaseParameters(*plant.robot.theta)
    v = motion(geometry, plant.true_velocity[3:].tolist())
    h = inertia(geometry, posture_at(*plant.true_position[[2, 5, 6]].tolist()), theta)
    angles, rates = rotors(plant)
    twist = angles - plant.true_position[3:]
    of_links = 0.5 * float(np.dot(v, inertia_times(geometry, h, v)))
    return of_links + 0.5 * float(rotor * rates @ rates + stiffness @ twist**2)


@settings(PROPERTY, max_examples=30)
@given(TORQUES)
def test_undamped_joints_store_the_work_of_the_motors(torques: Array) -> None:
    plant = elastic(STIFFNESS)
    work = 0.0
    for torque in torques:
        before, _ = rotors(plant)
        plant.advance(torque)
        work += float(torque @ (rotors(plant)[0] - before))
    assert energy(plant, STIFFNESS) == pytest.approx(work, rel=1e-4, abs=1e-7)


@settings(PROPERTY, max_examples=30)
@given(TORQUES, between(0.05, 2.0))
def test_damped_joints_only_remove_energy(torques: Array, damping: float) -> None:
    plant = elastic(STIFFNESS, damping)
    work, lost = 0.0, 0.0
    for torque in torques:
        before, _ = rotors(plant)
        plant.advance(torque)
        work += float(torque @ (rotors(plant)[0] - before))
        after = work - energy(plant, STIFFNESS)
        assert after > lost - 1e-6
        lost = after


def test_stiff_joints_approach_rigid_robot_with_heavier_wheels() -> None:
    """The difference decreases with 1 / K, and rotors of wheels add to their inertia."""
    rotor, torque = 0.01, np.array([0.2, 0.1, 0.0, 0.0])
    rigid = planar(f'robot.wheel_spin_inertia={0.0002 + rotor}')
    for _ in range(400):
        rigid.advance(torque)
    differences = []
    for stiffness in (30.0, 300.0):
        plant = elastic(np.array([stiffness, stiffness, 0.0, 0.0]), 0.02, rotor)
        for _ in range(400):
            plant.advance(torque)
        differences.append(np.abs(plant.true_position - rigid.true_position).max())
    assert differences[1] < 1e-3
    assert 5.0 < differences[0] / differences[1] < 20.0


def test_elastic_joint_measures_its_rotor() -> None:
    plant = elastic(np.array([0.0, 0.0, 1500.0, 0.0]))
    for _ in range(50):
        plant.advance(np.array([0.0, 0.0, 2.0, 0.0]))
    angles, rates = rotors(plant)
    assert plant.position[5] == angles[2] != plant.true_position[5]
    assert plant.velocity[5] == rates[2]
    others = [3, 4, 6]
    np.testing.assert_array_equal(plant.position[others], plant.true_position[others])


def test_locked_link_oscillates_with_its_frequency() -> None:
    """With a link that is heavy against the rotor, the rotor has the frequency sqrt(K / B)."""
    stiffness, rotor = 200.0, 1e-3
    plant = elastic(np.array([0.0, 0.0, stiffness, 0.0]), 0.0, rotor)
    angles = []
    for _ in range(200):
        plant.advance(np.array([0.0, 0.0, 1.0, 0.0]))
        angles.append(rotors(plant)[0][2] - plant.true_position[5])
    twist = np.array(angles) - 1.0 / stiffness
    crossings = np.flatnonzero((twist[1:] > 0.0) & (twist[:-1] <= 0.0))
    period = np.diff(crossings).mean() * 0.001
    assert period == pytest.approx(2.0 * math.pi / math.sqrt(stiffness / rotor), rel=0.03)


def test_holding_drives_of_elastic_joints_come_to_rest() -> None:
    plant = planar(
        'plant.joint_stiffness=[0.0, 0.0, 1500.0, 800.0]',
        'plant.joint_damping=1.0',
        'plant.initial_velocity=[1.0, 0.5, 0.4, -0.3]',
    )
    for _ in range(1500):
        plant.advance(None)
    assert np.abs(plant.true_velocity).max() < 1e-3


def test_too_stiff_joint_for_the_step_raises() -> None:
    with pytest.raises(InputError, match=r'integrator_step: elastic joint arm_2 has a natural'):
        planar('plant.joint_stiffness=[0.0, 0.0, 0.0, 1e9]')


@pytest.mark.slow
@pytest.mark.parametrize('wheels', [0.0, 5.0])
def test_elastic_joints_of_mujoco_equal_those_of_rigid_plant(wheels: float) -> None:
    """Within the differences of contact: 0.07 rad of 3 to 11 rad, and 1 mm, after 3 s."""
    pytest.importorskip('mujoco')
    contact, rigid = (
        planar(
            f'plant.physics={physics}',
            f'plant.joint_stiffness=[{wheels}, {wheels}, 300.0, 200.0]',
            'plant.joint_damping=0.5',
            'plant.rotor_inertia=0.05',
            'plant.integrator_step=0.0005',
        )
        for physics in ('mujoco', 'rigid')
    )
    largest, apart, twists_apart = np.zeros(4), np.zeros(7), np.zeros(4)
    for k in range(3000):
        t = 0.001 * k
        roll = 0.02 * math.sin(3.0 * t)
        torque = np.array([roll, -roll, 1.5 * math.sin(4.0 * t), 0.8 * math.sin(5.0 * t)])
        twists = []
        for plant in (contact, rigid):
            plant.advance(torque)
            twists.append((plant.position - plant.true_position)[3:])
        largest = np.maximum(largest, np.abs(twists[1]))
        twists_apart = np.maximum(twists_apart, np.abs(twists[0] - twists[1]))
        apart = np.maximum(apart, np.abs(contact.true_position - rigid.true_position))
    assert (largest[2:] > 0.002).all()
    assert (twists_apart[2:] < 0.06 * largest[2:]).all()
    assert (twists_apart[:2] <= 0.05 * largest[:2]).all()
    assert apart[:2].max() < 1e-3
    assert apart[2:].max() < 0.1


def test_elastic_joints_of_omni_base_with_mujoco_raise() -> None:
    pytest.importorskip('mujoco')
    pytest.importorskip('pinocchio')  # it is installed with the robots
    panda = load_scenario(
        str(Path(PAPER).with_name('franka_on_omni.yaml')),
        ('plant.physics=mujoco', 'plant.joint_stiffness=10000.0'),
    )
    with pytest.raises(InputError, match=r'joint_stiffness: expected 0 for the first 3 joints'):
        plant_of(panda['plant'], 0.001)
