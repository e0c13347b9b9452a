# SPDX-License-Identifier: Apache-2.0
"""A whole run of the closed loop without ROS traffic, signals and all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from masmc_ros.errors import InputError
from masmc_ros.loop.closed_loop import closed_loop
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.simulated_robot import diverged, SimulatedRobot
from masmc_ros.loop.timing import Timing
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.robot import AXES, BASE_PARAMETERS
from masmc_ros.robot.parameters import ROBOT, Robot

Array = NDArray[np.float64]
Values = Mapping[str, Any]

BLOCK = 20_000
"""Ticks held in memory at a time."""


class Change(NamedTuple):
    """Checked values of some of the controller's parameters, new at a tick."""

    tick: int
    """The first tick that is computed with them."""
    values: Values


@dataclass(frozen=True)
class Stretch:
    """Consecutive ticks of a run; rows are ticks, SI units, radians."""

    first: int
    """Tick of row 0."""
    position: Array
    """(n, 7) in the order of joint_states."""
    velocity: Array
    """(n, 7) in the same order."""
    applied: Array
    """(n, 4) torque held over the interval that ended at the tick."""
    torque: Array
    """(n, 4) command computed at the tick."""
    reference: Array
    """(n, 12) x_d, xdot_d, xddot_d."""
    error: Array
    """(n, 4) e."""
    surface: Array
    """(n, 4) s."""
    estimate: Array
    """(n, 7) theta_hat used in the tick's torque."""
    singular: int
    """Number of ticks at which the arm was close to singular."""
    changes: tuple[Change, ...] = ()
    """Of the controller's parameters, at ticks of the stretch."""


class Simulation:
    """The closed loop of one robot, trajectory and controller."""

    def __init__(self, values: Mapping[str, Values], changes: Sequence[Change] = ()) -> None:
        """Take the checked parameter values of every node, by node name.

        `changes` of the controller's parameters are made on the way, in order of their ticks.
        Raises InputError where they do not fit together.
        """
        plant, control = values['plant'], values['controller']
        self._start = control
        self._changes = tuple(changes)
        robot = robot_of(plant)
        self.timing = Timing.from_values(plant)
        self.plant = SimulatedRobot(robot, self.timing.period, plant)
        self.controller = Controller(robot_of(control), self.timing.period, control)
        self.trajectory = Trajectory(
            values['trajectory'], self.timing.period, robot_of(values['trajectory'])
        )

    def run(self, block: int = BLOCK) -> Iterator[Stretch]:
        """Yield the run from its first to its last tick, `block` ticks at a time.

        Raises InputError for an endless run, a path out of reach and a run that diverges.
        """
        if self.timing.last is None:
            raise InputError('duration = 0.0: expected a length > 0 s for a simulation')
        self.plant.reset()
        self.controller.change(self._start)
        self.controller.reset()
        ticks = self.timing.last + 1
        for first in range(0, ticks, block):
            count = min(block, ticks - first)
            reference = self.trajectory.sample(first, count)
            stretch = self._stretch(first, reference, final=first + count == ticks)
            self._check_finite(stretch)
            yield stretch

    def _stretch(self, first: int, reference: Array, *, final: bool) -> Stretch:
        """Run ticks, with the changes among them."""
        end = first + len(reference)
        changes = tuple(change for change in self._changes if first <= change.tick < end)
        edges = sorted({first, end, *(change.tick for change in changes)})
        parts = []
        for start, stop in pairwise(edges):
            for change in changes:
                if change.tick == start:
                    self.controller.change(change.values)
            advance = self._compiled if self.controller.is_compiled else self._interpreted
            samples = reference[start - first : stop - first]
            parts.append(advance(start, samples, final=final and stop == end))
        return parts[0] if not changes else _joined(parts, changes)

    def _check_finite(self, stretch: Stretch) -> None:
        finite = (
            np.isfinite(stretch.torque).all(axis=1) & np.isfinite(stretch.position).all(axis=1)
        )
        if not finite.all():
            tick = stretch.first + int(np.argmin(finite))
            raise diverged(self.timing.time(tick))

    def _compiled(self, first: int, reference: Array, *, final: bool) -> Stretch:
        n = len(reference)
        plant, controller = self.plant, self.controller
        position, velocity = np.empty((n + 1, 7)), np.empty((n + 1, 7))
        applied = np.empty((n + 1, AXES))
        position[0], velocity[0], applied[0] = plant.position, plant.velocity, plant.applied
        torque, error, surface = (np.empty((n, AXES)) for _ in range(3))
        estimate = np.empty((n, BASE_PARAMETERS))
        singular = closed_loop(
            plant.geometry,
            plant.theta,
            plant.amplitude,
            plant.frequency,
            plant.phase,
            plant.limit,
            plant.steps,
            controller.nominal,
            controller.period,
            controller.law,
            controller.switching,
            controller.k_s1,
            controller.k_s2,
            controller.sigma,
            controller.gamma,
            controller.boundary_layer,
            controller.observer_gain,
            controller.estimate,
            controller.disturbance,
            controller.predicted,
            first,
            final,
            reference,
            position,
            velocity,
            applied,
            torque,
            error,
            surface,
            estimate,
        )
        if not final:
            plant.position[:] = position[n]
            plant.velocity[:] = velocity[n]
            plant.applied[:] = applied[n]
            plant.tick = first + n
        return Stretch(
            first,
            position[:n],
            velocity[:n],
            applied[:n],
            torque,
            reference,
            error,
            surface,
            estimate,
            singular,
        )

    def _interpreted(self, first: int, reference: Array, *, final: bool) -> Stretch:
        """Run tick by tick, as the nodes do; for laws in plain Python."""
        n = len(reference)
        plant, controller = self.plant, self.controller
        rows: dict[str, Any] = {
            'position': np.empty((n, 7)),
            'velocity': np.empty((n, 7)),
            'applied': np.empty((n, AXES)),
            'torque': np.empty((n, AXES)),
            'error': np.empty((n, AXES)),
            'surface': np.empty((n, AXES)),
            'estimate': np.empty((n, BASE_PARAMETERS)),
        }
        singular = 0
        for k in range(n):
            singular += controller.tick(plant.position, plant.velocity, reference[k])
            rows['position'][k] = plant.position
            rows['velocity'][k] = plant.velocity
            rows['applied'][k] = plant.applied
            rows['torque'][k] = controller.torque
            rows['error'][k] = controller.error
            rows['surface'][k] = controller.surface
            rows['estimate'][k] = controller.used_estimate
            if not (final and k == n - 1):
                plant.advance(controller.torque)
        return Stretch(first=first, reference=reference, singular=singular, **rows)


def _joined(parts: Sequence[Stretch], changes: tuple[Change, ...]) -> Stretch:
    rows = {
        field.name: np.concatenate([getattr(part, field.name) for part in parts])
        for field in fields(Stretch)
        if isinstance(getattr(parts[0], field.name), np.ndarray)
    }
    singular = sum(part.singular for part in parts)
    return Stretch(first=parts[0].first, singular=singular, changes=changes, **rows)


def robot_of(values: Values) -> Robot:
    """Return the robot that a node's parameter values describe."""
    return Robot.from_values({p.name: values[p.name] for p in ROBOT})
