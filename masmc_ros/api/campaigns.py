# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Campaigns and comparisons of laws, whose rows are returned as Arrow tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
import warnings

from masmc_ros.api.scenario import load, Scenario, whole
from masmc_ros.campaign.campaign import Campaign, campaign_of
from masmc_ros.campaign.engine import carry_out
from masmc_ros.campaign.runs import CPU, OpenDevice
from masmc_ros.campaign.variable import axis
from masmc_ros.campaign.variable import draw as parsed_draw
from masmc_ros.compare.contenders import Controller
from masmc_ros.compare.law_comparison import compared, comparison_of
from masmc_ros.compare.tables import rows_of
from masmc_ros.errors import InputError
from masmc_ros.native.device import device_option
from masmc_ros.params.declaration import Values
from masmc_ros.params.text import yaml_text
import pyarrow as pa
from tqdm import tqdm


def sweep(
    scenario: str | Path | Scenario,
    vary: Mapping[str, str | Sequence[object]],
    *,
    draw: Mapping[str, str] | None = None,
    runs: int = 1,
    seed: int = 0,
    sobol: bool = False,
    settings: Values | None = None,
    output: str | Path | None = None,
    threads: int = 0,
    scheduler: str = '',
    device: str = CPU,
    **values: object,
) -> pa.Table:
    """
    Run a scenario at all points of a grid, as `masmc sweep` does.

    Parameters
    ----------
    scenario, settings, values
        As in `load`.
    vary
        Values of each axis by name: a list, or a text LOW:HIGH:COUNT or LOW:HIGH:COUNT:log.
    draw
        Distributions by name: `{'plant.robot.link_2_mass': 'uniform:0.6:1.4'}`.
    runs
        Number of runs at each point.
    seed
        Seed of the draws.
    sobol
        True if the draws are points of a Sobol sequence.
    output
        Folder of the dataset, which an interrupted campaign continues; None: no files remain.
    threads
        Number of threads; 0: one for each processor.
    scheduler
        Address of a Dask scheduler, which has priority over threads.
    device
        `cpu`, or `cuda` for a GPU, here or of each worker.

    Returns
    -------
        Table with a row for each run: values, metrics in SI units, and `lost`.

    Warns
    -----
    UserWarning
        if most runs are computed alone, which takes longer.

    Raises
    ------
    InputError
        if a name is unknown or a value out of range, if the folder has rows of another campaign,
        or if no scheduler answers.

    """
    loaded = load(scenario, settings, **values)
    campaign = campaign_of(
        loaded.file,
        loaded.settings,
        axes=[axis(f'{name}={_text(name, entries)}') for name, entries in vary.items()],
        draws=[parsed_draw(f'{name}={text}') for name, text in (draw or {}).items()],
        repeats=whole('runs', runs, 1),
        seed=whole('seed', seed),
        sobol=sobol,
    )
    return _table(campaign, output, threads, scheduler, device_option(device))


def monte_carlo(
    scenario: str | Path | Scenario,
    draw: Mapping[str, str],
    *,
    runs: int = 1000,
    seed: int = 0,
    sobol: bool = False,
    settings: Values | None = None,
    output: str | Path | None = None,
    threads: int = 0,
    scheduler: str = '',
    device: str = CPU,
    **values: object,
) -> pa.Table:
    """
    Run a scenario with random parameters, as `masmc monte-carlo` does.

    Parameters
    ----------
    draw
        Distributions by name: `{'plant.robot.link_2_mass': 'uniform:0.6:1.4'}`.
    runs
        Number of runs.
    scenario, seed, sobol, settings, output, threads, scheduler, device, values
        As for `sweep`.

    Returns
    -------
        Table with a row for each run.

    Raises
    ------
    InputError
        as `sweep`.

    """
    return sweep(
        scenario, {}, draw=draw, runs=runs, seed=seed, sobol=sobol, settings=settings,
        output=output, threads=threads, scheduler=scheduler, device=device, **values,
    )  # fmt: skip


def _text(name: str, entries: str | Sequence[object]) -> str:
    if isinstance(entries, str):
        return entries
    if not isinstance(entries, Iterable):
        raise InputError(f'vary: {name} = {entries!r}: expected a list of values, or a text')
    return ','.join(map(yaml_text, entries))


def _table(
    campaign: Campaign,
    output: str | Path | None,
    threads: int,
    scheduler: str,
    device: OpenDevice | None,
) -> pa.Table:
    threads = whole('threads', threads)
    if campaign.notice:
        warnings.warn(campaign.notice, stacklevel=3)
    progress = tqdm(total=campaign.total, unit='run', disable=None)
    with TemporaryDirectory() as temporary, progress:
        dataset = carry_out(
            campaign, Path(output or temporary), threads=threads, scheduler=scheduler,
            device=device, advance=progress.update,
        )  # fmt: skip
        return dataset.table()


def compare_laws(
    scenario: str | Path | Scenario = 'paper',
    laws: str | Sequence[str] = 'all',
    *,
    trials: str | Sequence[str] = 'all',
    seeds: int = 1,
    controllers: Mapping[str, Controller] | None = None,
    threads: int = 0,
    scheduler: str = '',
    settings: Values | None = None,
    **values: object,
) -> pa.Table:
    """
    Run laws on the same scenario and seeds, as `masmc compare` does.

    Parameters
    ----------
    scenario, settings, values
        As in `load`.
    laws
        Names LAW or LAW:SWITCHING, or 'all'.
    trials
        Trials in addition to the unmodified scenario, or 'all', 'laws' or 'hardware'.
    seeds
        Number of runs of each law and trial: seed 0 is the scenario itself, others have a random
        robot, disturbance and noise.
    controllers
        Functions of (state, reference) that return torques in N·m, or classes of such objects, by
        the name in the table; state is a `TickInput`.
    threads, scheduler
        As for `sweep`.

    Returns
    -------
        A row for each law and trial, the smallest error first, SI units.

    Raises
    ------
    InputError
        if a name is unknown or a value out of range, if the scenario commands velocities, or if
        no scheduler answers.

    """
    loaded = load(scenario, settings, **values)
    comparison = comparison_of(
        loaded.file, loaded.settings, _names(laws), _names(trials), whole('seeds', seeds, 1),
        controllers,
    )  # fmt: skip
    ranked = compared(comparison, threads=whole('threads', threads), scheduler=scheduler)
    return pa.Table.from_pylist(rows_of(ranked, comparison.trials))


def _names(names: str | Sequence[str]) -> str:
    return names if isinstance(names, str) else ','.join(names)
