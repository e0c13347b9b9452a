# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Plant over a control period: energy, order of integration, disturbance, torque limit."""

from __future__ import annotations

import math
from pathlib import Path

from helpers.robots import (
    all_angles,
    Angles,
    Array,
    assert_agree,
    between,
    DEFAULT,
    Machine,
    machines,
    PROPERTY,
    Quad,
    quads,
)
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.jit.record import fill
from masmc_ros.loop import records
from masmc_ros.loop.closed_loop import plant_start, plant_tick
from masmc_ros.loop.simulated_robot import SimulatedRobot, write_start
from masmc_ros.robot.robot import Robot, robot_of
from masmc_ros.robot.two_link.dynamics import inertia, inertia_times
from masmc_ros.robot.two_link.geometry import motion, posture_at
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')

ROBOT = Machine(DEFAULT)
STILL = np.zeros(4)


def plant_of(robot: Machine) -> Array:
    """Return the settings of a robot with exact measurements."""
    plant = records.plant_settings(TWO_LINK)
    fill(plant, 'geometry', np.array(robot.geometry))
    fill(plant, 'theta', np.array(robot.theta))
    fill(plant, 'is_exact', 1)
    return plant


class Plant:
    """Plant of one robot, advanced from Python."""

    def __init__(self, robot: Machine, angles: Angles, rates: Quad) -> None:
        """Initialise the plant at the origin with these angles and reduced velocities."""
        self.robot = robot
        self._plant, self._memory = plant_of(robot), records.plant_memory(TWO_LINK)
        self._signals = records.signals(TWO_LINK)
        self.position, self.velocity = (
            self._memory[name][0, :, 0] for name in ('position', 'velocity')
        )
        self.position[:] = [0.0, 0.0, angles.yaw, 0.0, 0.0, angles.arm_1, angles.arm_2]
        fill(self._memory, 'rates', rates)
        self.applied = self._signals['applied'][0, :, 0]
        plant_start(self._plant, self._memory, np.zeros((1, 14, 1)), self._signals)

    def tick(
        self,
        period: float,
        steps: int,
        command: Array = STILL,
        *,
        time: float = 0.0,
        disturbance: tuple[Array, Array, Array] = (STILL, STILL, STILL),
        limit: Array = STILL,
    ) -> None:
        """Advance the plant by one control period."""
        amplitude, frequency, phase = disturbance
        plant = self._plant
        for name, value in {
            'amplitude': amplitude,
            'frequency': frequency,
            'phase': phase + frequency * time,
            'limit': limit,
            'period': period,
            'steps': steps,
        }.items():
            fill(plant, name, value)
        fill(self._signals, 'torque', command)
        plant_tick(plant, self._memory, np.zeros((1, 14, 1)), 0, self._signals)

    @property
    def energy(self) -> float:
        """Kinetic energy in J."""
        v = motion(self.robot.geometry, self.velocity[3:].tolist())
        kinematics = posture_at(*self.position[[2, 5, 6]].tolist())
        h = inertia(self.robot.geometry, kinematics, self.robot.theta)
        return 0.5 * float(np.dot(v, inertia_times(self.robot.geometry, h, v)))


@PROPERTY
@given(machines(), all_angles(), quads(1.0))
def test_plant_without_torque_keeps_energy(robot: Machine, angles: Angles, rates: Quad) -> None:
    plant = Plant(robot, angles, rates)
    start = plant.energy
    for _ in range(100):
        plant.tick(0.002, 2)
    assert plant.energy == pytest.approx(start, rel=1e-8)


def test_plant_integration_is_of_fourth_order() -> None:
    angles, rates = Angles(0.3, 0.7, -1.1), (4.0, -2.0, 1.5, -3.0)
    amplitude, frequency = np.array([0.5, -0.3, 0.2, 0.1]), np.array([5.0, 3.0, 7.0, 2.0])
    shaking = (amplitude, frequency, np.array([0.0, 1.0, 2.0, 3.0]))

    def end(steps: int) -> Array:
        plant = Plant(ROBOT, angles, rates)
        plant.tick(0.4, steps, time=0.25, disturbance=shaking)
        return np.concatenate([plant.position, plant.velocity])

    exact = end(4096)
    errors = [float(np.abs(end(steps) - exact).max()) for steps in (32, 64, 128)]
    orders = [math.log2(errors[i] / errors[i + 1]) for i in range(2)]
    assert errors[0] > 1e-10
    assert orders == pytest.approx([4.0, 4.0], abs=0.2)


