# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a logged run: its robot, and the changes with their times."""

from __future__ import annotations

from contextlib import suppress
import json
from typing import Any, NamedTuple

from masmc_ros.errors import InputError
from masmc_ros.log.read.reader import Run
from masmc_ros.messages.layout import NANOSECONDS
from masmc_ros.params.declaration import check_all
from masmc_ros.robot.robot import Robot, robot_of


class Change(NamedTuple):
    """One parameter that changed while the robot ran, or something that happened."""

    time: float
    """Of the first tick that was computed with the new value, s from the first state."""
    tick: int
    node: str
    name: str
    """Of the parameter, or what happened."""
    old: Any
    """None if the log lacks it."""
    new: Any
    is_event: bool = False
    """Whether something happened, and no parameter changed."""


def run_changes(run: Run) -> list[Change]:
    """Return what changed while the robot ran, in order."""
    in_force = {node: dict(values) for node, values in run.parameters.items()}
    changes = []
    for record in run.changes:
        node = record.node.rpartition('/')[2]
        time = record.stamp / NANOSECONDS - float(run.times[0])
        known = in_force.setdefault(node, {})
        changes += [
            Change(time, record.tick, node, name, known.get(name), value)
            for name, value in record.changes.items()
        ]
        if record.event:
            changes.append(Change(time, record.tick, node, record.event, None, None, True))
        known.update(record.parameters)
    return changes


def run_robot(run: Run) -> Robot | None:
    """
    Return the robot that moved, None where the log does not describe it.

    A simulated plant has the real lengths; the other nodes have what they believe.
    """
    declared = run.mechanism.parameters
    for node in ('plant', 'controller', 'trajectory'):
        values = run.parameters.get(node, {})
        told = {p.name: values[p.name] for p in declared if p.name in values}
        if len(told) == len(declared):
            with suppress(InputError):
                checked = check_all(declared, told, integers_for_doubles=True)
                return robot_of({**values, **checked})
    return None


def change_texts(change: Change) -> tuple[str, str]:
    """Return the old and the new value as a parameter file has them; empty for an event."""
    if change.is_event:
        return '', ''
    return value_text(change.old), value_text(change.new)


def value_text(value: Any) -> str:
    """Return a parameter's value as a parameter file has it, '?' for one not known."""
    return '?' if value is None else json.dumps(value, ensure_ascii=False)
