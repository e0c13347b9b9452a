# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Parameters of logged runs: their robots, changes with their times, and differences between runs.

Names and an order of runs follow from the differences.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
import json
import re
from typing import NamedTuple

from masmc_ros.errors import InputError
from masmc_ros.log.read.reader import Run
from masmc_ros.messages.cdr_layout import NANOSECONDS
from masmc_ros.params.declaration import check_all
from masmc_ros.report.measure.labels import as_line, labels, law_labels
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


NODES = 'controller', 'plant', 'trajectory'
"""Nodes whose parameters are compared; the others do not change a run."""

LABELLED = frozenset(('law', 'switching', 'boundary_layer', 'observer_gain'))
"""Parameters that labels contain."""

_NAMED = 3
"""Maximum number of parameters in a name; runs with more differences are named by their files."""

_LONGEST = 24
"""Maximum length of a value in a name."""

_MISSING = '-'


class Difference(NamedTuple):
    """Parameter with several values; the value of each run, None for runs without it."""

    name: str
    values: list[object]

    @property
    def texts(self) -> list[str]:
        """Return the values as short texts."""
        return [short_text(value) for value in self.values]


def short_text(value: object) -> str:
    """Return a value without needless characters: 100 for [100.0, 100.0], '-' for None."""
    if value is None:
        return _MISSING
    if isinstance(value, list | tuple) and value and all(entry == value[0] for entry in value):
        return short_text(value[0])
    if isinstance(value, list | tuple):
        return f'[{", ".join(map(short_text, value))}]'
    if isinstance(value, float):
        return repr(value).removesuffix('.0')
    return as_line(value if isinstance(value, str) else json.dumps(value, ensure_ascii=False))


def differences(runs: Sequence[Run]) -> list[Difference]:
    """
    Return the parameters at the start that have several values among the runs.

    A parameter that only some runs have is compared among these. Shared parameters that differ
    alike in several nodes are listed once; otherwise their name contains the node.
    """
    found: dict[str, dict[str, list[object]]] = {}
    for node in NODES:
        tables = [run.parameters.get(node, {}) for run in runs]
        for name in dict.fromkeys(name for table in tables for name in table):
            values = [table.get(name) for table in tables]
            if len({json.dumps(value) for value in values if value is not None}) > 1:
                found.setdefault(name, {})[node] = values
    several = []
    for name, nodes in found.items():
        distinct = {json.dumps(values) for values in nodes.values()}
        if len(distinct) == 1:
            several.append(Difference(name, next(iter(nodes.values()))))
        else:
            several += [Difference(f'{node} {name}', values) for node, values in nodes.items()]
    return several


def run_names(runs: Sequence[Run]) -> list[str]:
    """
    Return a name for each run, all different: the law, and the parameters that differ.

    Runs of one law with equal parameters, or with many different ones, have the name of their
    file, as in `labels`.
    """
    names = labels(runs)
    for group in _groups(runs):
        if len(group) == 1 or not law_labels(runs)[group[0]]:
            continue
        shown = _distinguishing([runs[i] for i in group])
        if not 0 < len(shown) <= _NAMED:
            continue
        texts = [
            ', '.join(f'{difference.name} {difference.texts[place]}' for difference in shown)
            for place in range(len(group))
        ]
        longest = max(len(text) for difference in shown for text in difference.texts)
        if len(set(texts)) == len(group) and longest <= _LONGEST:
            law = law_labels(runs)[group[0]]
            for i, text in zip(group, texts, strict=True):
                names[i] = f'{law}, {text}'
    return names if len(set(names)) == len(names) else labels(runs)


def run_order(runs: Sequence[Run]) -> list[int]:
    """
    Return the indices of runs in the order of the page.

    Laws are in the order of their first run. Runs of one law are sorted by the parameters that
    differ, numbers by value: a gain of 10 follows a gain of 2.
    """
    order: list[int] = []
    for group in _groups(runs):
        shown = _distinguishing([runs[i] for i in group])
        keys = {
            i: [natural_key(difference.texts[place]) for difference in shown]
            for place, i in enumerate(group)
        }
        order += sorted(group, key=keys.__getitem__)
    return order


def natural_key(text: str) -> list[tuple[float, str]]:
    """Return a key that sorts the numbers in a text by their value."""
    parts = re.split(r'(-?\d+(?:\.\d+)?(?:e[+-]?\d+)?)', text)
    return [(float(part), '') if i % 2 else (0.0, part) for i, part in enumerate(parts)]


def _groups(runs: Sequence[Run]) -> list[list[int]]:
    """Return the indices of the runs of each law, in the order of the laws' first runs."""
    groups: dict[str, list[int]] = {}
    for i, label in enumerate(law_labels(runs)):
        groups.setdefault(label, []).append(i)
    return list(groups.values())


def _distinguishing(runs: Sequence[Run]) -> list[Difference]:
    """Return the differences of runs of one law that their label does not contain."""
    return [entry for entry in differences(runs) if entry.name not in LABELLED]
