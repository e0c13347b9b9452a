# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Description of a campaign: a scenario, and the values that vary between its runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
import json
import math
import shlex

from masmc_ros.campaign.runs import (
    checked_scenario,
    Description,
    FEWEST_ALIKE,
    Run,
    scenario_of,
    WORTH_LANES,
)
from masmc_ros.campaign.variable import (
    Axis,
    check_distinct,
    check_range,
    Draw,
    drawn_values,
    Variable,
    with_variables,
)
from masmc_ros.errors import InputError
from masmc_ros.law import registry
from masmc_ros.law.law import Law
from masmc_ros.law.registry import LAW
from masmc_ros.loop.batch_simulation import of_all_lanes
from masmc_ros.loop.controller_parameters import ACTIVE_ON_START, APPROACH_ON_START
from masmc_ros.loop.plant_parameters import PHYSICS, RIGID
from masmc_ros.loop.plant_parameters import SEED as PLANT_SEED
from masmc_ros.loop.scenario import Scenario
from masmc_ros.params.text import yaml_text
from masmc_ros.scenario.scenario import check_start
import numpy as np

SEED = 'plant.seed'

_SEEDS = 2**32

MOST_RUNS = 2**40
"""Largest number of runs."""


@dataclass(frozen=True, eq=False)
class Campaign(Description):
    """
    Description of a campaign, which determines each run by its number.

    The runs are the points of the grid of all axes, the last axis fastest, with `repeats` runs at
    each point. Run k of a point has draw k and seed `plant.seed` + k, the same at all points.

    Attributes
    ----------
    file
        Parameter file, for the commands that repeat a run.
    settings
        Settings of `--set`, for the same commands.
    scenario
        Scenario with the settings. A URDF is its text, not its path.
    axes
        Axes of variation.
    draws
        Parameters with random values.
    repeats
        Number of runs at each point of the grid.
    seed
        Seed of the draws.
    sobol
        True if the draws are points of a Sobol sequence.

    """

    file: str
    settings: tuple[str, ...]
    scenario: Scenario
    axes: tuple[Axis, ...] = ()
    draws: tuple[Draw, ...] = ()
    repeats: int = 1
    seed: int = 0
    sobol: bool = False

    @property
    def total(self) -> int:
        """Return the number of runs."""
        return math.prod(len(axis.values) for axis in self.axes) * self.repeats

    @property
    def lanes(self) -> int:
        """Return the number of lanes: runs that are computed in one array."""
        return self.most_lanes if self.total >= WORTH_LANES else 1

    @cached_property
    def variables(self) -> tuple[Variable, ...]:
        """Return the variables of the axes, then those of the draws."""
        options = [*(('--vary', axis.name) for axis in self.axes),
                   *(('--draw', draw.name) for draw in self.draws)]  # fmt: skip
        return tuple(
            Variable.named(name, self.mechanism, f'{option} {name}') for option, name in options
        )

    @cached_property
    def notice(self) -> str:
        """Return a line on variables that prevent parallel runs; '' if there is none."""
        if self.lanes == 1 or PHYSICS.of(self.scenario.plant) != RIGID:
            return ''
        equal = of_all_lanes(self.scenario)
        names = [
            variable.name
            for variable in self.variables
            if any(f'{n}.{p.name}' in equal for n, p in variable.readers.items())
        ]
        groups = math.prod(len(axis.values) for axis in self.axes if axis.name in names)
        is_drawn = any(draw.name in names for draw in self.draws)
        if not is_drawn and self.total >= FEWEST_ALIKE * groups:
            return ''
        return (
            f'{", ".join(names)}: law, timing or path differ between most runs, so each run is '
            'computed alone, which takes about five times as long as runs that differ in '
            'parameters of the robot, the gains or the disturbance; expected a few values by '
            '--vary, with --runs for the draws of the others'
        )

    @cached_property
    def text(self) -> str:
        """Return the description as JSON, from which `from_text` restores it."""
        described = {field.name: getattr(self, field.name) for field in fields(self)}
        return json.dumps({**described, 'scenario': self.scenario.values}, sort_keys=True)

    @classmethod
    def from_text(cls, text: str) -> Campaign:
        """Return the campaign of a JSON text."""
        values = json.loads(text)
        values['scenario'] = checked_scenario(values['scenario'])
        values['settings'] = tuple(values['settings'])
        values['axes'] = tuple(Axis(name, tuple(entries)) for name, entries in values['axes'])
        values['draws'] = tuple(Draw(n, kind, tuple(a)) for n, kind, a in values['draws'])
        return cls(**values)

    def runs(self, first: int, count: int) -> Iterator[Run]:
        """
        Yield the runs `first` to `first + count - 1`.

        Raises InputError for values that a node would reject.
        """
        numbers = np.arange(first, first + count)
        points, repeats = np.divmod(numbers, self.repeats)
        shape = tuple(len(axis.values) for axis in self.axes)
        places = np.unravel_index(points, shape) if shape else ()
        start = int(repeats.min())
        known = drawn_values(
            self.draws, self.seed, start, int(repeats.max()) + 1 - start, sobol=self.sobol
        )
        for k, number in enumerate(numbers.tolist()):
            repeat = int(repeats[k])
            varied = [
                axis.values[place[k]] for axis, place in zip(self.axes, places, strict=True)
            ]
            values = [*varied, *(float(column[repeat - start]) for column in known)]
            yield self._run(number, repeat, values)

    def _run(self, number: int, repeat: int, values: Sequence[object]) -> Run:
        plant = self.scenario.plant
        plant = {**plant, 'seed': (PLANT_SEED.of(plant) + repeat) % _SEEDS}
        scenario = self.scenario.with_nodes({'plant': plant})
        scenario = with_variables(scenario, self.variables, values)
        check_start(scenario, f'run {number}')
        names = [variable.name for variable in self.variables]
        return Run(number, dict(zip(names, values, strict=True)), scenario)

    def command(self, run: Run) -> str:
        """Return the command `masmc simulate` that repeats a run."""
        settings = [*self.settings, *(v.setting(run.scenario) for v in self.variables)]
        plant, controller = run.scenario.plant, run.scenario.controller
        if PLANT_SEED.of(plant) != PLANT_SEED.of(self.scenario.plant):
            settings.append(f'{SEED}={PLANT_SEED.of(plant)}')
        if PHYSICS.of(plant) == RIGID:
            # Such runs start active and without an approach.
            if not ACTIVE_ON_START.of(controller):
                settings.append('controller.active_on_start=true')
            if APPROACH_ON_START.of(controller):
                settings.append('controller.approach_on_start=false')
        # The last setting of a parameter applies.
        distinct = [*dict.fromkeys(reversed(settings))][::-1]
        options = ' '.join(f'--set {shlex.quote(setting)}' for setting in distinct)
        return f'masmc simulate {shlex.quote(self.file)} {options}'.rstrip()


