# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a logged run: its robot, and the changes with their times."""

from __future__ import annotations

from contextlib import suppress
import json
from typing import NamedTuple

from masmc_ros.errors import InputError
from masmc_ros.log.read.reader import Run
from masmc_ros.messages.cdr_layout import NANOSECONDS
from masmc_ros.params.declaration import check_all
from masmc_ros.robot.robot import Robot, robot_of


class ParameterChange(NamedTuple):
    """Change of a parameter, or an event, while the robot ran."""

    time: float
    """Time in s, from the first state, of the first tick with the new value."""
    tick: int
    node: str
    name: str
    """Name of the parameter or of the event."""
    old: object
    """None if the log lacks it."""
    new: object
    is_event: bool = False
    """Whether it is an event."""


def run_changes(run: Run) -> list[ParameterChange]:
    """Return the changes while the robot ran, in their order."""
    active = {node: dict(values) for node, values in run.parameters.items()}
    changes = []
    for record in run.changes:
        node = record.node.rpartition('/')[2]
        time = record.stamp / NANOSECONDS - float(run.times[0])
        known = active.setdefault(node, {})
        changes += [
            ParameterChange(time, record.tick, node, name, known.get(name), value)
            for name, value in record.changes.items()
        ]
        if record.event:
            event = ParameterChange(time, record.tick, node, record.event, None, None, True)
            changes.append(event)
        known.update(record.parameters)
    return changes


def run_robot(run: Run) -> Robot | None:
    """
    Return the robot that moved; None if the log does not describe it.

    A simulated plant has the true lengths, the other nodes have assumed ones.
    """
    robots = (robot_of_node(run, node) for node in ('plant', 'controller', 'trajectory'))
    return next((robot for robot in robots if robot is not None), None)


def robot_of_node(run: Run, node: str) -> Robot | None:
    """Return the robot that the parameters of a node describe; None if they do not."""
    declared = run.mechanism.parameters
    values = run.parameters.get(node, {})
    known = {p.name: values[p.name] for p in declared if p.name in values}
    if len(known) < len(declared):
        return None
    with suppress(InputError):
        checked = check_all(declared, known, integers_for_doubles=True)
        return robot_of({**values, **checked})
    return None


def change_texts(change: ParameterChange) -> tuple[str, str]:
    """Return the old and the new value in the form of a parameter file; empty for an event."""
    if change.is_event:
        return '', ''
    return value_text(change.old), value_text(change.new)


def value_text(value: object) -> str:
    """Return a value in the form of a parameter file, '?' for an unknown one."""
    return '?' if value is None else json.dumps(value, ensure_ascii=False)
