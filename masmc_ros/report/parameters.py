# SPDX-License-Identifier: Apache-2.0
"""The parameters that a log says its run started with, and their changes."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

from masmc_ros.errors import InputError
from masmc_ros.log.layout import NANOSECONDS
from masmc_ros.log.provenance import CHANGES, PARAMETERS
from masmc_ros.log.reader import Run
from masmc_ros.robot.parameters import ROBOT, Robot


class Change(NamedTuple):
    """One parameter that changed while the robot ran."""

    time: float
    """Of the first tick that was computed with the new value, s from the first state."""
    tick: int
    node: str
    name: str
    old: Any
    """None where the log does not tell it."""
    new: Any


def run_parameters(run: Run) -> dict[str, dict[str, Any]]:
    """Return the parameters at the start by node and by name; empty where the log tells none.

    Nodes go by their own names, whatever namespace they ran in. Raises InputError for a
    record that cannot be read.
    """
    parameters = {}
    for record in run.metadata.get(PARAMETERS, ()):
        for node, text in record.items():
            parameters[_own_name(node)] = _object(run, PARAMETERS, node, text)
    return parameters


def run_changes(run: Run) -> list[Change]:
    """Return what changed while the robot ran, in order; InputError as `run_parameters`."""
    in_force = {node: dict(values) for node, values in run_parameters(run).items()}
    changes = []
    for record in run.metadata.get(CHANGES, ()):
        for number, text in record.items():
            change = _object(run, CHANGES, number, text)
            try:
                node, tick = _own_name(change['node']), int(change['tick'])
                time = int(change['stamp']) / NANOSECONDS - float(run.times[0])
                values = dict(change['parameters'])
            except (AttributeError, KeyError, TypeError, ValueError) as error:
                raise InputError(
                    f"{run.path}: metadata '{CHANGES}' {number}: expected node, tick, stamp and"
                    ' parameters'
                ) from error
            known = in_force.setdefault(node, {})
            changes += [
                Change(time, tick, node, name, known.get(name), value)
                for name, value in values.items()
            ]
            known.update(values)
    return changes


def was_changed(run: Run) -> bool:
    """Tell whether the log has changes of parameters while the robot ran."""
    return bool(run_changes(run))


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


def value_text(value: Any) -> str:
    """Return a parameter's value as a parameter file has it, '?' for one not known."""
    return '?' if value is None else json.dumps(value, ensure_ascii=False)


def _own_name(node: str) -> str:
    return node.rpartition('/')[2]


def _object(run: Run, record: str, what: str, text: str) -> dict[str, Any]:
    try:
        values = json.loads(text)
    except json.JSONDecodeError:
        values = None
    if not isinstance(values, dict):
        raise InputError(
            f"{run.path}: metadata '{record}' of {what}: expected a JSON object of names and"
            ' values'
        )
    return values


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
