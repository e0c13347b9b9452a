# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of a run: what it began with, and what changed when."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
import json
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.log.read.contents import LogContents
from masmc_ros.log.read.timeline import Beginning
from masmc_ros.log.write.provenance import CHANGES, PARAMETERS
from masmc_ros.messages.parameter_record import parameter_values, ParameterRecord, record_of
from masmc_ros.messages.topics import PARAMETER_NODES, parameters_topic


@dataclass(frozen=True)
class ParameterHistory:
    """
    Parameters of all nodes; nodes go by their own names, whatever namespace they ran in.

    Attributes
    ----------
    start
        values by node and by name with which the run began.
    changes
        what was changed or happened while it ran, in the order of the log.
    restarted
        nodes that were started again on the way, and began from nothing there.

    """

    start: dict[str, dict[str, Any]]
    changes: tuple[ParameterRecord, ...]
    restarted: tuple[str, ...]


def parameter_history(records: LogContents, namespace: str, begun: Beginning) -> ParameterHistory:
    """
    Return the parameters of a robot's run.

    They are taken from the topics `NODE/parameters`, which every recorder can record; where a
    log has none of these, from its metadata.

    Parameters
    ----------
    records
        the log.
    namespace
        of the robot, what stands before the names of its topics.
    begun
        where in the log the run began; what was changed before is part of its beginning.

    Records that cannot be read are left out, as every node refuses them.

    Raises
    ------
    InputError
        for metadata that cannot be read.

    """
    start: dict[str, dict[str, Any]] = {}
    changes: list[tuple[int, ParameterRecord]] = []
    restarted = []
    for node in PARAMETER_NODES:
        topic = records.topics.get(namespace + parameters_topic(node))
        if topic is None:
            continue
        for order, raw in zip(topic.orders, topic.messages, strict=True):
            try:
                record = record_of(raw)
            except InputError:
                continue
            stamp = None if record.is_start else record.stamp
            if node not in start or not begun.is_over(order, stamp):
                start[node] = record.parameters
            elif record.is_start:
                restarted.append(node)
            else:
                changes.append((order, record))
    if not start:
        return _from_metadata(records)
    changes.sort(key=lambda each: each[0])
    return ParameterHistory(start, tuple(record for _, record in changes), tuple(restarted))


def _from_metadata(records: LogContents) -> ParameterHistory:
    start = {
        _own_name(node): _start(text)
        for record in records.metadata.get(PARAMETERS, ())
        for node, text in record.items()
    }
    in_force = {node: dict(values) for node, values in start.items()}
    changes = []
    for record in records.metadata.get(CHANGES, ()):
        for _, text in sorted(record.items()):
            found = _object(CHANGES, text)
            try:
                node, new = str(found['node']), parameter_values(found)
                values = in_force.setdefault(_own_name(node), {})
                values.update(new)
                tick, stamp = int(found['tick']), int(found['stamp'])
            except (KeyError, TypeError, ValueError, OverflowError) as error:
                raise InputError(
                    f"metadata '{CHANGES}': expected JSON objects of node, tick, stamp and"
                    ' parameters'
                ) from error
            event = str(found.get('event', ''))
            changes.append(ParameterRecord(node, tick, stamp, dict(values), tuple(new), event))
    return ParameterHistory(start, tuple(changes), ())


def _own_name(node: str) -> str:
    return node.rpartition('/')[2]


def _start(text: str) -> dict[str, Any]:
    try:
        return parameter_values({'parameters': _object(PARAMETERS, text)})
    except (TypeError, ValueError) as error:
        raise InputError(
            f"metadata '{PARAMETERS}': expected values that parameters can have"
        ) from error


def _object(name: str, text: str) -> dict[str, Any]:
    values = None
    with suppress(ValueError, RecursionError):
        values = json.loads(text)
    if not isinstance(values, dict):
        raise InputError(f"metadata '{name}': expected JSON objects of names and values")
    return values
