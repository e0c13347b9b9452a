# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Messages on `NODE/parameters`: the current parameters, and events, as JSON."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

from masmc_ros.errors import InputError
from masmc_ros.messages.cdr_layout import checked_stamp
from masmc_ros.messages.message import text_of
from masmc_ros.params.declaration import MutableValues

_INTEGERS = range(-(2**63), 2**63)
"""Range of integer parameters in ROS 2."""


class ParameterRecord(NamedTuple):
    """
    Parameters of a node that apply from a tick on.

    Attributes
    ----------
    node
        Full name of the node.
    tick
        First tick that was computed with the parameters.
    stamp
        Stamp of that tick in ns.
    parameters
        Values of all parameters by name.
    changed
        Names of changed parameters; empty at the start of a node and with an event.
    event
        Event at the tick, one of the controller's EVENTS; empty without one.

    """

    node: str
    tick: int
    stamp: int
    parameters: MutableValues
    changed: tuple[str, ...]
    event: str = ''

    @property
    def is_start(self) -> bool:
        """Return True if the record has the parameters of the start."""
        return not self.changed and not self.event

    @property
    def changes(self) -> MutableValues:
        """Return the new values by name."""
        return {name: self.parameters[name] for name in self.changed}

    def to_text(self) -> str:
        """Return the record as JSON."""
        return json.dumps(self._asdict())


def read_record(text: str) -> ParameterRecord:
    """Read a record from JSON; InputError if the text is not a record."""
    try:
        content = json.loads(text)
        parameters, changed = parameter_values(content), tuple(map(str, content['changed']))
        record = ParameterRecord(
            str(content['node']),
            _tick(content),
            checked_stamp(int(content['stamp'])),
            parameters,
            changed,
            str(content.get('event', '')),
        )
        # Lone surrogates are valid in JSON, but cannot be encoded as UTF-8.
        ''.join((record.node, record.event)).encode()
        if not parameters.keys() >= set(changed):
            raise KeyError
    # Messages of third-party nodes may have infinite numbers and lists of any depth.
    except (TypeError, ValueError, KeyError, OverflowError, RecursionError, InputError) as error:
        raise InputError(
            'no record of parameters: expected JSON with node, tick, stamp, parameters and'
            ' changed'
        ) from error
    return record


def record_of(raw: bytes) -> ParameterRecord:
    """Read a record from a serialised std_msgs/String; InputError if it is not a record."""
    try:
        text = text_of(raw)
    except InputError as error:
        raise InputError(f'no record of parameters: {error}') from error
    return read_record(text)


def parameter_values(content: Any) -> MutableValues:
    """
    Return the `parameters` of an object read from JSON, by name.

    Raises TypeError, ValueError or KeyError if they are missing, or if a value has no parameter
    type in ROS 2, such as a list in a list.
    """
    values = dict(content['parameters'])
    for name, value in values.items():
        name.encode()
        for entry in value if isinstance(value, list) else () if value is None else (value,):
            _check_scalar(entry)
    return values


def _check_scalar(value: object) -> None:
    if isinstance(value, str):
        value.encode()
    elif isinstance(value, int):
        if value not in _INTEGERS:
            raise ValueError(value)
    elif not isinstance(value, float):
        raise TypeError(value)


def _tick(content: Any) -> int:
    tick = int(content['tick'])
    if tick not in _INTEGERS or tick < 0:
        raise ValueError(tick)
    return tick
