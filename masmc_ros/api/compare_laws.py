# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Comparison of laws, whose rows are returned as an Arrow table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from masmc_ros.api.scenario import load, Scenario, whole
from masmc_ros.compare.foreign import Controller
from masmc_ros.compare.law_comparison import comparison_of
from masmc_ros.compare.ranking import compared
from masmc_ros.compare.tables import rows_of
from masmc_ros.params.declaration import Values
import pyarrow as pa


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
        loaded.file, loaded.settings, _text(laws), _text(trials), whole('seeds', seeds, 1),
        controllers,
    )  # fmt: skip
    ranked = compared(comparison, threads=whole('threads', threads), scheduler=scheduler)
    return pa.Table.from_pylist(rows_of(ranked, comparison.trials))


def _text(names: str | Sequence[str]) -> str:
    return names if isinstance(names, str) else ','.join(names)