@PROPERTY
@given(machines(), all_angles(), quads(), quads(5.0), quads(5.0), st.integers(1, 4))
def test_plant_constant_disturbance_adds_to_command(
    robot: Machine, angles: Angles, rates: Quad, command: Quad, disturbance: Quad, steps: int
) -> None:
    disturbed, commanded = Plant(robot, angles, rates), Plant(robot, angles, rates)
    right_angle = np.full(4, math.pi / 2)
    constant = (np.array(disturbance), STILL, right_angle)
    disturbed.tick(0.001, steps, np.array(command), disturbance=constant)
    commanded.tick(0.001, steps, np.array(command) + disturbance)
    assert_agree(disturbed.position, commanded.position, 1e-13, scale=1.0)
    assert_agree(disturbed.velocity, commanded.velocity, 1e-12, scale=1.0)
    assert disturbed.applied.tolist() == list(command)


@PROPERTY
@given(quads(10.0), quads(5.0))
def test_plant_torque_limit_clips_command_not_disturbance(
    command: Quad, disturbance: Quad
) -> None:
    limit = np.array([1.0, 2.5, 0.0, 4.0])
    clipped = np.array(
        [np.clip(c, -m, m) if m > 0.0 else c for c, m in zip(command, limit, strict=True)]
    )
    shaking = (np.array(disturbance), np.full(4, 3.0), np.full(4, 1.0))
    angles, rates = Angles(0.3, 0.7, -1.1), (0.1, 0.2, 0.3, 0.4)
    limited, free = Plant(ROBOT, angles, rates), Plant(ROBOT, angles, rates)
    limited.tick(0.001, 2, np.array(command), disturbance=shaking, limit=limit)
    free.tick(0.001, 2, clipped, disturbance=shaking)
    assert limited.applied.tolist() == clipped.tolist()
    assert limited.position.tolist() == free.position.tolist()
    assert limited.velocity.tolist() == free.velocity.tolist()


@PROPERTY
@given(machines(), between(-3.0, 3.0), quads(2.0), quads())
def test_plant_initial_pose_is_pose_of_centre_of_mass(
    robot: Machine, yaw: float, joints: Quad, rates: Quad
) -> None:
    offset = robot.physical['com_offset']
    pose = np.array([0.4, -0.6, yaw])
    start = {'initial_pose': pose, 'initial_joints': joints, 'initial_velocity': rates}
    memory, signals = records.plant_memory(TWO_LINK), records.signals(TWO_LINK)
    machine = Robot(TWO_LINK, robot.physical, np.array(robot.geometry), np.array(robot.theta))
    write_start(memory, machine, start)
    assert plant_start(plant_of(robot), memory, np.zeros((1, 14, 1)), signals)
    position, velocity = signals['position'][0, :, 0], signals['velocity'][0, :, 0]
    heading = np.array([math.cos(yaw), math.sin(yaw)])
    assert_agree(position[:2] + offset * heading, pose[:2], 1e-14)
    assert position[2:].tolist() == [yaw, *joints]
    u, w, _, _ = motion(robot.geometry, rates)
    assert_agree(velocity[:2], u * heading, 1e-14, scale=1.0)
    assert velocity[2:].tolist() == [w, *rates]


@pytest.mark.slow
def test_plant_huge_angles_raise_or_stay_finite() -> None:
    """The sine of an angle beyond 1e9 rad is NaN; then the state has NaN velocities."""
    random = np.random.default_rng(1)
    values = load_scenario(PAPER)['plant']
    errors = 0
    for _ in range(2000):
        rate = 10.0 ** random.uniform(3.0, 12.0)
        turned = 1e-3 * rate * random.uniform(0.0, 1.2) * 0.0508 / 0.182
        values['initial_pose'] = (0.0, 0.0, 1e9 - turned)
        values['initial_velocity'] = (rate, -rate, 0.0, 0.0)
        try:
            plant = SimulatedRobot(robot_of(values), 0.001, values)
            plant.advance(10.0 ** random.uniform(0.0, 12.0) * random.standard_normal(4))
        except InputError:
            errors += 1
            continue
        assert np.isfinite(plant.position).all()
        assert np.isfinite(plant.velocity).all()
    assert 0 < errors < 2000
