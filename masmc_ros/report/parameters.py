# SPDX-License-Identifier: Apache-2.0
"""The parameters that a log says its run started with."""

from __future__ import annotations

import json
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.log.provenance import CHANGES, PARAMETERS
from masmc_ros.log.reader import Run
from masmc_ros.robot.parameters import ROBOT, Robot


def run_parameters(run: Run) -> dict[str, dict[str, Any]]:
    """Return the parameters at the start by node and by name; empty where the log tells none.

    Nodes go by their own names, whatever namespace they ran in. Raises InputError for a
    record that cannot be read.
    """
    parameters = {}
    for record in run.metadata.get(PARAMETERS, ()):
        for node, text in record.items():
            parameters[node.rpartition('/')[2]] = _object(run, node, text)
    return parameters


def was_changed(run: Run) -> bool:
    """Tell whether the log has changes of parameters while the robot ran."""
    return any(run.metadata.get(CHANGES, ()))


def run_robot(run: Run) -> Robot | None:
    """Return the robot that moved, None where the log does not describe it.

    A simulated plant has the real lengths; the other nodes have what they believe.
    """
    parameters = run_parameters(run)
    for node in ('plant', 'controller', 'trajectory'):
        values = parameters.get(node, {})
        if all(_is_number(values.get(p.name)) for p in ROBOT):
            return Robot.from_values({p.name: values[p.name] for p in ROBOT})
    return None


def _object(run: Run, node: str, text: str) -> dict[str, Any]:
    try:
        values = json.loads(text)
    except json.JSONDecodeError:
        values = None
    if not isinstance(values, dict):
        raise InputError(
            f"{run.path}: metadata '{PARAMETERS}' of {node}: expected a JSON object of names and"
            ' values'
        )
    return values


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
