# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Computation of the missing runs of a campaign, here or on a cluster."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import closing
from pathlib import Path

from masmc_ros.campaign.campaign import Campaign
from masmc_ros.campaign.dataset import Dataset
from masmc_ros.campaign.part import LANES, Rows
from masmc_ros.campaign.threads import computed, processors
from masmc_ros.report.files import check_folder

LARGEST_PART = 512
"""Number of runs of a file: some seconds of one processor."""

_PARTS = 8
"""Number of parts of each processor of a small campaign."""


def part_size(total: int, workers: int) -> int:
    """Return the number of runs of a part: a multiple of LANES."""
    batches = -(-total // (workers * _PARTS * LANES))
    return min(LARGEST_PART, LANES * max(1, batches))


def carry_out(
    campaign: Campaign,
    folder: Path,
    *,
    threads: int = 0,
    scheduler: str = '',
    advance: Callable[[int], object] = lambda _: None,
) -> Dataset:
    """
    Compute the runs of a campaign that the dataset in a folder does not have, and write them.

    Parameters
    ----------
    campaign
        Campaign.
    folder
        Folder of the dataset; it is created if it is missing.
    threads
        Number of threads; 0: one for each processor.
    scheduler
        Address of a Dask scheduler, which has priority over threads.
    advance
        Called with numbers of runs that are done, first with those of an earlier start.

    Returns
    -------
        Dataset with all runs.

    Raises
    ------
    InputError
        if the folder has rows of another campaign, if no scheduler answers, or if a node would
        reject the values of a run.

    """
    check_folder(folder)
    dataset = Dataset(folder, campaign)
    advance(dataset.done)
    if dataset.done == campaign.total:
        return dataset
    if scheduler:
        # The import takes time and needs a package of its own.
        from masmc_ros.campaign.dask import Cluster

        with Cluster(scheduler) as cluster:
            parts = dataset.missing(part_size(campaign.total, cluster.workers))
            _write(dataset, cluster.computed(campaign, parts), advance)
    else:
        workers = threads or processors()
        parts = dataset.missing(part_size(campaign.total, workers))
        _write(dataset, computed(campaign, parts, workers), advance)
    return dataset


def _write(
    dataset: Dataset, results: Generator[Rows, None, None], advance: Callable[[int], object]
) -> None:
    """Write the rows of all parts, in this process alone."""
    with closing(results):
        for rows in results:
            dataset.write(rows)
            advance(len(rows['run']))
