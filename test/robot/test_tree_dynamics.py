# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Dynamics of trees: consistency, closed forms, energy and finite differences."""

from __future__ import annotations

import os
from pathlib import Path
import subprocess
import sys
from typing import Any

from helpers import tree_bits
from helpers.robots import DEFAULT, Machine, machines
from helpers.tree_bits import adapted_digest, digest, model_of
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from masmc_ros.jit.lanes import lane_of
from masmc_ros.robot.robot import robot_description
from masmc_ros.robot.tree import articulated, dynamics, kinematics
from masmc_ros.robot.tree.assembly import tree_robot
from masmc_ros.robot.tree.dynamics import GRAVITY
from masmc_ros.robot.tree.kinematics import Posture
from masmc_ros.robot.tree.link_inertia import pseudo_inertia
from masmc_ros.robot.tree.task.task import frame_pose
from masmc_ros.robot.tree.tree_model import DIFFERENTIAL, FIXED, OMNIDIRECTIONAL, Tree, TreeModel
from masmc_ros.robot.two_link import two_link
from masmc_ros.robot.urdf import read_urdf
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]

STATES = 3
FEW = settings(max_examples=25)

trees = st.builds(
    lambda seed, bodies, base, mimics: Drawn(seed, bodies, base, mimics),
    st.integers(0, 2**32 - 1),
    st.integers(1, 7),
    st.sampled_from((FIXED, DIFFERENTIAL, OMNIDIRECTIONAL)),
    st.integers(0, 3),
)


class Drawn:
    """A random robot and random states of it, in columns."""

    def __init__(self, seed: int, bodies: int, base: int, mimics: int = 0) -> None:
        """Draw the robot and its states."""
        draw = np.random.default_rng(seed)
        moving = max(bodies - 1, 1 if base == FIXED else 0)
        bodies = moving + 1
        joints = max(moving - mimics, min(moving, 1))
        size = base + joints
        # The controlled joints have the order of their bodies; the others follow one of them.
        controlled = 1 + np.sort(draw.permutation(moving)[:joints])
        driver = draw.integers(0, max(joints, 1), bodies)
        multiplier = draw.uniform(0.3, 2.0, bodies) * draw.choice([-1.0, 1.0], bodies)
        driver[controlled], multiplier[[0, *controlled]] = range(joints), 1.0
        turns = np.linalg.qr(draw.normal(size=(bodies, 3, 3)))[0]
        turns *= np.linalg.det(turns)[:, None, None]
        axes = draw.normal(size=(bodies, 3))
        # Rotors of wheels couple the velocities of the base; rotors of joints couple none.
        root = np.diag(draw.normal(size=size))
        root[:base, :base] = draw.normal(size=(base, base))
        self.tree = Tree(
            base,
            np.array([-1, *(draw.integers(0, body) for body in range(1, bodies))]),
            draw.integers(0, 2, bodies),
            axes / np.linalg.norm(axes, axis=1)[:, None],
            turns.reshape(bodies, 9),
            draw.normal(size=(bodies, 3)),
            0.1 * root @ root.T,
            driver,
            multiplier,
        )
        self.model = model_of(self.tree)
        self.inertial_parameters = np.stack(
            [[_moments(draw) for _ in range(bodies)] for _ in range(STATES)], axis=2
        )
        self.position = draw.normal(size=((3 if base else 0) + joints, STATES))
        self.velocity, self.reference, self.acceleration = draw.normal(size=(3, size, STATES))

    def postures(self, position: Array | None = None) -> list[Posture]:
        """Return the kinematics of every state."""
        columns = (self.position if position is None else position).T
        first = 3 if self.tree.base else 0
        return [
            kinematics.place(
                self.model, *(at[:3].tolist() if first else (0.0, 0.0, 0.0)), at.copy(), first
            )
            for at in columns
        ]

    def thetas(self) -> Array:
        """Return the inertial parameters of the bodies in every state."""
        states = self.inertial_parameters.shape[2]
        return np.ascontiguousarray(self.inertial_parameters.reshape(-1, states).T)

    def forces(
        self,
        velocity: Array,
        reference: Array,
        acceleration: Array,
        gravity: float = GRAVITY,
        position: Array | None = None,
    ) -> Array:
        """Return H a_r + C nu_r + g."""
        columns = (rows.T.copy() for rows in (velocity, reference, acceleration))
        return np.array([
            dynamics.inverse_dynamics(self.model, posture, theta, *motion, gravity)
            for posture, theta, *motion in zip(
                self.postures(position), self.thetas(), *columns, strict=True
            )
        ]).T.copy()

    def inertia(self, position: Array | None = None) -> Array:
        """Return H."""
        matrices = [
            dynamics.inertia(self.model, posture, theta)
            for posture, theta in zip(self.postures(position), self.thetas(), strict=True)
        ]
        return np.stack(matrices, axis=2)

    def position_rates(self, position: Array, velocity: Array) -> Array:
        """Return the time derivative of the positions."""
        base = self.tree.base
        if base == FIXED:
            return velocity
        u, omega = velocity[0], velocity[base - 1]
        v = velocity[1] if base == OMNIDIRECTIONAL else np.zeros(STATES)
        c, s = np.cos(position[2]), np.sin(position[2])
        return np.array([c * u - s * v, s * u + c * v, omega, *velocity[base:]])

    def acceleration_of(self, position: Array, velocity: Array, forces: Array) -> Array:
        """Return the accelerations under generalised forces."""
        return np.array([
            articulated.forward_dynamics(self.model, posture, theta, nu, applied_forces, GRAVITY)
            for posture, theta, nu, applied_forces in zip(
                self.postures(position),
                self.thetas(),
                velocity.T.copy(),
                forces.T.copy(),
                strict=True,
            )
        ]).T.copy()

    def energy(self, position: Array, velocity: Array) -> Array:
        """Return kinetic and potential energy in J."""
        kinetic = np.einsum('il,ijl,jl->l', velocity, self.inertia(position), velocity) / 2.0
        frames = np.stack([posture.frames for posture in self.postures(position)], axis=2)
        first = np.einsum('bil,bil->bl', frames[:, 6:9], self.inertial_parameters[:, 1:4])
        heights = self.inertial_parameters[:, 0] * frames[:, 11] + first
        return kinetic + GRAVITY * heights.sum(axis=0)


