# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""ROS parameter file of tuned values: the file of the scenario, and further blocks below it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from masmc_ros.campaign.variable import Variable, with_variables
from masmc_ros.errors import InputError
from masmc_ros.loop.scenario import Scenario
from masmc_ros.params.blocks import read_blocks
from masmc_ros.params.declaration import Values
from masmc_ros.params.file import anywhere
from masmc_ros.scenario.node_parameters import NODES
from masmc_ros.scenario.scenario import load_scenario, source_of
import yaml

_BLOCK = '/**/plant: {ros__parameters: {duration: 1.0}}'


class BaseFile(NamedTuple):
    """
    Parameter file of a scenario when a search starts; later changes of the file have no effect.

    Attributes
    ----------
    text
        Content of the file.
    original
        Scenario of the file.
    scenario
        The same with the settings.

    """

    text: str
    original: Scenario
    scenario: Scenario

    @classmethod
    def read(cls, file: str, settings: Sequence[str]) -> BaseFile:
        """
        Read a parameter file, with settings NAME=VALUE.

        Raises InputError if it cannot be loaded, or if no blocks can stand below its text.
        """
        original, source = load_scenario(file), source_of(file, settings)
        scenario = source.scenario()
        try:
            text = source.text.decode('utf-8').rstrip('\n')
            read_blocks(f'{text}\n{_BLOCK}'.encode(), file)
        except (UnicodeDecodeError, InputError):
            raise InputError(
                f'{file}: no block can be added below its text; expected text in UTF-8, without '
                'braces around all blocks and without the end of a document (...)'
            ) from None
        return cls(text, original, scenario)

    def tuned(self, variables: Sequence[Variable], values: Mapping[str, float]) -> str:
        """
        Return the text of a parameter file with the settings and tuned values.

        The last value of a name in a file applies, so the blocks stand below the original text.

        Parameters
        ----------
        variables
            Tuned parameters.
        values
            Tuned values by the names of the variables.

        """
        tuned = with_variables(self.scenario, variables, [values[v.name] for v in variables])
        lines = [self.text, '', '# Tuned by masmc tune.']
        for node in NODES:
            original = self.original[node]
            # Settings can select a robot with other parameters.
            changed = {
                n: v for n, v in tuned[node].items() if n not in original or v != original[n]
            }
            changed |= anywhere(tuned[node])
            if changed:
                block = {f'/**/{node}': {'ros__parameters': _nested(changed)}}
                text = yaml.safe_dump(block, default_flow_style=None, width=99)
                lines.append(text.rstrip('\n'))
        return '\n'.join(lines) + '\n'


def _nested(values: Values) -> dict[str, Any]:
    """Return values by the parts of their dotted names."""
    tree: dict[str, Any] = {}
    for name, value in values.items():
        *outer, last = name.split('.')
        block = tree
        for part in outer:
            block = block.setdefault(part, {})
        block[last] = list(value) if isinstance(value, tuple) else value
    return tree
