# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
A control law at one state: its output, and the terms for an independent implementation.

The matrices in joint velocities are those of `lagrangian.py`, derived without the package.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from helpers.lagrangian import matrices
from helpers.robots import Array, DEFAULT
from masmc_ros.jit.compiled import interpreted
from masmc_ros.loop.closed_loop import control_tick
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.simulation import Simulation
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.scenario import load_scenario
import numpy as np

PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')


@dataclass(frozen=True)
class Instant:
    """One state of the default robot, with its reference; SI units."""

    period: float
    position: Array
    """q (7)."""
    v: Array
    """Joint velocities (4)."""
    desired: Array
    """x_d, xdot_d, xddot_d (3, 4)."""
    scale: float
    """Scale of the nominal model's masses."""
    sigma: Array

    @cached_property
    def _matrices(self) -> Any:
        return matrices(DEFAULT, self.position, self.v)

    @property
    def jacobian(self) -> Array:
        """J (4, 4)."""
        result: Array = self._matrices.jacobian
        return result

    @property
    def drift(self) -> Array:
        """Jdot v (4)."""
        result: Array = self._matrices.jacobian_rate @ self.v
        return result

    @property
    def jacobian_rate(self) -> Array:
        """Jdot (4, 4)."""
        result: Array = self._matrices.jacobian_rate
        return result

    @property
    def inertia(self) -> Array:
        """H of the nominal model (4, 4)."""
        result: Array = self.scale * self._matrices.reduced_inertia
        return result

    @property
    def coriolis(self) -> Array:
        """V of the nominal model (4, 4)."""
        result: Array = self.scale * self._matrices.reduced_coriolis
        return result

    @property
    def task_inertia(self) -> Array:
        """H_x of the nominal model (4, 4)."""
        inverse = np.linalg.inv(self.jacobian)
        result: Array = inverse.T @ self.inertia @ inverse
        return result

    @property
    def error(self) -> Array:
        """Error e (4)."""
        result: Array = self._matrices.task_position - self.desired[0]
        return result

    @property
    def error_rate(self) -> Array:
        """Edot (4)."""
        result: Array = self.jacobian @ self.v - self.desired[1]
        return result

    @property
    def surface(self) -> Array:
        """Surface s (4)."""
        return self.error_rate + self.sigma * self.error

    @property
    def reference(self) -> tuple[Array, Array]:
        """Velocity v_r (4) and acceleration a_r (4) of (14)."""
        inverse = np.linalg.inv(self.jacobian)
        v_r = inverse @ (self.desired[1] - self.sigma * self.error)
        a = self.desired[2] - self.sigma * self.error_rate - self.jacobian_rate @ v_r
        return v_r, inverse @ a

    def model_torque(self, acceleration: Array) -> Array:
        """Return H J^-1 (xddot - Jdot v) + V v for a task acceleration xddot (4)."""
        a = np.linalg.solve(self.jacobian, acceleration - self.drift)
        result: Array = self.inertia @ a + self.coriolis @ self.v
        return result


def at_random(seed: int, law: str, **values: Any) -> tuple[Controller, Instant]:
    """
    Return a controller with a law, and a random regular state with a reference.

    `values` are parameters; two underscores in a name stand for a dot.
    """
    rng = np.random.default_rng(seed)
    named = {name.replace('__', '.'): value for name, value in values.items()}
    parameters = load_scenario(PAPER, ())['controller']
    controller = Controller(robot_of(parameters), parameters['control_period'], parameters)
    controller.change({**named, 'law': law})
    controller.estimate[:] = controller.nominal
    joints = rng.uniform(-2.0, 2.0, 4)
    joints[3] = rng.choice([-1.0, 1.0]) * rng.uniform(0.4, 2.6)
    instant = Instant(
        parameters['control_period'],
        np.concatenate([rng.uniform(-1.0, 1.0, 3), joints]),
        rng.uniform(-0.6, 0.6, 4),
        np.zeros((3, 4)),
        parameters['model_scale'],
        np.array(controller.values['sigma']),
    )
    near = matrices(DEFAULT, instant.position, instant.v)
    desired = rng.uniform(-0.2, 0.2, (3, 4))
    desired[0] += near.task_position
    instant.desired[:] = desired
    return controller, instant


def tick(controller: Controller, instant: Instant) -> Array:
    """
    Return the torque (4) that the law requests, in N·m.

    The formulas run as plain Python, which has the same bits and compiles nothing.
    """
    rates = matrices(DEFAULT, instant.position, instant.v).null_space @ instant.v
    inputs = instant.position, rates, instant.desired.ravel()
    with interpreted(), np.errstate(all='ignore'):
        control_tick(controller.settings, controller.memory, controller.signals, *inputs)
    return controller.raw_torque.copy()


@dataclass(frozen=True)
class Track:
    """Signals of a run of the paper's experiment, (ticks, ...) each, in SI units."""

    time: Array
    error: Array
    surface: Array
    torque: Array
    estimate: Array
    position: Array
    """Measured q."""
    velocity: Array
    """Derivative of the measured q."""
    controller: Controller

    @property
    def settled(self) -> Array:
        """RMS error (axes) over the second half, m."""
        half = self.error[len(self.error) // 2:]
        result: Array = np.sqrt((half**2).mean(axis=0))
        return result


def run(law: str, *settings: str, duration: float = 20.0) -> Track:
    """Run the paper's experiment with a law and settings as of `masmc simulate --set`."""
    values = load_scenario(
        PAPER, (f'duration={duration}', f'controller.law={law}', *settings)
    )
    simulation = Simulation(values)
    tick_block = next(simulation.run(block=10**6))
    count = len(tick_block)
    return Track(
        np.arange(count) * simulation.timing.period,
        np.array(tick_block.error),
        np.array(tick_block.surface),
        np.array(tick_block.torque),
        np.array(tick_block.estimate),
        np.array(tick_block.position),
        np.array(tick_block.velocity),
        simulation.controller,
    )
