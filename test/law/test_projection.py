# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Projection of theta_hat: bounds, consistency, and distance to the theta of any robot."""

from __future__ import annotations

from helpers.robots import all_angles, Angles, Array, between, Machine, machines, PROPERTY
from helpers.scenario import Scenario
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.law.parts.adaptation import MARGIN, projected
from masmc_ros.robot.two_link.consistency import is_consistent
from masmc_ros.robot.two_link.dynamics import BaseParameters
import numpy as np
import pytest
from test_consistency import reduced_inertia, stretched

SEEDS = st.integers(0, 2**32 - 1)


class Projected:
    """A projected estimate that a test moves."""

    def __init__(self, robot: Machine, lower: float, upper: float, gamma: Array) -> None:
        """Initialise the estimate with the nominal model, which is the robot's."""
        self.robot, self.gamma, self._bounds = robot, gamma, (lower, upper)
        self.nominal = np.array(robot.theta)
        self.estimate = self.nominal.copy()

    def move(self, step: Array) -> None:
        """Add a step and project."""
        self.estimate += step
        self.estimate[:] = projected(
            self.robot.geometry,
            tuple(self.estimate.tolist()),
            tuple(self.nominal.tolist()),
            tuple(self.gamma.tolist()),
            *self._bounds,
        )

    def distance(self, other: Array) -> float:
        """Return the distance from a theta in the metric of Gamma."""
        return float(np.sqrt(np.sum(self.gamma * (self.estimate - other) ** 2)))


def least_eigenvalue(matrix: Array, nominal: Array) -> float:
    """Return the smallest x with det(matrix - x nominal) = 0, both symmetric."""
    root = np.linalg.cholesky(nominal)
    return float(np.linalg.eigvalsh(np.linalg.solve(root, np.linalg.solve(root, matrix).T))[0])


@PROPERTY
@given(
    machines(), all_angles(), between(0.05, 0.9), between(1.1, 20.0), SEEDS, between(-2.0, 4.0)
)
def test_projection_any_gradient_keeps_estimate_consistent(
    robot: Machine, angles: Angles, lower: float, upper: float, seed: int, size: float
) -> None:
    rng = np.random.default_rng(seed)
    projected = Projected(robot, lower, upper, 10.0 ** rng.uniform(-2.0, 2.0, 7))
    bounds = np.sort([lower * projected.nominal, upper * projected.nominal], axis=0)
    q_nominal = stretched(robot.theta, robot.geometry)
    h_nominal = reduced_inertia(robot.theta, robot.geometry, angles)
    for _ in range(20):
        projected.move(10.0**size * rng.normal(size=7) * np.abs(projected.nominal))
        theta = BaseParameters(*projected.estimate.tolist())
        assert (bounds[0] <= projected.estimate).all()
        assert (projected.estimate <= bounds[1]).all()
        assert is_consistent(robot.geometry, theta)
        rounding = 1e-9 * upper
        q = stretched(theta, robot.geometry)
        assert least_eigenvalue(q, q_nominal) > MARGIN * lower - rounding
        h = reduced_inertia(theta, robot.geometry, angles)
        assert least_eigenvalue(h, h_nominal) > MARGIN * lower - rounding


@PROPERTY
@given(machines(), between(0.05, 0.9), between(1.1, 20.0), SEEDS, between(-3.0, -0.5))
def test_projection_never_increases_distance_to_robots(
    robot: Machine, lower: float, upper: float, seed: int, size: float
) -> None:
    """
    Every mass and inertia of the robot is within the bounds; centres of mass are equal.

    Steps are up to a third of the model per tick.
    """
    rng = np.random.default_rng(seed)
    factors = {
        name: value * rng.uniform(lower, upper)
        for name, value in robot.physical.items()
        if name.endswith(('_mass', '_inertia'))
    }
    other = np.array(Machine({**robot.physical, **factors}).theta)
    projected = Projected(robot, lower, upper, 10.0 ** rng.uniform(-2.0, 2.0, 7))
    bounds = np.sort([lower * projected.nominal, upper * projected.nominal], axis=0)
    if (other < bounds[0]).any() or (other > bounds[1]).any():
        return  # first moments of parts on both sides of the axle or a joint
    for _ in range(40):
        step = 10.0**size * rng.normal(size=7) * np.abs(projected.nominal)
        before = projected.estimate + step
        projected.move(step)
        far = float(np.sqrt(np.sum(projected.gamma * (before - other) ** 2)))
        assert projected.distance(other) <= far * (1.0 + 1e-9)


def test_projection_inside_bounds_keeps_estimate() -> None:
    projected = Projected(Scenario().robot, 0.2, 5.0, np.ones(7))
    step = 0.3 * projected.nominal
    projected.move(step)
    assert (projected.estimate == projected.nominal + step).all()


@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf])
def test_projection_nan_or_inf_terminates_nan_is_kept(value: float) -> None:
    projected = Projected(Scenario().robot, 0.2, 5.0, np.ones(7))
    projected.move(np.array([0.0, 0.0, 0.0, value, 0.0, 0.0, 0.0]))
    assert np.isnan(value) == np.isnan(projected.estimate).any()
