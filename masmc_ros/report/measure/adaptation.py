# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Adaptation of a run: estimates of the base inertial parameters relative to their values."""

from __future__ import annotations

from contextlib import suppress
from typing import NamedTuple

from masmc_ros.aliases import Array, Indices
from masmc_ros.errors import InputError
from masmc_ros.law.parts.model import MODEL_SCALE
from masmc_ros.log.read.reader import Run
from masmc_ros.loop.plant_parameters import PAYLOAD_MASS, PAYLOAD_TIME
from masmc_ros.loop.records import nominal_theta
from masmc_ros.params.declaration import Values
from masmc_ros.report.measure.parameters import robot_of_node, run_changes
from masmc_ros.robot.declaration import Quantity
from masmc_ros.robot.robot import Robot
import numpy as np

_SMALLEST = 1.0e-9
"""Smallest value of a parameter that a ratio can have as its denominator, in SI units."""

_PERCENT = 100.0


class Adaptation(NamedTuple):
    """
    Ratios of the estimates to the values of the parameters.

    Attributes
    ----------
    times
        (n) in s from the first state.
    ratios
        (n, k) estimate / value; 1 for a correct estimate.
    values
        (k) values at the end of the run, in SI units.
    quantities
        (k) parameters whose value is not zero.
    is_true
        whether the values are those of the simulated plant; otherwise those of the nominal model.

    """

    times: Array
    ratios: Array
    values: Array
    quantities: tuple[Quantity, ...]
    is_true: bool

    @property
    def final_errors(self) -> Array:
        """Return the errors (k) of the last estimates in percent of the values."""
        errors: Array = _PERCENT * (self.ratios[-1] - 1.0)
        return errors

    def thinned(self, samples: int) -> Adaptation:
        """Return the adaptation with the first sample of each of some ranges, and the last."""
        last = len(self.times) - 1
        step = -(-len(self.times) // samples)
        kept = np.unique(np.append(np.arange(0, last, step), last))
        return self._replace(times=self.times[kept], ratios=self.ratios[kept])


def adaptation(run: Run) -> Adaptation | None:
    """
    Return the adaptation of a logged run.

    The values are those of the simulated plant, with its payload from the time at which the robot
    picks it up. A log without a plant, such as that of a real robot, has those of the nominal
    model. Returns None if the log lacks estimates or both robots.
    """
    estimate = run.telemetry.get('estimate')
    if estimate is None or not len(estimate):
        return None
    times = estimate.times - run.times[0]
    true = true_theta_of_run(run)
    values = nominal_of_run(run) if true is None else true.at(times)
    if values is None:
        return None
    return relative(times, estimate.values, values, run.mechanism.theta, is_true=true is not None)


def relative(
    times: Array,
    estimates: Array,
    values: Array,
    quantities: tuple[Quantity, ...],
    *,
    is_true: bool = True,
) -> Adaptation:
    """
    Return estimates relative to the values of the parameters.

    Parameters
    ----------
    times
        (n) in s.
    estimates
        (n, parameters) in SI units.
    values
        (parameters) or (n, parameters) in SI units.
    quantities
        (parameters).
    is_true
        whether the values are those of the simulated plant.

    """
    values = np.broadcast_to(values, estimates.shape)
    shown = divisors(values)
    ratios = estimates[:, shown] / values[:, shown]
    names = tuple(quantities[i] for i in shown)
    return Adaptation(times, ratios, values[-1, shown], names, is_true)


def divisors(values: Array) -> Indices:
    """Return the indices of the parameters whose values (n, parameters) can divide estimates."""
    return np.flatnonzero((np.abs(values) > _SMALLEST).all(axis=0))


def assumed_model(run: Run) -> tuple[float, float] | None:
    """
    Return the smallest and the largest ratio of the nominal to the true parameters.

    None if the log lacks the parameters of the plant or of the controller.
    """
    nominal, plant = nominal_of_run(run), true_theta_of_run(run)
    if nominal is None or plant is None:
        return None
    true = plant.at(np.zeros(1))
    if nominal.shape != true[0].shape:
        return None
    known = divisors(true)
    ratios = nominal[known] / true[0][known]
    return (float(ratios.min()), float(ratios.max())) if len(ratios) else None


def nominal_of_run(run: Run) -> Array | None:
    """Return the parameters of the controller's nominal model at the start; None if unknown."""
    robot = robot_of_node(run, 'controller')
    values = run.parameters.get('controller', {})
    if robot is None or not isinstance(values.get(MODEL_SCALE.name), float):
        return None
    with suppress(InputError, KeyError):
        return nominal_theta(robot, values)
    return None


class TrueTheta:
    """Parameters of a simulated robot over time, which its payload changes."""

    def __init__(self, robot: Robot, values: Values) -> None:
        """
        Initialise the parameters with the first payload.

        Parameters
        ----------
        robot
            Robot of the plant, without its payload.
        values
            Parameters of the plant, `payload.mass` and `payload.time` among them, if it has them.

        """
        self._robot = robot
        self._pick_up = PAYLOAD_TIME.or_default(values)
        self._steps: list[tuple[float, Array]] = []
        self.change(0.0, PAYLOAD_MASS.or_default(values))

    def change(self, time: float, mass: float) -> None:
        """Add a payload in kg from a time in s on; 0: no payload. Times must not decrease."""
        theta = self._robot.theta
        if mass > 0.0:
            theta = self._robot.theta_with_payload(mass, np.zeros(3), np.zeros(6))
        self._steps.append((max(time, self._pick_up), theta))

    def at(self, times: Array) -> Array:
        """Return the parameters (n, parameters) at times (n) in s from the first state."""
        theta = np.tile(self._robot.theta, (len(times), 1))
        for start, loaded in self._steps:
            theta[times >= start] = loaded
        return theta


def true_theta_of_run(run: Run) -> TrueTheta | None:
    """Return the parameters of the simulated plant over time; None if unknown."""
    robot = robot_of_node(run, 'plant')
    if robot is None:
        return None
    true = TrueTheta(robot, run.parameters['plant'])
    for change in run_changes(run):
        is_payload = (change.node, change.name) == ('plant', PAYLOAD_MASS.name)
        if is_payload and isinstance(change.new, float):
            true.change(change.time, change.new)
    return true
