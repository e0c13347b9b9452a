# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Campaigns whose rows are returned as Arrow tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from masmc_ros.api.settings import settings_of
from masmc_ros.campaign.axes import axis
from masmc_ros.campaign.campaign import Campaign, campaign_of
from masmc_ros.campaign.draws import draw as parsed_draw
from masmc_ros.campaign.engine import carry_out
from masmc_ros.params.declaration import Values
from masmc_ros.params.text import yaml_text
from masmc_ros.share import scenario_file
import pyarrow as pa
from tqdm import tqdm


def sweep(
    scenario: str,
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
    **values: object,
) -> pa.Table:
    """
    Run a scenario at all points of a grid, as `masmc sweep` does.

    Parameters
    ----------
    scenario
        parameter file, or name of an installed one.
    vary
        values of each axis: a list, or LOW:HIGH:COUNT or LOW:HIGH:COUNT:log.
    draw
        distributions by name: `{'plant.robot.link_2_mass': 'uniform:0.6:1.4'}`.
    runs
        runs at each point.
    seed
        seed of the draws.
    sobol
        whether the draws are points of a Sobol sequence.
    settings, values
        as in `simulate`.
    output
        folder of the dataset, which an interrupted campaign continues; None: no files.
    threads
        number of threads; 0: one for each processor.
    scheduler
        address of a Dask scheduler.

    Returns
    -------
        A row for each run.

    Raises
    ------
    InputError
        If a name is unknown or a value out of range.

    """
    file = scenario_file(scenario)
    campaign = campaign_of(
        file,
        settings_of(file, settings, values),
        axes=[axis(f'{name}={_text(entries)}') for name, entries in vary.items()],
        draws=[parsed_draw(f'{name}={text}') for name, text in (draw or {}).items()],
        repeats=runs,
        seed=seed,
        sobol=sobol,
    )
    return _table(campaign, output, threads, scheduler)


def monte_carlo(
    scenario: str,
    draw: Mapping[str, str],
    *,
    runs: int = 1000,
    seed: int = 0,
    sobol: bool = False,
    settings: Values | None = None,
    output: str | Path | None = None,
    threads: int = 0,
    scheduler: str = '',
    **values: object,
) -> pa.Table:
    """Run a scenario with random parameters, as `masmc monte-carlo` does; see `sweep`."""
    return sweep(
        scenario, {}, draw=draw, runs=runs, seed=seed, sobol=sobol, settings=settings,
        output=output, threads=threads, scheduler=scheduler, **values,
    )  # fmt: skip


def _text(entries: str | Sequence[object]) -> str:
    return entries if isinstance(entries, str) else ','.join(map(yaml_text, entries))


def _table(
    campaign: Campaign, output: str | Path | None, threads: int, scheduler: str
) -> pa.Table:
    progress = tqdm(total=campaign.total, unit='run', disable=None)
    with TemporaryDirectory() as temporary, progress:
        dataset = carry_out(
            campaign, Path(output or temporary), threads=threads, scheduler=scheduler,
            advance=progress.update,
        )  # fmt: skip
        return dataset.table()
