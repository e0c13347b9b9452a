# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Sensor model of the plant: quantisation, noise, delay, and repeatability."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from helpers.robots import Array, between, PROPERTY
from helpers.scenario import axes, in_pieces, Run, Scenario, tick_by_tick, whole
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.tick_block import TickBlock
from masmc_ros.numerics.portable_math import gaussian, philox
from masmc_ros.plant_model.measurement import quantised
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')

KNOWN = [
    ((0x00000000, 0x00000000, 0x00000000), (0xFF1DAE59, 0x6CD10DF2)),
    ((0xFFFFFFFF, 0xFFFFFFFF, 0xFFFFFFFF), (0x2C3F628B, 0xAB4FD7AD)),
    ((0x243F6A88, 0x85A308D3, 0x13198A2E), (0xDD7CE038, 0xF62A4C12)),
]
"""Published outputs of Philox-2x32-10."""


@pytest.mark.parametrize(('counter_and_key', 'output'), KNOWN)
def test_philox_equals_published_outputs(
    counter_and_key: tuple[int, int, int], output: tuple[int, int]
) -> None:
    assert philox(*counter_and_key) == output
    interpreted = getattr(philox, 'py_func', philox)
    assert interpreted(*counter_and_key) == output


def test_noise_is_normal_white_and_uncorrelated() -> None:
    n = 40_000
    noise = np.array([[gaussian(7, k, axis) for axis in range(4)] for k in range(n)])
    spread = 5.0 / np.sqrt(n)
    assert np.abs(noise.mean(axis=0)).max() < spread
    assert np.abs(noise.var(axis=0) - 1.0).max() < spread * np.sqrt(2.0)
    assert np.abs((noise**4).mean(axis=0) - 2.9).max() < spread * 10.0
    assert np.abs(np.corrcoef(noise.T) - np.eye(4)).max() < spread
    for lag in (1, 2, 3, 10):
        assert np.abs((noise[lag:] * noise[:-lag]).mean(axis=0)).max() < spread
    # The distribution function at one and at two deviations.
    for bound, share in ((1.0, 0.8413), (2.0, 0.9772)):
        assert (noise < bound).mean() == pytest.approx(share, abs=0.003)


@PROPERTY
@given(st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1), st.integers(0, 3))
def test_noise_depends_on_seed_tick_and_axis_only(seed: int, tick: int, axis: int) -> None:
    number = gaussian(seed, tick, axis)
    assert abs(number) <= 6.0
    assert number == gaussian(seed, tick, axis)
    others = gaussian(seed ^ 1, tick, axis), gaussian(seed, tick ^ 1, axis)
    assert number not in (*others, gaussian(seed, tick, axis ^ 1))


@PROPERTY
@given(between(-1e4, 1e4), between(1e-7, 1.0))
def test_encoder_angle_is_rounded_to_nearest_step(angle: float, resolution: float) -> None:
    shown = quantised(angle, resolution)
    assert abs(shown - angle) <= 0.5 * resolution * (1.0 + 1e-9) + 1e-12
    assert shown == round(shown / resolution) * resolution
    assert quantised(shown, resolution) == shown
    assert quantised(angle, 0.0) == angle


def test_encoder_count_out_of_range_or_nan_keeps_angle() -> None:
    assert quantised(1e9, 1e-12) == 1e9
    assert np.isnan(quantised(np.nan, 1e-4))


EVERYTHING = (
    ('resolution', axes(1e-4, 2e-4, 1e-3, 5e-4)),
    ('noise', axes(0.05, 0.02, 0.0, 0.01)),
    ('delay', 3),
    ('seed', 11),
)
IMPERFECT = Scenario('rasmc', 'tanh', ticks=801, boundary_layer=0.4, measured=EVERYTHING)


def assert_same(one: Run, other: Run) -> None:
    for name, values in vars(one).items():
        np.testing.assert_array_equal(values, getattr(other, name), err_msg=name)


def test_measurement_tick_by_tick_and_split_equal_whole_run() -> None:
    run = whole(IMPERFECT)
    assert (run.position != run.true_position)[:-1].any(axis=0).all()
    assert_same(tick_by_tick(IMPERFECT), run)
    for cut in (1, 2, 3, 400):
        assert_same(in_pieces(IMPERFECT, cut), run)


