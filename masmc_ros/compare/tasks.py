# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The tasks of a comparison, by the names of its laws and trials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from masmc_ros.compare.campaign import Task
from masmc_ros.compare.contenders import contenders, marked
from masmc_ros.compare.trials import sets_observer, trials_named
from masmc_ros.errors import InputError
from masmc_ros.law.command_interface import takes_rates
from masmc_ros.params.declaration import Values
from masmc_ros.robot.mechanisms import mechanism_from


def tasks_of(
    file: str,
    settings: Sequence[str],
    scenario: Mapping[str, Values],
    laws: str,
    trials: str,
    seeds: int,
) -> list[Task]:
    """
    Return a task for each law.

    Parameters
    ----------
    file, settings
        parameter file, and NAME=VALUE as in `--set`.
    scenario
        their checked values by node.
    laws, trials
        names as in `--laws` and `--trials`.
    seeds
        number of runs of each law in each trial.

    Raises
    ------
    InputError
        If a name is unknown or a value out of range, or if the scenario commands velocities.

    """
    controller = scenario['controller']
    if takes_rates(controller):
        raise InputError(
            f'{file}: command_interface = velocity: only one law commands velocities; expected'
            ' effort'
        )
    mechanism = mechanism_from(scenario['plant'])
    named = tuple(trial for trial in trials_named(trials) if trial.suits(mechanism))
    chosen = contenders(laws, mechanism, controller['switching'])
    if not sets_observer(named):
        chosen = marked(chosen, controller)
    return [Task(file, tuple(settings), contender, named, seeds) for contender in chosen]