def _moments(draw: Any) -> list[float]:
    """Draw inertial parameters of several mass points, which form a possible body."""
    masses, points = draw.uniform(0.1, 2.0, 6), draw.normal(size=(6, 3))
    second = np.einsum('p,pi,pj->ij', masses, points, points)
    first = masses @ points
    x, y, z = first.tolist()
    pairs = [second[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))]
    return [masses.sum(), x, y, z, *pairs]


@FEW
@given(trees)
def test_tree_inertia_columns_equal_forces_of_accelerations(robot: Drawn) -> None:
    still, inertia = np.zeros_like(robot.velocity), robot.inertia()
    for column in range(len(still)):
        unit = still.copy()
        unit[column] = 1.0
        assert robot.forces(still, still, unit, 0.0) == pytest.approx(
            inertia[:, column], rel=1e-11, abs=1e-11
        )
    assert np.linalg.eigvalsh(np.moveaxis(inertia, 2, 0)).min() > 0.0


@FEW
@given(trees)
def test_tree_inertia_rate_minus_2_coriolis_is_skew_symmetric(robot: Drawn) -> None:
    still, columns = np.zeros_like(robot.velocity), []
    for row in range(len(still)):
        unit = still.copy()
        unit[row] = 1.0
        columns.append(robot.forces(robot.velocity, unit, still, 0.0))
    coriolis = np.stack(columns, axis=1)
    step = 1.0e-6
    rates = robot.position_rates(robot.position, robot.velocity)
    after = robot.inertia(robot.position + step * rates)
    before = robot.inertia(robot.position - step * rates)
    rate = (after - before) / (2.0 * step)
    scale = 1.0 + np.abs(coriolis).max()
    assert np.abs(rate - coriolis - coriolis.transpose(1, 0, 2)).max() < 1e-7 * scale


@FEW
@given(trees)
def test_tree_moment_gradients_times_moments_equal_power(robot: Drawn) -> None:
    error = robot.velocity - robot.reference
    columns = (robot.velocity, robot.reference, robot.acceleration, error)
    gradients = np.array([
        dynamics.moment_gradients(robot.model, posture, *moved, GRAVITY, sigma)
        for posture, *moved, sigma in zip(
            robot.postures(), *(rows.T.copy() for rows in columns), strict=True
        )
    ])
    forces = robot.forces(robot.velocity, robot.reference, robot.acceleration)
    forces -= robot.tree.armature @ robot.acceleration
    power = (error * forces).sum(axis=0)
    assert (gradients * robot.thetas()).sum(axis=1) == pytest.approx(power, rel=1e-9, abs=1e-9)


