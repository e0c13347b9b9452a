# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Runs of a campaign: their descriptions, the run of each number, and the rows of parts.

The rows of a part are a pure function of the campaign and the numbers of the runs. Runs of equal
law, timing and path are computed in lanes. Every lane is bitwise identical to the run alone, so
the rows do not depend on the size of parts or on the order. `rows_in_threads` computes many parts
on all processors of this machine.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import cached_property, lru_cache
import hashlib
from itertools import islice
from threading import Event
from typing import Any, Protocol, Self

from masmc_ros import __version__
from masmc_ros.campaign.variable import Variable
from masmc_ros.errors import InputError
from masmc_ros.jit.record import AT_RUN_TIME
from masmc_ros.law import registry
from masmc_ros.law.law import Law
from masmc_ros.law.registry import LAW
from masmc_ros.log.write.provenance import git_state
from masmc_ros.loop.batch_simulation import keys_of
from masmc_ros.loop.plant_parameters import PHYSICS, RIGID, SEED
from masmc_ros.loop.scenario import Scenario
from masmc_ros.params.declaration import check_all, MutableValues, Values
from masmc_ros.report.measure.metrics import Metrics, Reached
from masmc_ros.report.measure.reduced import reduced_metrics, simulated_metrics
from masmc_ros.report.measure.table import Column, columns
from masmc_ros.robot.declaration import Mechanism, URDF
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.scenario.node_parameters import declared
from masmc_ros.scenario.scenario import load_scenario
import numpy as np

NODES = ('plant', 'trajectory', 'controller')
"""Nodes of a simulated run."""

LANES = 16
"""Number of parallel runs in one array; it fills the widest vector registers twice."""

WORTH_LANES = 4 * LANES
"""Smallest number of runs for which compiling a kernel for lanes saves time."""

FEWEST_ALIKE = 3
"""Smallest mean number of runs of equal law, timing and path for which a batch saves time."""


@dataclass(frozen=True)
class Run:
    """
    A run of a campaign.

    Attributes
    ----------
    number
        Number of the run, from 0.
    values
        Values of the variables by name: those of the axes, then drawn ones.
    scenario
        Scenario of the run.

    """

    number: int
    values: MutableValues
    scenario: Scenario


class Description(ABC):
    """
    Description of runs, from which every thread, process and machine computes the same rows.

    Attributes
    ----------
    scenario
        Scenario of NODES that all runs start from. A URDF is its text, not its path.

    """

    scenario: Scenario

    @property
    @abstractmethod
    def total(self) -> int:
        """Return the number of runs."""

    @property
    @abstractmethod
    def lanes(self) -> int:
        """Return the number of lanes: runs that are computed in one array."""

    @cached_property
    def mechanism(self) -> Mechanism:
        """Return the type of the robot."""
        return self.scenario.mechanism

    @cached_property
    def most_lanes(self) -> int:
        """Return the largest useful number of lanes; code of trees does not vectorise, so 1."""
        return 1 if AT_RUN_TIME in self.mechanism.sizes else LANES

    @cached_property
    def variables(self) -> tuple[Variable, ...]:
        """Return the parameters that have a column in the rows."""
        return ()

    @property
    @abstractmethod
    def text(self) -> str:
        """Return the description as JSON, from which `from_text` restores it."""

    @classmethod
    @abstractmethod
    def from_text(cls, text: str) -> Self:
        """Return the description of a JSON text."""

    @cached_property
    def key(self) -> str:
        """Return the digest of the description and of the code."""
        content = f'{self.text} {__version__} {git_state()}'
        return hashlib.sha256(content.encode()).hexdigest()[:16]

    @abstractmethod
    def runs(self, first: int, count: int) -> Iterator[Run]:
        """
        Yield the runs `first` to `first + count - 1`.

        Raises InputError for values that a node would reject.
        """

    def parts(self, size: int) -> Iterator[tuple[int, int]]:
        """Yield first run and number of runs of parts with at most `size` runs."""
        for first in range(0, self.total, size):
            yield first, min(size, self.total - first)


def scenario_of(file: str, settings: Sequence[str]) -> Scenario:
    """Return the scenario of NODES of a parameter file, with the text of its URDF."""
    scenario = load_scenario(file, settings)
    urdf = scenario.plant.get(URDF)
    nodes = {node: scenario[node] for node in NODES}
    if urdf:
        from masmc_ros.robot.tree.tree_mechanism import described

        text = described(urdf)[0]
        nodes = {node: {**values, URDF: text} for node, values in nodes.items()}
    return Scenario.of(nodes, file, scenario.settings)


def checked_scenario(values: Mapping[str, Values]) -> Scenario:
    """Return the scenario of NODES whose values by node were read from JSON."""
    mechanism = mechanism_from(values['plant'])
    nodes = {node: check_all(declared(node, mechanism), values[node]) for node in NODES}
    return Scenario.of(nodes)


Rows = dict[str, Any]
"""Columns by name: arrays of equal length."""


CPU = 'cpu'
"""Name of this processor among the devices."""


class StoppedError(Exception):
    """Raised if the computation was stopped between two batches."""


class Device(Protocol):
    """
    Device that computes many runs at once, in place of this processor.

    Attributes
    ----------
    most_runs
        Number of runs that fill it.

    """

    most_runs: int

    def metrics(
        self, runs: Sequence[Scenario], is_stopped: Callable[[], bool]
    ) -> list[Metrics | float] | None:
        """Return the results of `evaluated` for runs of one batch; None if stopped."""

    def check(self, run: Scenario) -> None:
        """Raise InputError for a run with invalid values."""

    def check_plant(self, plant: Values) -> None:
        """Raise InputError for a robot or a plant that it does not compute."""


