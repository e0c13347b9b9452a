# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""ROS parameter file of tuned values: the file of the scenario, and further blocks below it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from masmc_ros.campaign.variable import Variable
from masmc_ros.params.declaration import Values
from masmc_ros.params.node_parameters import NODES
from masmc_ros.params.scenario import load_scenario
import yaml


def tuned_file(
    file: str, settings: Sequence[str], variables: Sequence[Variable], values: Mapping[str, float]
) -> str:
    """
    Return the text of a parameter file with settings and tuned values.

    The last value of a name in a file applies, so the blocks stand below the original text.

    Parameters
    ----------
    file
        Parameter file of the scenario.
    settings
        Texts NAME=VALUE of `--set`.
    variables
        Tuned parameters.
    values
        Tuned values by the names of the variables.

    """
    original, scenario = load_scenario(file), load_scenario(file, settings)
    for variable in variables:
        variable.write(scenario, values[variable.name])
    lines = [Path(file).read_text(encoding='utf-8').rstrip('\n'), '', '# Tuned by masmc tune.']
    for node in NODES:
        changed = {n: v for n, v in scenario[node].items() if v != original[node][n]}
        if changed:
            block = {f'/**/{node}': {'ros__parameters': _nested(changed)}}
            lines.append(yaml.safe_dump(block, default_flow_style=None, width=99).rstrip('\n'))
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
