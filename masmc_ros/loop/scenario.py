# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Scenario: the values of the parameters of all nodes of a run, and their origin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
import shlex

from masmc_ros.params.declaration import Values
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.robot.robot import Robot, robot_of

_SIMULATED = ('plant', 'trajectory', 'controller')


@dataclass(frozen=True, repr=False)
class Scenario:
    """
    Checked values of the parameters of each node of a run.

    Attributes
    ----------
    plant, trajectory, controller
        Values by name, of the nodes that a simulation replaces.
    others
        Those of further nodes, such as the recorder, by node.
    file
        Path of the parameter file or log; '' if unknown.
    settings
        NAME=VALUE, as in `--set`, that replace values of the file.

    """

    plant: Values
    trajectory: Values
    controller: Values
    others: Mapping[str, Values] = field(default_factory=dict)
    file: str = field(default='', compare=False)
    settings: tuple[str, ...] = field(default=(), compare=False)

    @classmethod
    def of(
        cls, nodes: Mapping[str, Values], file: str = '', settings: tuple[str, ...] = ()
    ) -> Scenario:
        """Return the scenario of values by node; `file` and `settings` as in the attributes."""
        plant, trajectory, controller = (nodes[node] for node in _SIMULATED)
        others = {node: own for node, own in nodes.items() if node not in _SIMULATED}
        return cls(plant, trajectory, controller, others, file, settings)

    def __getitem__(self, node: str) -> Values:
        """Return the values of a node by its name; KeyError for a missing one."""
        values: Values = getattr(self, node) if node in _SIMULATED else self.others[node]
        return values

    @property
    def values(self) -> dict[str, Values]:
        """Return the values by node."""
        return {**{node: getattr(self, node) for node in _SIMULATED}, **self.others}

    @property
    def mechanism(self) -> Mechanism:
        """Return the type of the robot."""
        return mechanism_from(self.plant)

    @property
    def robot(self) -> Robot:
        """Return the robot of the plant, with its true masses."""
        return robot_of(self.plant)

    def with_nodes(self, nodes: Mapping[str, Values]) -> Scenario:
        """Return the scenario with other values of some nodes, by node."""
        return Scenario.of({**self.values, **nodes}, self.file, self.settings)

    def __repr__(self) -> str:
        """Return the arguments of `masmc simulate` for the scenario."""
        settings = (f'--set {shlex.quote(text)}' for text in self.settings)
        return ' '.join([shlex.quote(self.file), *settings])