OpenDevice = Callable[[], Device]
"""Function that opens a device in the process that computes; InputError if it is missing."""


def metric_columns(mechanism: Mechanism) -> list[Column]:
    """Return the metrics of the rows of a campaign with a robot."""
    return [column for column in _all_columns(mechanism) if column.is_of_campaigns]


def missing_columns(mechanism: Mechanism) -> list[Column]:
    """Return the metrics of reports that campaigns do not compute."""
    return [column for column in _all_columns(mechanism) if not column.is_of_campaigns]


def _all_columns(mechanism: Mechanism) -> list[Column]:
    return columns([Metrics(0.0, 0.0, {point: Reached() for point in mechanism.points}, 0)])


def rows(
    campaign: Description,
    first: int,
    count: int,
    is_stopped: Callable[[], bool] = lambda: False,
    device: Device | None = None,
) -> Rows:
    """
    Compute runs `first` to `first + count - 1`.

    Parameters
    ----------
    campaign
        Campaign.
    first, count
        Number of the first run, and number of runs.
    is_stopped
        Called between two batches; True stops the computation.
    device
        Device that computes the runs; None for this processor.

    Returns
    -------
        Columns (count) by name: `run`, `seed`, the varied and drawn values, the metrics in SI
        units, `lost`, and `lost_at` in s. Metrics are NaN for lost runs, `lost_at` for others
        and if the time is unknown.

    Raises
    ------
    StoppedError
        if `is_stopped` returned True.
    InputError
        if a node would reject the values of a run.

    """
    runs = list(campaign.runs(first, count))
    results = evaluated(runs, campaign.lanes, is_stopped, device)
    return {
        'run': np.array([run.number for run in runs]),
        'seed': np.array([SEED.of(run.scenario.plant) for run in runs]),
        **{v.name: v.column([run.values[v.name] for run in runs]) for v in campaign.variables},
        **{
            column.name: np.array([_number(column, result) for result in results], np.float64)
            for column in metric_columns(campaign.mechanism)
        },
        'lost': np.array([isinstance(result, float) for result in results]),
        'lost_at': np.array([r if isinstance(r, float) else np.nan for r in results]),
    }


def evaluated(
    runs: Sequence[Run],
    lanes: int,
    is_stopped: Callable[[], bool] = lambda: False,
    device: Device | None = None,
) -> list[Metrics | float]:
    """
    Return the metrics of each run, or the time in s at which it diverged, NaN if unknown.

    Parameters
    ----------
    runs
        Runs; those that differ in law, timing or path are in separate batches.
    lanes
        Number of runs of a batch.
    is_stopped
        Called between two batches; True raises StoppedError.
    device
        Device that computes the runs, as many at once as it wants; None for this processor.

    """
    groups: dict[tuple[object, ...], list[int]] = {}
    for place, key in enumerate(keys_of([run.scenario for run in runs])):
        groups.setdefault(key, []).append(place)
    if device is not None:
        lanes = device.most_runs
    elif len(groups) > 1 and len(runs) < FEWEST_ALIKE * len(groups):
        # A batch takes as long as some runs alone, also if most of its lanes are copies.
        lanes = 1
    results: list[Metrics | float] = [np.nan] * len(runs)
    for group in groups.values():
        for start in range(0, len(group), lanes):
            if is_stopped():
                raise StoppedError
            places = group[start:start + lanes]
            alike = [runs[place] for place in places]
            batch = (
                _computed(alike, lanes)
                if device is None
                else _computed_on(device, alike, is_stopped)
            )
            for place, result in zip(places, batch, strict=False):
                results[place] = result
    return results


@lru_cache(maxsize=4)
def _described(kind: type[Description], text: str) -> Description:
    return kind.from_text(text)


def rows_of_text(
    kind: type[Description],
    text: str,
    first: int,
    count: int,
    open_device: OpenDevice | None = None,
) -> Rows:
    """Compute `rows` of a description as its JSON text, for another process."""
    device = open_device() if open_device else None
    return rows(_described(kind, text), first, count, device=device)


def _computed(batch: Sequence[Run], lanes: int) -> list[Metrics | float]:
    """Return the metrics of the runs of a batch; the last run fills the remaining lanes."""
    scenarios = [run.scenario for run in batch]
    # Neither wheels in contact nor laws in plain Python have lanes.
    is_compiled = isinstance(registry.load(LAW.of(scenarios[0].controller)), Law)
    if not is_compiled or PHYSICS.of(scenarios[0].plant) != RIGID:
        return [simulated_metrics(scenario) for scenario in scenarios]
    try:
        return reduced_metrics([*scenarios, *scenarios[-1:] * (lanes - len(batch))])
    except InputError as error:
        if len(batch) == 1:
            raise InputError(f'run {batch[0].number}: {error}') from None
        # Compute the runs alone, which raises the error of the invalid one with its number.
        for run in batch:
            _computed([run], lanes)
        raise


def _computed_on(
    device: Device, batch: Sequence[Run], is_stopped: Callable[[], bool]
) -> list[Metrics | float]:
    """Return the metrics of the runs of a batch on a device."""
    device.check_plant(batch[0].scenario.plant)
    try:
        results = device.metrics([run.scenario for run in batch], is_stopped)
    except InputError:
        # Find the run with an invalid value.
        for run in batch:
            try:
                device.check(run.scenario)
            except InputError as error:
                raise InputError(f'run {run.number}: {error}') from None
        raise
    if results is None:
        raise StoppedError
    return results


def _number(column: Column, result: Metrics | float) -> float:
    """Return a metric; NaN for a lost run, and for missing data."""
    value = None if isinstance(result, float) else column.value(result)
    return np.nan if value is None else value


Part = tuple[int, int]
"""First run and number of runs."""


def rows_in_threads(
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
