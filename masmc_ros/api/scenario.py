# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Scenarios: a parameter file with changed values; known laws, robots and logged runs."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from masmc_ros.errors import InputError
from masmc_ros.files import scenario_file
from masmc_ros.law import registry
from masmc_ros.law.law import Law
from masmc_ros.loop.scenario import Scenario
from masmc_ros.params.declaration import Values
from masmc_ros.params.text import yaml_text
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.robot.robot import Robot
from masmc_ros.scenario.node_parameters import declared, shared
from masmc_ros.scenario.scenario import load_scenario, source_of
import numpy as np

if TYPE_CHECKING:
    from masmc_ros.log.read.reader import Run


_NODES = ('controller', 'plant', 'trajectory')


def settings_of(
    file: str, settings: Values | None, values: Values
) -> list[str]:
    """
    Return values of the Python interface as texts NAME=VALUE of `--set`.

    Parameters
    ----------
    file
        Parameter file, whose robot determines the known names.
    settings
        Values by full name, as in `--set`.
    values
        Values by the name of the parameter without its node, with two underscores for a dot.

    Raises
    ------
    InputError
        if a short name belongs to several nodes.

    """
    of_robot = {n.replace('__', '.'): v for n, v in values.items() if n.startswith('robot__')}
    stated = [f'{n}={yaml_text(v)}' for n, v in {**(settings or {}), **of_robot}.items()]
    plant = source_of(file, stated).file.for_node('plant')
    mechanism = mechanism_from({**plant, **(settings or {})})
    named = {_full_name(name.replace('__', '.'), mechanism): v for name, v in values.items()}
    return [f'{name}={yaml_text(value)}' for name, value in {**(settings or {}), **named}.items()]


def whole(name: str, value: object, least: int = 0) -> int:
    """Return the value of an argument; InputError if it is no whole number >= `least`."""
    if isinstance(value, int | np.integer) and not isinstance(value, bool):
        number = int(value)
        if number >= least:
            return number
    raise InputError(f'{name} = {value!r}: expected a whole number >= {least}')


def _full_name(name: str, mechanism: Mechanism) -> str:
    """Return the name with its node; a shared or unknown one unchanged."""
    if any(parameter.name == name for parameter in shared(mechanism)):
        return name
    nodes = [node for node in _NODES if any(p.name == name for p in declared(node, mechanism))]
    if len(nodes) > 1:
        full = ' or '.join(f"'{node}.{name}'" for node in nodes)
        raise InputError(f'{name}: a parameter of several nodes; expected settings with {full}')
    return f'{nodes[0]}.{name}' if nodes else name


def load(
    scenario: str | Path | Scenario = 'paper', settings: Values | None = None, **values: object
) -> Scenario:
    """
    Return a scenario with changed values.

    Parameters
    ----------
    scenario
        Parameter file, name of an installed one, or a scenario to change.
    settings
        Values by name as in `--set`: `{'plant.robot.link_2_mass': 1.2}`.
    values
        The same by the name without its node: `k_s1=150`; two underscores stand for a dot.

    Raises
    ------
    InputError
        if there is no such file, a name is unknown or a value is out of range.

    """
    if isinstance(scenario, Scenario):
        file, stated = scenario.file, scenario.settings
    else:
        file, stated = scenario_file(os.fspath(scenario)), ()
    return load_scenario(file, (*stated, *settings_of(file, settings, values)))


def laws() -> dict[str, str]:
    """Return the control laws with their summaries; the names are the values of `law`."""
    known = {name: registry.load(name) for name in registry.names()}
    return {n: law.summary if isinstance(law, Law) else 'plain Python' for n, law in known.items()}


def load_robot(source: str, **values: object) -> Robot:
    """
    Return a robot.

    Parameters
    ----------
    source
        URDF file, parameter file, or name of an installed parameter file. A URDF has the choices
        that `masmc robot` prints.
    values
        Parameters `robot.NAME` by NAME, such as `tip_frame='tool0'`.

    Raises
    ------
    InputError
        if there is no such file, a name is unknown, or the robot is invalid.

    """
    return load(source, {f'robot.{name}': value for name, value in values.items()}).robot


def read(log: str | Path) -> Run:
    """
    Return a logged run, of a recorder or of `masmc simulate --output`.

    Raises
    ------
    InputError
        if the file is missing, or not a log of a run.

    """
    from masmc_ros.log.read.reader import read_run

    return read_run(log)