@FEW
@given(trees)
def test_tree_forward_dynamics_invert_inverse_dynamics(robot: Drawn) -> None:
    forces = robot.forces(robot.velocity, robot.velocity, robot.acceleration)
    accelerations = robot.acceleration_of(robot.position, robot.velocity, forces)
    assert accelerations == pytest.approx(robot.acceleration, rel=1e-7, abs=1e-7)


@settings(max_examples=10)
@given(trees)
def test_tree_without_forces_keeps_energy(robot: Drawn) -> None:
    position, velocity = robot.position.copy(), robot.velocity.copy()
    no_forces, step = np.zeros_like(velocity), 2.0e-4
    before = robot.energy(position, velocity)

    def rates(position: Array, velocity: Array) -> tuple[Array, Array]:
        return (
            robot.position_rates(position, velocity),
            robot.acceleration_of(position, velocity, no_forces),
        )

    for _ in range(50):
        a = rates(position, velocity)
        b = rates(position + step / 2 * a[0], velocity + step / 2 * a[1])
        c = rates(position + step / 2 * b[0], velocity + step / 2 * b[1])
        d = rates(position + step * c[0], velocity + step * c[1])
        position = position + step / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
        velocity = velocity + step / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
    scale = np.abs(before).max() + np.abs(robot.energy(position, 0.0 * velocity)).max() + 1.0
    assert np.abs(robot.energy(position, velocity) - before).max() < 1e-6 * scale


@FEW
@given(trees, st.integers(0, 2**32 - 1))
def test_tree_jacobian_and_rate_equal_differences(robot: Drawn, seed: int) -> None:
    draw = np.random.default_rng(seed)
    body = int(draw.integers(0, len(robot.tree.parent)))
    point = tuple(draw.normal(size=3).tolist())
    model = model_of(robot.tree, body, point)

    def at(position: Array) -> tuple[Array, Array, Array]:
        """Return pose, Jacobian and its derivative in the first state, in the world frame."""
        posture, nu = robot.postures(position)[0], robot.velocity[:, 0].copy()
        rotation, origin = frame_pose(model, posture, 0)
        jacobian = kinematics.point_jacobian(model, posture, body, point)
        derivative = kinematics.point_jacobian_rate(model, posture, nu, body, point)
        return np.array([*origin, *rotation]), jacobian.T, derivative.T

    rates = robot.position_rates(robot.position, robot.velocity)
    step = 1.0e-6
    place, jacobian, derivative = at(robot.position)
    (after, jacobian_after, _), (before, jacobian_before, _) = (
        at(robot.position + sign * step * rates) for sign in (1.0, -1.0)
    )
    motion = jacobian @ robot.velocity[:, 0]
    scale = 1.0 + np.abs(derivative).max() + np.abs(place).max()
    moved = (after - before) / (2.0 * step)
    assert np.abs(moved[:3] - motion[:3]).max() < 1e-7 * scale
    spin = moved[3:].reshape(3, 3) @ place[3:].reshape(3, 3).T
    angular_velocity = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
    assert np.abs(angular_velocity - motion[3:]).max() < 1e-7 * scale
    rate = (jacobian_after - jacobian_before) / (2.0 * step)
    assert np.abs(rate - derivative).max() < 1e-6 * scale


@FEW
@given(trees)
def test_tree_lane_among_others_equals_single_robot(robot: Drawn) -> None:
    together = Drawn.__new__(Drawn)
    together.__dict__.update(robot.__dict__)
    numbers = robot.model.numbers
    others = 1.0 + 2.0 * numbers
    together.model = TreeModel(lane_of(np.stack([others, numbers, others], 1), 1))
    moved = robot.velocity, robot.reference, robot.acceleration
    forces = robot.forces(*moved)
    assert together.forces(*moved).tobytes() == forces.tobytes()
    assert together.inertia().tobytes() == robot.inertia().tobytes()
    lane_accelerations = together.acceleration_of(robot.position, robot.velocity, forces)
    free = robot.acceleration_of(robot.position, robot.velocity, forces)
    assert lane_accelerations.tobytes() == free.tobytes()


