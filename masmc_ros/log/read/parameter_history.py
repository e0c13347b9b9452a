# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a run at its start, and their changes."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
import json

from masmc_ros.errors import InputError
from masmc_ros.log.read.decode import LogContents
from masmc_ros.log.read.timeline import PassStart
from masmc_ros.log.write.provenance import CHANGES, PARAMETERS
from masmc_ros.messages.parameter_record import parameter_values, ParameterRecord, record_of
from masmc_ros.messages.topics import PARAMETER_NODES, parameters_topic
from masmc_ros.params.declaration import MutableValues


@dataclass(frozen=True)
class ParameterHistory:
    """
    Parameters of all nodes, by the names of nodes without their namespace.

    Attributes
    ----------
    start
        values at the start, by node and name.
    changes
        changes and events while the robot ran, in the order of the log.
    restarted
        nodes that were restarted while the robot ran.

    """

    start: dict[str, MutableValues]
    changes: tuple[ParameterRecord, ...]
    restarted: tuple[str, ...]


def parameter_history(
    contents: LogContents, namespace: str, pass_start: PassStart
) -> ParameterHistory:
    """
    Return the parameters of a robot's run.

    They are read from the topics `NODE/parameters`, which every recorder can record; from the
    metadata of a log without these topics. Records that cannot be read are ignored.

    Parameters
    ----------
    contents
        the log.
    namespace
        namespace of the robot, with which the names of its topics start.
    pass_start
        start of the last pass; earlier changes are part of the parameters at the start.

    Raises
    ------
    InputError
        if metadata cannot be read.

    """
    start: dict[str, MutableValues] = {}
    changes: list[tuple[int, ParameterRecord]] = []
    restarted = []
    for node in PARAMETER_NODES:
        topic = contents.topics.get(namespace + parameters_topic(node))
        if topic is None:
            continue
        for order, raw in zip(topic.orders, topic.messages, strict=True):
            try:
                record = record_of(raw)
            except InputError:
                continue
            stamp = None if record.is_start else record.stamp
            if node not in start or not pass_start.is_over(order, stamp):
                start[node] = record.parameters
            elif record.is_start:
                restarted.append(node)
            else:
                changes.append((order, record))
    if not start:
        return _from_metadata(contents)
    changes.sort(key=lambda change: change[0])
    return ParameterHistory(start, tuple(record for _, record in changes), tuple(restarted))


def _from_metadata(contents: LogContents) -> ParameterHistory:
    start = {
        node.rpartition('/')[2]: _start(text)
        for record in contents.metadata.get(PARAMETERS, ())
        for node, text in record.items()
    }
    current = {node: dict(values) for node, values in start.items()}
    changes = []
    for record in contents.metadata.get(CHANGES, ()):
        for _, text in sorted(record.items()):
            entry = _object(CHANGES, text)
            try:
                node, new = str(entry['node']), parameter_values(entry)
                values = current.setdefault(node.rpartition('/')[2], {})
                values.update(new)
                tick, stamp = int(entry['tick']), int(entry['stamp'])
            except (KeyError, TypeError, ValueError, OverflowError) as error:
                raise InputError(
                    f"metadata '{CHANGES}': expected JSON objects of node, tick, stamp and"
                    ' parameters'
                ) from error
            event = str(entry.get('event', ''))
            changes.append(ParameterRecord(node, tick, stamp, dict(values), tuple(new), event))
    return ParameterHistory(start, tuple(changes), ())


def _start(text: str) -> MutableValues:
    try:
        return parameter_values({'parameters': _object(PARAMETERS, text)})
    except (TypeError, ValueError) as error:
        raise InputError(
            f"metadata '{PARAMETERS}': expected values that parameters can have"
        ) from error


def _object(name: str, text: str) -> MutableValues:
    values = None
    with suppress(ValueError, RecursionError):
        values = json.loads(text)
    if not isinstance(values, dict):
        raise InputError(f"metadata '{name}': expected JSON objects of names and values")
    return values