def only(**fields_: object) -> Run:
    """Return a run with a single imperfection."""
    return whole(replace(IMPERFECT, measured=tuple(fields_.items())))


def test_measurement_delay_returns_earlier_state() -> None:
    run = only(delay=3)
    for measured, true in (
        (run.position, run.true_position),
        (run.velocity, run.true_velocity),
    ):
        assert (measured[3:-1] == true[:-4]).all()
        assert (measured[:3] == true[0]).all()


def test_measurement_resolution_quantises_joints_and_odometry() -> None:
    resolution = axes(1e-4, 2e-4, 1e-3, 0.0)
    run = only(resolution=resolution)
    measured, true = run.position[:-1], run.true_position[:-1]
    for i in range(3):
        deviation = np.abs(measured[:, 3 + i] - true[:, 3 + i])
        assert 0.3 * resolution[i] < deviation.max() <= 0.5001 * resolution[i]
    assert (measured[:, 6] == true[:, 6]).all()
    # The wheels' steps are 5 and 10 um on the ground; yaw does not drift.
    r, b = 0.0508, 0.182
    assert np.abs(measured[:, 2] - true[:, 2]).max() < 0.5 * r / b * 3e-4
    assert 1e-8 < np.abs(measured[:, :2] - true[:, :2]).max() < 1e-5


def test_odometry_quantised_paper_run_has_small_drift() -> None:
    scenario = Scenario('rasmc', 'tanh', measured=(('resolution', np.full(4, 1e-4)),))
    run = whole(scenario)
    drift = np.abs(run.position[:-1, :2] - run.true_position[:-1, :2]).max()
    assert drift < 5e-5


def test_measurement_noise_has_its_deviation_base_matches_wheels() -> None:
    deviation = axes(0.05, 0.02, 0.0, 0.01)
    run = only(noise=deviation, seed=5)
    noise = (run.velocity - run.true_velocity)[:-1, 3:]
    assert noise.std(axis=0) == pytest.approx(deviation, rel=0.1)
    assert (run.position[:-1] == run.true_position[:-1]).all()
    r, b = 0.0508, 0.182
    right, left = run.velocity[:-1, 3], run.velocity[:-1, 4]
    assert run.velocity[:-1, 2] == pytest.approx(0.5 * r / b * (right - left), abs=1e-14)
    speed = 0.5 * r * (right + left)
    yaw = run.position[:-1, 2]
    assert run.velocity[:-1, 0] == pytest.approx(speed * np.cos(yaw), abs=1e-14)
    assert run.velocity[:-1, 1] == pytest.approx(speed * np.sin(yaw), abs=1e-14)


def simulate(*settings: str) -> list[TickBlock]:
    """Simulate one second of the paper's scenario twice, in blocks of different length."""
    simulation = Simulation(load_scenario(PAPER, ('duration=1.0', *settings)))
    first = list(simulation.run(block=500))
    again = list(simulation.run(block=333))
    for name in ('position', 'true_position', 'torque'):
        one, other = (np.concatenate([getattr(s, name) for s in run]) for run in (first, again))
        assert (one == other).all(), name
    return first


def joined(run: list[TickBlock], name: str) -> Array:
    return np.concatenate([getattr(tick_block, name) for tick_block in run])


def test_simulation_repeats_exactly_and_depends_on_seed() -> None:
    noisy = 'plant.velocity_noise=0.02', 'plant.measurement_delay=0.002'
    one, other = simulate(*noisy, 'plant.seed=1'), simulate(*noisy, 'plant.seed=2')
    assert (joined(one, 'torque') != joined(other, 'torque')).any()


def test_true_error_delayed_measurement_uses_true_state() -> None:
    slow = 'controller.k_s1=20', 'controller.k_s2=0'
    late_by = 'duration=1.0', 'plant.measurement_delay=0.01', *slow
    simulation = Simulation(load_scenario(PAPER, late_by))
    (run,) = simulation.run()
    true = run.true_error(simulation.plant.robot)
    late = run.error[10:] - true[:-10]
    reference_change = run.reference[10:, :4] - run.reference[:-10, :4]
    assert late == pytest.approx(-reference_change, abs=1e-12)
    (ideal,) = Simulation(load_scenario(PAPER, ('duration=1.0',))).run()
    assert (ideal.true_error(simulation.plant.robot) == ideal.error).all()
