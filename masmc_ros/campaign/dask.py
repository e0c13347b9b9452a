# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Parts of a campaign on the workers of a Dask cluster.

A worker has no state: it receives the description of the campaign as text and returns rows. The
scheduler gives the parts of a worker that has died to another one.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable
from concurrent.futures import CancelledError
from importlib.metadata import version
from itertools import islice
import platform
from types import TracebackType

from distributed import as_completed, Client, Future
from distributed.comm import CommClosedError
from distributed.scheduler import KilledWorker
from masmc_ros import __version__
from masmc_ros.campaign.runs import Description, OpenDevice, Part, Rows, rows_of_text
from masmc_ros.errors import InputError

_TIMEOUT = '10s'
_AHEAD = 2
"""Parts that are submitted for each thread of the workers: one runs, the next one waits."""

_PACKAGES = ('numpy', 'numba', 'scipy')


def versions() -> dict[str, str]:
    """Return the versions on which the rows depend and that a worker must have as well."""
    return {'masmc_ros': __version__, **{name: version(name) for name in _PACKAGES}}


class Cluster:
    """Connection to a Dask scheduler."""

    def __init__(self, address: str) -> None:
        """
        Connect to a scheduler.

        Raises InputError if no scheduler answers, if it has no workers, or if a worker has other
        versions.
        """
        try:
            self._client = Client(address, timeout=_TIMEOUT, set_as_default=False)
        except (OSError, ValueError) as error:
            reason = str(error) or type(error).__name__
            raise InputError(
                f'--scheduler {address}: no Dask scheduler answers ({reason}); start one with dask'
                ' scheduler'
            ) from None
        try:
            self.workers = self._threads(address)
        except BaseException:
            self._client.close()
            raise

    def __enter__(self) -> Cluster:
        """Return the connection."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the connection; the workers stop the parts of this campaign."""
        self._client.close()

    def _threads(self, address: str) -> int:
        """Return the number of threads of all workers, after a check of their versions."""
        place = f'--scheduler {address}'
        threads: dict[str, int] = self._client.nthreads()
        if not threads:
            raise InputError(f'{place}: no workers; start one with dask worker {address}')
        own = versions()
        try:
            answers: dict[str, dict[str, str]] = self._client.run(versions)
        except Exception as error:  # a worker without this package can raise anything
            raise InputError(
                f'{place}: a worker cannot import masmc_ros ({error}); install masmc_ros'
                f' {__version__} on all workers'
            ) from None
        for worker, answer in answers.items():
            for name, expected in own.items():
                if answer[name] != expected:
                    raise InputError(
                        f'{place}: worker {worker} has {name} {answer[name]}; expected {expected},'
                        f' as on {platform.node()}'
                    )
        return sum(threads.values())

    def computed(
        self, campaign: Description, parts: Iterable[Part], device: OpenDevice | None = None
    ) -> Generator[Rows, None, None]:
        """
        Yield the rows of parts (first run, number of runs) in the order of completion.

        `device` opens the device of each worker.

        Raises InputError if a part kills several workers, or if the scheduler ends.
        """
        waiting, client = iter(parts), self._client

        def submitted(count: int) -> list[Future]:
            return [
                client.submit(
                    rows_of_text,
                    type(campaign),
                    campaign.text,
                    *part,
                    device,
                    key=f'masmc-{campaign.key}-{part[0]}-{part[1]}',
                    pure=False,
                )
                for part in islice(waiting, count)
            ]

        running = as_completed(submitted(_AHEAD * self.workers), loop=client.loop)
        for future in running:
            try:
                rows: Rows = future.result()
            except KilledWorker as error:
                raise InputError(
                    f'a part of the campaign has killed several workers: {error}; expected enough '
                    'memory on each worker'
                ) from None
            except (CancelledError, CommClosedError) as error:
                raise InputError(
                    f'the connection to the Dask scheduler was lost ({error}); expected one that '
                    'runs until the end'
                ) from None
            running.update(submitted(1))
            yield rows