def campaign_of(
    file: str,
    settings: Sequence[str] = (),
    *,
    axes: Sequence[Axis] = (),
    draws: Sequence[Draw] = (),
    repeats: int = 1,
    seed: int = 0,
    sobol: bool = False,
) -> Campaign:
    """
    Return the campaign of a parameter file.

    Parameters
    ----------
    file
        Parameter file.
    settings
        Texts NAME=VALUE of `--set`.
    axes
        Axes of variation.
    draws
        Parameters with random values.
    repeats
        Number of runs at each point of the grid.
    seed
        Seed of the draws.
    sobol
        True if the draws are points of a Sobol sequence.

    Raises
    ------
    InputError
        if a name is unknown, appears twice or cannot vary, or if a value of an axis or a value
        that can be drawn is out of range.

    """
    scenario = scenario_of(file, settings)
    campaign = Campaign(
        file, tuple(settings), scenario, tuple(axes), tuple(draws), repeats, seed, sobol
    )
    if campaign.total > MOST_RUNS:
        raise InputError(f'{campaign.total} runs; expected at most {MOST_RUNS}')
    check_distinct(campaign.variables)
    names = [variable.name for variable in campaign.variables]
    if SEED in names and repeats > 1 and not any(draw.name == SEED for draw in draws):
        raise InputError(f'{SEED}: already differs between the runs of a point; remove the axis')
    for axis, variable in zip(axes, campaign.variables, strict=False):
        place = f'--vary {axis.name}={",".join(map(yaml_text, axis.values))}'
        for value in axis.values:
            _check(variable, scenario, value, place)
    for draw, variable in zip(draws, campaign.variables[len(axes):], strict=True):
        check_range(draw, variable.parameter)
        if (variable.parameter.kind == 'integer') != (draw.distribution == 'integers'):
            other = 'another distribution than integers'
            expected = 'integers' if variable.parameter.kind == 'integer' else other
            raise InputError(f'--draw {draw.text}: expected {expected}')
        _check(variable, scenario, float(draw.frozen.median()), f'--draw {draw.text}')
    for law in _laws(campaign):
        if not isinstance(registry.load_for(law, campaign.mechanism), Law):
            raise InputError(
                f'controller.law = {law}: it is plain Python, expected a compiled law'
            )
    return campaign


def _check(variable: Variable, scenario: Scenario, value: object, place: str) -> None:
    try:
        changed = with_variables(scenario, [variable], [value])
    except InputError as error:
        raise InputError(f'{place}: {error}') from None
    check_start(changed, place)


def _laws(campaign: Campaign) -> list[str]:
    """Return the names of all laws of a campaign."""
    varied = [axis.values for axis in campaign.axes if axis.name == 'controller.law']
    return list(*varied) or [LAW.of(campaign.scenario.controller)]

