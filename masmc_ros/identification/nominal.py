# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Nominal robot of an identification, from the values of a controller."""

from __future__ import annotations

from importlib import import_module

from masmc_ros.aliases import Array, Function
from masmc_ros.errors import InputError
from masmc_ros.identification.identify import Nominal
from masmc_ros.log.read.reader import Run
from masmc_ros.params.declaration import check_all, MutableValues, Values
from masmc_ros.robot.mechanisms import mechanism_from, NAME
from masmc_ros.robot.mechanisms import parameters as kinds
from masmc_ros.robot.robot import Robot, robot_of
import numpy as np

_FRICTION = 'robot.friction'
_SCALE = 'model_scale'


def nominal_of(values: Values) -> Nominal:
    """
    Return the robot that a controller with these values assumes, scaled by `model_scale`.

    The values need not be checked, and defaults may be missing. Raises InputError for an invalid
    robot.
    """
    assumed = _robot(values)
    robot = assumed
    if values.get(_FRICTION, 'none') != 'none':
        robot = _robot({**values, _FRICTION: 'none'})
    inertial, joints = len(robot.theta), len(robot.mechanism.joints)
    scale = values.get(_SCALE, 1.0)
    friction = np.zeros(2 * joints)
    friction[:len(assumed.theta) - inertial] = assumed.theta[inertial:]
    return Nominal(robot, scale * assumed.theta[:inertial], scale * friction)


def nominal_of_run(run: Run) -> Nominal:
    """
    Return the robot that the controller of a run assumed, otherwise that of the plant.

    Raises InputError if the log contains the parameters of neither, or an invalid robot.
    """
    for node in ('controller', 'plant'):
        if node in run.parameters:
            return nominal_of(run.parameters[node])
    raise InputError(
        f'{run.path}: no parameters of the controller in it; expected controller/parameters, or '
        '--nominal FILE with its robot'
    )


def _robot(values: Values) -> Robot:
    mechanism = mechanism_from(values)
    declared = (*kinds(), *mechanism.parameters)
    own = {p.name: values[p.name] for p in declared if p.name in values}
    return robot_of(check_all(declared, own, integers_for_doubles=True))


def of_its_kind(robot: Robot, function: str) -> Function:
    """
    Return a function of the module `identified` next to the formulas of a type of robot.

    Parameters
    ----------
    robot
        Robot.
    function
        Name of the function: `values_of` or `exciting_task`.

    Raises
    ------
    InputError
        if the type of robot has no such module.

    """
    package = robot.mechanism.module.rpartition('.')[0]
    try:
        return getattr(import_module(f'{package}.identified'), function)
    except ModuleNotFoundError as missing:
        raise InputError(
            f'{NAME} = {robot.mechanism.name}: no module {package}.identified, which writes '
            'identified parameters of this type of robot'
        ) from missing


def consistent_values(nominal: Nominal, parameters: Array) -> MutableValues:
    """Return the values of `robot.` parameters for consistent parameters (p) of a robot."""
    robot, inertial = nominal.robot, len(nominal.theta)
    values: MutableValues = of_its_kind(robot, 'values_of')(robot, parameters[:inertial])
    if any(parameter.name == _FRICTION for parameter in robot.mechanism.parameters):
        viscous, coulomb = np.split(parameters[inertial:], 2)
        values |= {
            _FRICTION: 'parameters',
            'robot.viscous_friction': tuple(viscous.tolist()),
            'robot.coulomb_friction': tuple(coulomb.tolist()),
        }
    return values
