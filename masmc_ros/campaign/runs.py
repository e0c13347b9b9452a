# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Descriptions of runs, and the run of each number."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
import hashlib
from typing import Self

from masmc_ros import __version__
from masmc_ros.campaign.variable import Variable
from masmc_ros.jit.record import AT_RUN_TIME
from masmc_ros.log.write.provenance import git_state
from masmc_ros.loop.scenario import Scenario
from masmc_ros.params.declaration import check_all, MutableValues, Values
from masmc_ros.robot.declaration import Mechanism, URDF
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.scenario.node_parameters import declared
from masmc_ros.scenario.scenario import load_scenario

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
