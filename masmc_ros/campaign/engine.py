# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Computation of the runs of a campaign, here or on a cluster."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from masmc_ros.campaign.campaign import Campaign
from masmc_ros.campaign.runs import Description, OpenDevice, Part, Rows, rows_in_threads
from masmc_ros.child_process import processors
from masmc_ros.errors import InputError
from masmc_ros.files import check_folder

if TYPE_CHECKING:
    from masmc_ros.campaign.dataset import Dataset

LARGEST_PART = 512
"""Number of runs of a part: some seconds of one processor."""

_PARTS = 8
"""Number of parts of each processor of a small campaign."""

_PREPARING = 2
"""Threads of a device: one prepares a part, while the device computes that of the other one."""

_PART_OF_WORKER = 2**15
"""Number of runs of a part for a device of another machine."""


def part_size(campaign: Description, workers: int) -> int:
    """Return the number of runs of a part: a multiple of the lanes."""
    batches = -(-campaign.total // (workers * _PARTS * campaign.lanes))
    return min(LARGEST_PART, campaign.lanes * max(1, batches))


def computed(
    campaign: Description,
    parts: Callable[[int], Iterable[Part]],
    *,
    threads: int = 0,
    scheduler: str = '',
    device: OpenDevice | None = None,
) -> Generator[Rows, None, None]:
    """
    Yield the rows of parts in the order of completion.

    Parameters
    ----------
    campaign
        Campaign.
    parts
        Function that returns the parts to compute, for a largest number of runs in a part.
    threads
        Number of threads; 0: one for each processor.
    scheduler
        Address of a Dask scheduler, which has priority over threads.
    device
        Function that opens the device that computes, here or on a worker; None for processors.

    Raises
    ------
    InputError
        if no scheduler answers, if a node would reject the values of a run, or if a device is
        missing or cannot compute the runs.

    """
    if scheduler:
        # Dask is optional, and its import takes time.
        from masmc_ros.campaign.dask import Cluster

        with Cluster(scheduler) as cluster:
            size = part_size(campaign, cluster.workers) if device is None else _PART_OF_WORKER
            yield from cluster.computed(campaign, parts(size), device)
    elif device is not None:
        here = device()
        yield from rows_in_threads(
            campaign, parts(here.most_runs), threads or _PREPARING, here
        )
    else:
        workers = threads or processors()
        yield from rows_in_threads(
            campaign, parts(part_size(campaign, workers)), workers
        )


def carry_out(
    campaign: Campaign,
    folder: Path,
    *,
    threads: int = 0,
    scheduler: str = '',
    device: OpenDevice | None = None,
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
    threads, scheduler, device
        As for `computed`.
    advance
        Called with the number of newly completed runs, first with those of an earlier start.

    Returns
    -------
        Dataset with all runs.

    Raises
    ------
    InputError
        if the folder has rows of another campaign, if another process writes to it, if each run
        would be a batch of a device, and as `computed`.

    """
    if device is not None and campaign.notice:
        raise InputError(f'{campaign.notice}; or device cpu')
    # pyarrow is optional.
    from masmc_ros.campaign.dataset import Dataset, reserved

    check_folder(folder)
    with reserved(folder):
        dataset = Dataset(folder, campaign)
        advance(dataset.done)
        if dataset.done < campaign.total:
            # Only this process writes the dataset.
            with closing(
                computed(
                    campaign, dataset.missing, threads=threads, scheduler=scheduler, device=device
                )
            ) as results:
                for rows in results:
                    dataset.write(rows)
                    advance(len(rows['run']))
    return dataset
