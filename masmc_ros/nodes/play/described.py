# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Robot and references of the plots, from the parameters of the nodes of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.loop.records import nominal_theta
from masmc_ros.loop.simulated_robot import disturbance_waves
from masmc_ros.params.declaration import check_all, MutableValues, Values
from masmc_ros.report.measure.adaptation import TrueTheta
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.joint_names import joint_names
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.robot.robot import Robot, robot_description, robot_of
from masmc_ros.scenario.node_parameters import declared
import numpy as np

DESCRIBING = ('plant', 'controller')
"""Nodes that describe the robot, first the one with the true robot."""


TRUE_VALUE = 'true value'
"""Meaning of the reference of the estimates in a run with a plant."""


class ShownRobot(NamedTuple):
    """Robot of the scene."""

    robot: Robot
    description: str
    """URDF whose links have the names of the frames."""
    joints: tuple[str, ...]
    """Names of the positions in joint_states."""
    plant: Values | None
    """Checked values of the plant; None without one."""

    def disturbance(self, time: float) -> Array:
        """Return the disturbance torque (joints) in N·m at a time in s; 0 without a plant."""
        if self.plant is None:
            return np.zeros(len(self.robot.mechanism.joints))
        wave = disturbance_waves(self.plant)
        torque: Array = wave['amplitude'] * np.sin(wave['frequency'] * time + wave['phase'])
        return torque


class EstimateReference(NamedTuple):
    """Values by which estimates are divided."""

    mechanism: Mechanism
    theta: Callable[[Array], Array]
    """Function from times (n) in s to the values (n, parameters)."""
    meaning: str
    values: Values
    """Checked values of the controller."""


def shown_robot(parameters: Mapping[str, Values]) -> ShownRobot | None:
    """
    Return the robot of a run; None if no node describes it.

    Parameters
    ----------
    parameters
        Values by node and by name.

    Raises
    ------
    InputError
        If the robot is invalid, or its description is not on this machine.

    """
    node = next((node for node in DESCRIBING if node in parameters), None)
    if node is None:
        return None
    values = checked_values(node, parameters[node])
    plant = values if node == 'plant' else None
    return ShownRobot(robot_of(values), robot_description(values), joint_names(values), plant)


def estimate_reference(
    parameters: Mapping[str, Values], robot: Robot
) -> EstimateReference | None:
    """
    Return the reference of the estimates; None without a controller.

    It is the true robot with its payload if a plant describes it, otherwise the nominal robot of
    the controller.

    Parameters
    ----------
    parameters
        Values by node and by name.
    robot
        Robot of `shown_robot`.

    """
    if 'controller' not in parameters:
        return None
    values = checked_values('controller', parameters['controller'])
    nominal = robot_of(values)
    if 'plant' in parameters and robot.mechanism.theta == nominal.mechanism.theta:
        true = TrueTheta(robot, parameters['plant'])
        return EstimateReference(nominal.mechanism, true.at, TRUE_VALUE, values)
    theta = nominal_theta(nominal, values)
    return EstimateReference(
        nominal.mechanism, lambda times: np.tile(theta, (len(times), 1)), 'nominal value', values
    )


def checked_values(node: str, values: Values) -> MutableValues:
    """Return those of a node's values that this version declares; InputError for a wrong one."""
    declarations = declared(node, mechanism_from(values))
    known = {p.name: values[p.name] for p in declarations if p.name in values}
    return check_all(declarations, known, integers_for_doubles=True)
