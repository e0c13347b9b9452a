# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
A law at one state, as the package computes it and with what its formula is written from anew.

The matrices are those of `lagrangian.py`, derived without the package, in the joints' own rates.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from lagrangian import matrices
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.simulation import Simulation
from masmc_ros.params.scenario import load_scenario
from masmc_ros.robot.robot import robot_of
import numpy as np
from robots import Array, DEFAULT

PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')


@dataclass(frozen=True)
class Instant:
    """One state of the default robot, with its reference; SI units."""

    period: float
    position: Array
    """q (7)."""
    v: Array
    """Rates of the joints (4)."""
    desired: Array
    """x_d, xdot_d, xddot_d (3, 4)."""
    scale: float
    """Of the nominal model."""
    sigma: Array

    @cached_property
    def _matrices(self) -> Any:
        return matrices(DEFAULT, self.position, self.v)

    @property
    def jacobian(self) -> Array:
        """J (4, 4)."""
        found: Array = self._matrices.jacobian
        return found

    @property
    def drift(self) -> Array:
        """Jdot v (4)."""
        found: Array = self._matrices.jacobian_rate @ self.v
        return found

    @property
    def jacobian_rate(self) -> Array:
        """Jdot (4, 4)."""
        found: Array = self._matrices.jacobian_rate
        return found

    @property
    def inertia(self) -> Array:
        """H of the nominal model (4, 4)."""
        found: Array = self.scale * self._matrices.reduced_inertia
        return found

    @property
    def coriolis(self) -> Array:
        """V of the nominal model (4, 4)."""
        found: Array = self.scale * self._matrices.reduced_coriolis
        return found

    @property
    def task_inertia(self) -> Array:
        """H_x of the nominal model (4, 4)."""
        inverse = np.linalg.inv(self.jacobian)
        found: Array = inverse.T @ self.inertia @ inverse
        return found

    @property
    def error(self) -> Array:
        """Error e (4)."""
        found: Array = self._matrices.task_position - self.desired[0]
        return found

    @property
    def error_rate(self) -> Array:
        """Edot (4)."""
        found: Array = self.jacobian @ self.v - self.desired[1]
        return found

    @property
    def surface(self) -> Array:
        """Surface s (4)."""
        return self.error_rate + self.sigma * self.error

    @property
    def reference(self) -> tuple[Array, Array]:
        """Velocity v_r and acceleration a_r of (14), (4) each."""
        inverse = np.linalg.inv(self.jacobian)
        v_r = inverse @ (self.desired[1] - self.sigma * self.error)
        rest = self.desired[2] - self.sigma * self.error_rate - self.jacobian_rate @ v_r
        return v_r, inverse @ rest

    def model_torque(self, acceleration: Array) -> Array:
        """H J^-1 (xddot - Jdot v) + V v for a task acceleration (4)."""
        a = np.linalg.solve(self.jacobian, acceleration - self.drift)
        found: Array = self.inertia @ a + self.coriolis @ self.v
        return found


def at_random(seed: int, law: str, **values: Any) -> tuple[Controller, Instant]:
    """
    Return a controller with a law, and a state and a reference for it, away from singularity.

    `values` are parameters, a dot in their names being two underscores.
    """
    rng = np.random.default_rng(seed)
    named = {name.replace('__', '.'): value for name, value in values.items()}
    given = load_scenario(PAPER, ())['controller']
    controller = Controller(robot_of(given), given['control_period'], given)
    controller.change({**named, 'law': law})
    controller.estimate[:] = controller.nominal
    joints = rng.uniform(-2.0, 2.0, 4)
    joints[3] = rng.choice([-1.0, 1.0]) * rng.uniform(0.4, 2.6)
    instant = Instant(
        given['control_period'],
        np.concatenate([rng.uniform(-1.0, 1.0, 3), joints]),
        rng.uniform(-0.6, 0.6, 4),
        np.zeros((3, 4)),
        given['model_scale'],
        np.array(controller.values['sigma']),
    )
    near = matrices(DEFAULT, instant.position, instant.v)
    desired = rng.uniform(-0.2, 0.2, (3, 4))
    desired[0] += near.task_position
    instant.desired[:] = desired
    return controller, instant


def tick(controller: Controller, instant: Instant) -> Array:
    """Return the torque (4) that the law asks for, in N m."""
    rates = matrices(DEFAULT, instant.position, instant.v).null_space @ instant.v
    controller.tick(instant.position, rates, instant.desired.ravel())
    return controller.raw_torque.copy()


@dataclass(frozen=True)
class Track:
    """A run of the paper's experiment, or of what became of it; (ticks, ...) each, SI units."""

    time: Array
    error: Array
    surface: Array
    torque: Array
    estimate: Array
    position: Array
    """q as measured."""
    velocity: Array
    """Its derivative."""
    controller: Controller

    @property
    def settled(self) -> Array:
        """RMS error (axes) over the second half, m."""
        half = self.error[len(self.error) // 2:]
        found: Array = np.sqrt((half**2).mean(axis=0))
        return found


def run(law: str, *settings: str, duration: float = 20.0) -> Track:
    """Run the paper's experiment with a law, and settings as `masmc simulate --set` has them."""
    values = load_scenario(
        PAPER, (f'duration={duration}', f'controller.law={law}', *settings)
    )
    simulation = Simulation(values)
    stretch = next(simulation.run(block=10**6))
    count = len(stretch)
    return Track(
        np.arange(count) * simulation.timing.period,
        np.array(stretch.error),
        np.array(stretch.surface),
        np.array(stretch.torque),
        np.array(stretch.estimate),
        np.array(stretch.position),
        np.array(stretch.velocity),
        simulation.controller,
    )
