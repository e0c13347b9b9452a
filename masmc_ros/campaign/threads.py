# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parts of a campaign on all processors of this machine, in threads of one process."""

from __future__ import annotations

from collections.abc import Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from itertools import islice
from threading import Event

from masmc_ros.campaign.part import Device, Rows, rows
from masmc_ros.campaign.runs import Description

Part = tuple[int, int]
"""First run and number of runs."""


def computed(
    campaign: Description, parts: Iterable[Part], threads: int, device: Device | None = None
) -> Generator[Rows, None, None]:
    """
    Yield the rows of parts in the order of completion.

    Kernels release Python's lock. If the caller closes the generator early, the threads end
    after their current batch.

    Parameters
    ----------
    campaign
        Campaign.
    parts
        First run and number of runs of each part.
    threads
        Number of threads.
    device
        Device that computes the runs which the threads prepare; None: the threads compute them.

    """
    stop, waiting = Event(), iter(parts)
    running: set[Future[Rows]] = set()
    with ThreadPoolExecutor(threads) as pool:
        try:
            while True:
                for part in islice(waiting, threads + 1 - len(running)):
                    running.add(pool.submit(rows, campaign, *part, stop.is_set, device))
                if not running:
                    return
                done, running = wait(running, return_when=FIRST_COMPLETED)
                for future in done:
                    yield future.result()
        finally:
            stop.set()
            for future in running:
                future.cancel()
