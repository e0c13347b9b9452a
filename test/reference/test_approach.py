# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Approach to a distant reference: no jump, bounded speed, then the reference."""

from __future__ import annotations

from helpers.processes import PAPER
from hypothesis import example, given, settings
from hypothesis import strategies as st
from masmc_ros.loop.simulation import Simulation
from masmc_ros.reference.approach import Approach, SHORTEST
from masmc_ros.robot.base_pose import BasePose
from masmc_ros.robot.two_link.kinematics import base_motion as platform_motion
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

SPEED = 0.25
MS = 1_000_000
near = st.floats(-2.0, 2.0)
reach, angle = st.floats(0.2, 0.85), st.floats(-3.1, 3.1)


def sample_of(at: list[float], rho: float, psi: float, derivatives: list[float]) -> np.ndarray:
    """Return a sample (12) within reach, from F and from distance and direction of E."""
    offset = rho * np.array([np.cos(psi), np.sin(psi)])
    return np.concatenate([offset + at, at, derivatives])


samples = st.builds(
    sample_of, st.lists(near, min_size=2, max_size=2), reach, angle,
    st.lists(near, min_size=8, max_size=8),
)
goals = st.builds(
    sample_of, st.lists(near, min_size=2, max_size=2), reach, angle, st.just([0.0] * 8)
)


def simulation(**settings_: object) -> Simulation:
    return Simulation(load_scenario(str(PAPER), [f'{k}={v}' for k, v in settings_.items()]))


ROBOT = simulation().controller.robot
REST = np.zeros(4)


@settings(max_examples=50)
@given(st.lists(near, min_size=7, max_size=7), samples)
def test_approach_starts_at_robot_and_ends_at_reference(
    state: list[float], reference: np.ndarray
) -> None:
    position = np.array(state)
    approach = Approach(ROBOT, SPEED)
    approach.start()
    first = approach.follow(0, position, REST, reference).copy()
    assert first[:4] == pytest.approx(ROBOT.task_positions(position[None])[0], abs=1e-12)
    assert np.abs(first[4:]).max() < 1e-9  # at rest
    stamp = 0
    while approach.is_on:
        stamp += 10 * MS
        assert stamp < 10**12, 'the approach does not end'
        followed = approach.follow(stamp, position, REST, reference)
    assert followed is reference
    distance = np.abs(reference[:4] - first[:4]).max()
    assert stamp * 1e-9 >= max(SHORTEST, 1.875 * distance / SPEED) - 0.011


@settings(max_examples=30)
@given(goals)
def test_approach_speed_is_bounded(reference: np.ndarray) -> None:
    position = np.array([0.0, 0.0, 1.5, 0.0, 0.0, 0.8, -1.5])
    approach = Approach(ROBOT, SPEED)
    approach.start()
    stamp, before = 0, None
    while stamp == 0 or approach.is_on:
        followed = approach.follow(stamp, position, REST, reference).copy()
        assert np.abs(followed[4:8]).max() <= SPEED * 1.0001
        if before is not None:
            assert np.abs(followed[:4] - before[:4]).max() <= SPEED * 0.01 * 1.0001
        before = followed
        stamp += 10 * MS


@settings(max_examples=50)
@given(st.lists(near, min_size=7, max_size=7), st.data())
def test_approach_moving_reference_stays_in_reach(
    state: list[float], data: st.DataObject
) -> None:
    """The reference moves within reach; derivatives match the positions."""
    position = np.array(state)
    mean, amplitude = data.draw(st.floats(0.35, 0.7)), data.draw(st.floats(0.0, 0.15))
    rate, turn, speed = (data.draw(st.floats(-1.0, 1.0)) for _ in range(3))

    def reference(t: float) -> np.ndarray:
        def at(t: float) -> np.ndarray:
            rho, psi = mean + amplitude * np.sin(rate * t), turn * t
            f = np.array([speed * t, np.sin(t)])
            return np.concatenate([f + rho * np.array([np.cos(psi), np.sin(psi)]), f])

        h = 1e-4
        before, current, after = at(t - h), at(t), at(t + h)
        velocity = (after - before) / (2 * h)
        acceleration = (after - 2 * current + before) / h**2
        return np.concatenate([current, velocity, acceleration])

    approach = Approach(ROBOT, SPEED)
    approach.start()
    rows, step = [], 0.001
    for k in range(4000):
        rows.append(approach.follow(k * MS, position, REST, reference(k * step)).copy())
    followed = np.array(rows)
    offset = followed[:, :2] - followed[:, 2:4]
    distance = np.hypot(*offset.T)
    assert distance.max() <= 0.876 + 1e-9
    assert distance.min() >= 0.152 - 1e-9
    change = np.diff(followed[:, :8], axis=0) / step
    mean_rate = 0.5 * (followed[1:, 4:] + followed[:-1, 4:])
    assert np.abs(change - mean_rate).max() < 0.01 * (1.0 + np.abs(mean_rate).max())


