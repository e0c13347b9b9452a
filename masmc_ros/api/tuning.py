# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Search of gains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from masmc_ros.api.scenario import load, Scenario, whole
from masmc_ros.campaign.campaign import campaign_of
from masmc_ros.campaign.runs import CPU
from masmc_ros.campaign.summary import metric_named
from masmc_ros.campaign.tune import (
    BaseFile,
    Evaluation,
    FORM,
    searched,
    tuned,
    Tuning,
    variables_of,
)
from masmc_ros.campaign.variable import draw as parsed_draw
from masmc_ros.campaign.variable import Variable
from masmc_ros.child_process import processors
from masmc_ros.errors import InputError
from masmc_ros.files import write_file
from masmc_ros.native.device import device_option
from masmc_ros.params.declaration import Values
from masmc_ros.report.measure.table import Column
import pyarrow as pa
from tqdm import tqdm


@dataclass(frozen=True, repr=False)
class TunedScenario:
    """
    Result of a search.

    Attributes
    ----------
    scenario
        Scenario that was tuned.
    variables
        Searched parameters.
    columns
        The two minimised metrics.
    search
        All candidates, the front and the chosen candidate.
    base
        Parameter file of the scenario when the search started.

    """

    scenario: Scenario
    variables: tuple[Variable, ...]
    columns: tuple[Column, Column]
    search: Tuning
    base: BaseFile

    @property
    def values(self) -> dict[str, float]:
        """Return the chosen value of each parameter by its full name."""
        return self.search.chosen.values

    @property
    def objectives(self) -> dict[str, tuple[float, float]]:
        """Return each metric with the scenario's and with the chosen values, SI units."""
        names = [column.name for column in self.columns]
        both = zip(self.search.start.objectives, self.search.chosen.objectives, strict=True)
        return dict(zip(names, both, strict=True))

    @property
    def front(self) -> pa.Table:
        """Return the Pareto front: a column for each metric and parameter, SI units."""
        names = [column.name for column in self.columns]
        return pa.Table.from_pylist([
            {**dict(zip(names, candidate.objectives, strict=True)), **candidate.values}
            for candidate in self.search.front
        ])

    @property
    def text(self) -> str:
        """Return a ROS parameter file with the chosen values."""
        return self.base.tuned(self.variables, self.values)

    def __repr__(self) -> str:
        """Return the chosen values, and the metrics before and after."""
        chosen = ', '.join(f'{name} = {value:.4g}' for name, value in self.values.items())
        metrics = ', '.join(
            f'{name} {before:.4g} -> {after:.4g}'
            for name, (before, after) in self.objectives.items()
        )
        return f'{chosen}: {metrics}'

    def write(self, path: str | Path) -> None:
        """Write the parameter file; InputError if that fails."""
        write_file(Path(path), self.text.encode())


def tune(
    scenario: str | Path | Scenario,
    ranges: Mapping[str, str],
    *,
    draw: Mapping[str, str] | None = None,
    runs: int = 16,
    objectives: Sequence[str] = ('', 'torque_variation'),
    percentile: float = 100.0,
    evaluations: int = 256,
    seed: int = 0,
    sobol: bool = False,
    settings: Values | None = None,
    threads: int = 0,
    device: str = CPU,
    **values: object,
) -> TunedScenario:
    """
    Search gains that minimise two metrics, as `masmc tune` does.

    Parameters
    ----------
    scenario, settings, values
        As in `load`.
    ranges
        Searched parameters with LOW:HIGH or LOW:HIGH:log:
        `{'controller.k_s1': '20:400:log'}`.
    draw
        Distributions by name, as in `sweep`.
    runs
        Number of runs of each candidate; without `draw` it is 1.
    objectives
        Two metrics, columns of `sweep`; empty: the RMS error of the first point.
    percentile
        Percentile of the metrics over the runs; 100: the worst run.
    evaluations
        Number of candidates.
    seed
        Seed of the draws and of the search.
    sobol
        True if the draws are points of a Sobol sequence.
    threads
        Number of threads; 0: one for each processor.
    device
        `cpu`, or `cuda` for a GPU.

    Raises
    ------
    InputError
        if a name is unknown or a value out of range.

    """
    if not 0.0 <= percentile <= 100.0:
        raise InputError(f'percentile = {percentile!r}: expected a number in [0, 100]')
    return search(
        load(scenario, settings, **values),
        [f'{name}={text}' for name, text in ranges.items()],
        [f'{name}={text}' for name, text in (draw or {}).items()],
        runs=whole('runs', runs, 1),
        objectives=objectives,
        percentile=percentile,
        evaluations=whole('evaluations', evaluations, 1),
        seed=whole('seed', seed),
        sobol=sobol,
        threads=whole('threads', threads),
        device=device,
    )


def search(
    scenario: Scenario,
    ranges: Sequence[str],
    draws: Sequence[str],
    *,
    runs: int,
    objectives: Sequence[str],
    percentile: float,
    evaluations: int,
    seed: int,
    sobol: bool,
    threads: int,
    device: str,
) -> TunedScenario:
    """Search gains as `tune` does, with ranges and draws as texts NAME=VALUE of the command."""
    base = BaseFile.read(scenario.file, scenario.settings)
    drawn = [parsed_draw(text) for text in draws]
    campaign = campaign_of(
        scenario.file, scenario.settings, draws=drawn, repeats=runs if drawn else 1, seed=seed,
        sobol=sobol,
    )  # fmt: skip
    searches = [searched(text) for text in ranges]
    variables = variables_of(campaign, searches)
    if not ranges:
        raise InputError(f'--tune: no parameter to search; expected {FORM}')
    if isinstance(objectives, str) or len(objectives) != 2:
        count = 1 if isinstance(objectives, str) else len(objectives)
        raise InputError(f'--objective: {count} given; expected two')
    first, second = (metric_named(campaign, name, '--objective') for name in objectives)
    open_device = device_option(device)
    evaluate = Evaluation(
        list(campaign.runs(0, campaign.total)),
        campaign.most_lanes,
        variables,
        (first, second),
        percentile,
        threads or processors(),
        open_device() if open_device else None,
    )
    with tqdm(total=evaluations, unit='candidate', disable=None) as progress:
        result = tuned(
            evaluate, searches, evaluations=evaluations, seed=seed, advance=progress.update
        )
    return TunedScenario(scenario, tuple(variables), (first, second), result, base)