@FEW
@given(machines(), st.integers(0, 2**32 - 1))
def test_tree_planar_robot_equals_closed_form(machine: Machine, seed: int) -> None:
    draw = np.random.default_rng(seed)
    # A link without mass has no inertia in a description.
    assume(machine.physical['wheel_mass'] > 0.0)
    # The description gives a wheel at least the diametral inertia of a disc.
    physical = dict(machine.physical)
    spin = physical['wheel_spin_inertia']
    physical['wheel_yaw_inertia'] = max(physical['wheel_yaw_inertia'], spin / 2.0)
    machine = Machine(physical)
    values = {f'robot.{name}': value for name, value in physical.items()}
    description = read_urdf(robot_description(values), 'robot_description')
    geometry = machine.geometry
    wheels = [joint for joint in description.joints if 'wheel' in joint]
    robot = tree_robot(
        description,
        'robot_description',
        base='differential',
        wheels=wheels,
        wheel_radius=geometry.wheel_radius,
    )
    angles = draw.uniform(-3.0, 3.0, 3)
    rates, wanted, applied_forces = draw.normal(size=(3, 4))
    r, b = geometry.wheel_radius, geometry.half_track
    to_tree = np.eye(4)
    to_tree[:2, :2] = [[r / 2.0, r / 2.0], [r / (2.0 * b), -r / (2.0 * b)]]

    posture = two_link.posture(geometry, (0.0, 0.0, angles[0], 0.0, 0.0, *angles[1:]))
    motion, reference, acceleration = (
        two_link.motion(geometry, tuple(v)) for v in (rates, wanted, applied_forces)
    )
    y = two_link.regressor(geometry, posture, motion, reference, acceleration)
    torques = two_link.joint_torques(
        geometry, two_link.regressor_times(geometry, y, tuple(machine.theta))
    )

    model = model_of(robot)
    place = kinematics.place(model, 0.0, 0.0, angles[0], angles[1:], 0)
    velocity, along, gained = (to_tree @ v for v in (rates, wanted, applied_forces))
    forces = dynamics.inverse_dynamics(
        model, place, robot.inertial_parameters.ravel(), velocity, along, gained, GRAVITY
    )
    scale = 1.0 + np.abs(torques).max()
    assert np.abs(to_tree.T @ forces - torques).max() < 1e-10 * scale


def test_tree_planar_robot_bodies_are_consistent() -> None:
    values = {f'robot.{name}': value for name, value in DEFAULT.items()}
    robot = tree_robot(read_urdf(robot_description(values), 'x'), 'x')
    for inertial_parameters in robot.inertial_parameters[1:]:
        # The wheels are flat.
        assert np.linalg.eigvalsh(pseudo_inertia(inertial_parameters))[0] > -1.0e-12


RECORDED = 'da172e702aeef37631c61b963ac6bad5d84b30f5eb40cb04374562ec6cee4847'
"""Digest that every machine must produce."""

ADAPTED = '275cb56cdd8ddff1329564540dee44126855dbab9703ca773021c496c27fcb45'
"""Digest of adapted inertial parameters."""


def test_tree_dynamics_on_this_machine_equal_recorded_digest() -> None:
    assert digest() == RECORDED
    assert adapted_digest() == ADAPTED


@pytest.mark.slow
@pytest.mark.parametrize(
    'settings',
    [
        {'NUMBA_CPU_NAME': 'generic', 'NUMBA_CPU_FEATURES': ''},
        {'NUMBA_DISABLE_JIT': '1'},
    ],
    ids=['SSE2', 'interpreted'],
)
def test_tree_dynamics_on_other_machine_equal_recorded_digest(
    settings: dict[str, str], tmp_path: Path
) -> None:
    process = subprocess.run(
        [sys.executable, str(Path(tree_bits.__file__))],
        env={
            **os.environ,
            'PYTHONPATH': os.pathsep.join(filter(None, sys.path)),
            'XDG_CACHE_HOME': str(tmp_path),
            **settings,
        },
        stdout=subprocess.PIPE,
        text=True,
        check=True,
        timeout=600.0,
    )
    assert process.stdout.split() == [RECORDED, ADAPTED]
