# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Scenarios: a parameter file with changed values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
import os
from pathlib import Path
import shlex

from masmc_ros.api.settings import settings_of
from masmc_ros.params.declaration import Values
from masmc_ros.robot.robot import Robot, robot_of
from masmc_ros.scenario.scenario import load_scenario
from masmc_ros.share import scenario_file


@dataclass(frozen=True, repr=False)
class Scenario:
    """
    Parameter file with changed values, the input of all functions of the Python interface.

    Attributes
    ----------
    file
        Path of the parameter file.
    settings
        NAME=VALUE, as in `--set`.

    """

    file: str
    settings: tuple[str, ...] = ()

    @cached_property
    def values(self) -> Mapping[str, Values]:
        """Return the checked values by node and name; InputError for an invalid one."""
        return load_scenario(self.file, self.settings)

    @property
    def robot(self) -> Robot:
        """Return the robot of the plant, with its true masses."""
        return robot_of(self.values['plant'])

    def __repr__(self) -> str:
        """Return the arguments of `masmc simulate` for the scenario."""
        settings = (f'--set {shlex.quote(text)}' for text in self.settings)
        return ' '.join([shlex.quote(self.file), *settings])


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
        changed = scenario
    else:
        changed = Scenario(scenario_file(os.fspath(scenario)))
    new = settings_of(changed.file, settings, values)
    loaded = Scenario(changed.file, (*changed.settings, *new))
    _ = loaded.values
    return loaded
