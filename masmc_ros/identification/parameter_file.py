# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Nominal robot from the values of a controller, and parameter files of identified robots."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path

from masmc_ros.aliases import Array, Function
from masmc_ros.errors import InputError
from masmc_ros.files import write_file
from masmc_ros.identification.identify import Identified, Nominal
from masmc_ros.identification.latency_fit import LatencyFit
from masmc_ros.law.parts.delay_fields import LONGEST
from masmc_ros.log.read.reader import Run
from masmc_ros.params.declaration import check_all, MutableValues, Values
from masmc_ros.params.file import parameter_file_text
from masmc_ros.robot.declaration import URDF
from masmc_ros.robot.mechanisms import mechanism_from, NAME
from masmc_ros.robot.mechanisms import parameters as kinds
from masmc_ros.robot.robot import Robot, robot_of
from masmc_ros.scenario.node_parameters import declared
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


def write_identified(
    path: Path, nominal: Nominal, identified: Identified, source: str
) -> list[Path]:
    """
    Write the parameters of a controller that assumes the identified robot.

    Latency and motor lag beyond the range of the controller are comments only.

    Parameters
    ----------
    path
        Parameter file to write. For a robot from a URDF, another URDF is written next to it.
    nominal
        Nominal robot.
    identified
        Results of the identification.
    source
        Name of the run, for a comment.

    Returns
    -------
        Paths of the written files.

    """
    values = consistent_values(nominal, identified.values)
    values['model_scale'] = 1.0
    files = [path]
    if URDF in values:
        description = path.with_suffix('.urdf').resolve()
        write_file(description, values[URDF].encode())
        values[URDF] = str(description)
        files.append(description)
    timing = {'latency': identified.timing.latency, 'motor_lag': identified.timing.lag}
    reason = unwritten_timing(identified.timing)
    if not reason:
        known = {parameter.name for parameter in declared('controller', mechanism_from(values))}
        values |= {name: timing[name].value for name in timing.keys() & known}
    # The task is that of the exciting motion: the file follows one with the path and its task.
    values.pop('robot.task', None)
    comments = [f'Robot identified by masmc identify from {source}.'] + [
        f'{name}: {1e3 * estimate.value:.3f} ms, standard error {1e3 * estimate.error:.2g} ms'
        for name, estimate in timing.items()
    ]
    comments += [reason] * bool(reason)
    write_parameters(path, {'controller': values}, comments)
    return files


def unwritten_timing(timing: LatencyFit) -> str:
    """
    Return why latency and motor lag are not written, '' if they are.

    Each of them is right only with the other, so both are written or none.
    """
    if max(timing.latency.value, timing.lag.value) <= LONGEST:
        return ''
    return (
        f'latency = {1e3 * timing.latency.value:.3f} ms, motor lag = '
        f'{1e3 * timing.lag.value:.3f} ms: not written; expected at most {1e3 * LONGEST:g} ms '
        'each, the range of the controller'
    )


def write_parameters(
    path: Path, nodes: Mapping[str, Values], comments: list[str]
) -> None:
    """
    Write a ROS 2 parameter file.

    Parameters
    ----------
    path
        File to write.
    nodes
        Values by node, or by EVERY for all nodes, and by name.
    comments
        Lines of comments at the start of the file.

    """
    write_file(path, parameter_file_text(nodes, comments).encode())