@settings(max_examples=50)
@example([0.0] * 6 + [0.0078125], [0.0, 0.0, 0.0, -0.1], np.eye(12)[0] * 0.5)  # nearly stretched
@given(
    st.lists(near, min_size=7, max_size=7),
    st.lists(st.floats(-0.1, 0.1), min_size=4, max_size=4),
    samples,
)
def test_approach_moving_robot_is_braked_smoothly(
    state: list[float], moving: list[float], reference: np.ndarray
) -> None:
    """The approach starts with the robot's velocity and deviates little from its path."""
    position, rates = np.array(state), np.array(moving)
    step = 1e-6
    after = integrated(position, rates, step)
    velocity = (
        ROBOT.task_positions(after[None])[0] - ROBOT.task_positions(position[None])[0]
    ) / step
    way = {}
    for name, initial_rates in (('moving', rates), ('at rest', REST)):
        approach = Approach(ROBOT, SPEED)
        approach.start()
        way[name] = []
        for k in range(501):
            way[name].append(approach.follow(k * MS, position, initial_rates, reference).copy())
    moved, rested = np.array(way['moving']), np.array(way['at rest'])
    assert moved[0, :4] == pytest.approx(ROBOT.task_positions(position[None])[0], abs=1e-12)
    velocity[:2] += beyond_room(moved[0, :4], velocity)
    assert moved[0, 4:8] == pytest.approx(np.clip(velocity, -SPEED, SPEED), abs=1e-6)
    assert np.abs(moved - rested)[:, :4].max() <= 0.1 * SPEED
    # The robot is braked after half a second; from then on both paths are equal.
    assert moved[500] == pytest.approx(rested[500], abs=1e-12)


def beyond_room(points: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Return the change of the arm's velocity (2) by which its braking path is within reach."""
    offset = points[:2] - points[2:]
    distance = np.hypot(*offset)
    rate = offset @ (velocity[:2] - velocity[2:]) / distance
    room = (0.876 - distance if rate > 0.0 else distance - 0.152) / 0.1
    return (np.clip(rate, -room, room) - rate) * offset / distance


def integrated(position: np.ndarray, rates: np.ndarray, step: float) -> np.ndarray:
    """Return the positions (7) after a step with velocities (4) of the driven joints."""
    radius, half_track = ROBOT.geometry[0], ROBOT.geometry[1]
    speed = 0.5 * radius * (rates[0] + rates[1])
    turn = 0.5 * radius / half_track * (rates[0] - rates[1])
    yaw = position[2]
    platform = [speed * np.cos(yaw), speed * np.sin(yaw), turn]
    return position + step * np.array([*platform, *rates])


def test_approach_starts_at_large_reference_step_only() -> None:
    position = np.array([0.0, 0.0, 1.5, 0.0, 0.0, 0.8, -1.5])
    approach = Approach(ROBOT, SPEED)
    reference = np.zeros(12)
    for k in range(100):
        reference = reference.copy()
        reference[0] += 0.002
        approach.watch(k * 10 * MS, reference)
        assert not approach.is_on
    jumped = reference.copy()
    jumped[2] += 0.1
    approach.watch(1000 * MS, jumped)
    assert approach.is_on
    followed = approach.follow(1000 * MS, position, REST, jumped)
    assert np.abs(followed[4:8]).max() < 1e-9


@pytest.mark.parametrize('switching', ['tanh', 'implicit'])
def test_approach_distant_reference_torque_does_not_jump(switching: str) -> None:
    """A robot 1 m from its reference needs a tenth of the torque, and it arrives."""
    peaks = {}
    for speed in (SPEED, 0.0):
        run = simulation(**{'controller.law': 'smc', 'controller.switching': switching})
        plant, law = run.plant, run.controller
        approach = Approach(law.robot, speed or 1.0)
        approach.start()
        reference = np.array([1.3, 0.9, 1.0, 0.4, *[0.0] * 8])
        peak = 0.0
        for tick in range(12_000):
            followed = reference
            if speed:
                followed = approach.follow(tick * MS, plant.position, REST, reference)
            law.tick(plant.position, plant.velocity, followed)
            if tick < 100:
                peak = max(peak, float(np.abs(law.torque).max()))
            plant.advance(law.torque)
        peaks[speed] = peak
        reached = law.robot.task_positions(plant.position[None])[0]
        assert np.abs(reached - reference[:4]).max() < 0.1
    assert peaks[SPEED] < 0.1 * peaks[0.0]


@given(
    st.floats(-3.0, 3.0), st.floats(-1.0, 1.0), st.floats(-2.0, 2.0), st.floats(0.0, 0.1)
)
def test_base_pose_extrapolates_odometry_along_circle(
    yaw: float, forward: float, turn: float, time: float
) -> None:
    """Many small steps of a twist give the same pose as one long step."""
    position = np.array([0.3, -0.2, yaw, 0.0, 0.0, 0.0, 0.0])
    velocity = np.array([forward * np.cos(yaw), forward * np.sin(yaw), turn, 0, 0, 0, 0])
    pose, twist = platform_motion(position[None], velocity[None])
    base = BasePose()
    base.update(0, pose[0], twist[0])
    extrapolated, rates = np.zeros(7), np.zeros(7)
    base.write(0, extrapolated, rates)
    assert extrapolated[:3] == pytest.approx(position[:3], abs=1e-9)
    assert rates[:3] == pytest.approx(velocity[:3], abs=1e-9)
    stamp = round(time * 1e9)
    base.write(stamp, extrapolated, rates)
    x, y, angle = 0.3, -0.2, yaw
    for _ in range(1000):
        step = stamp * 1e-12
        x += forward * step * np.cos(angle + 0.5 * turn * step)
        y += forward * step * np.sin(angle + 0.5 * turn * step)
        angle += turn * step
    assert extrapolated[:3] == pytest.approx([x, y, angle], abs=1e-7)
    assert np.hypot(*rates[:2]) == pytest.approx(abs(forward), abs=1e-9)
