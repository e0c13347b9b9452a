# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Comparison of laws."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

from masmc_ros.api.scenario import load, Scenario
from masmc_ros.compare.campaign import outcomes
from masmc_ros.compare.ranking import ranking
from masmc_ros.compare.tables import rows_of
from masmc_ros.compare.tasks import tasks_of
from masmc_ros.params.declaration import Values
import pyarrow as pa
from tqdm import tqdm


def compare_laws(
    scenario: str | Scenario = 'paper',
    laws: str | Sequence[str] = 'all',
    *,
    trials: str | Sequence[str] = 'all',
    seeds: int = 1,
    settings: Values | None = None,
    **values: object,
) -> pa.Table:
    """
    Run laws on the same scenario and seeds, as `masmc compare` does.

    Parameters
    ----------
    scenario, settings, values
        as in `load`.
    laws
        LAW or LAW:SWITCHING, or 'all'.
    trials
        trials in addition to the unmodified scenario, or 'all', 'laws' or 'hardware'.
    seeds
        runs of each: seed 0 is the scenario; others draw robot, disturbance and noise.

    Returns
    -------
        A row for each law and trial, the smallest error first, SI units.

    Raises
    ------
    InputError
        If a name is unknown, a value out of range, or the scenario commands velocities.

    """
    loaded = load(scenario, settings, **values)
    tasks = tasks_of(
        loaded.file, loaded.settings, loaded.values, _text(laws), _text(trials), seeds
    )
    done = tqdm(outcomes(tasks), total=len(tasks), unit='law', disable=None)
    ranked = ranking(chain.from_iterable(done), tasks[0].trials[0].name)
    return pa.Table.from_pylist(rows_of(ranked, tasks[0].trials))


def _text(names: str | Sequence[str]) -> str:
    return names if isinstance(names, str) else ','.join(names)
