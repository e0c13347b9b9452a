# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Messages on `NODE/parameters`: the current parameters, and events, as JSON."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

from masmc_ros.errors import InputError
from masmc_ros.messages.layout import checked_stamp
from masmc_ros.messages.text import text_of

_INTEGERS = range(-(2**63), 2**63)
"""That ROS 2 has parameters of."""


class ParameterRecord(NamedTuple):
    """
    Parameters of a node that apply from a tick on.

    Attributes
    ----------
    node
        its full name.
    tick
        the first tick that was computed with them.
    stamp
        of that tick, ns.
    parameters : mapping
        all of them by name.
    changed
        names of those that are new; none at the start of a node and with an event.
    event
        what else changed at the tick, one of the controller's EVENTS; empty for none.

    """

    node: str
    tick: int
    stamp: int
    parameters: dict[str, Any]
    changed: tuple[str, ...]
    event: str = ''

    @property
    def is_start(self) -> bool:
        """Return True if the record has the parameters of the start."""
        return not self.changed and not self.event

    @property
    def changes(self) -> dict[str, Any]:
        """Return the new values by name."""
        return {name: self.parameters[name] for name in self.changed}

    def to_text(self) -> str:
        """Return the record as it is published."""
        return json.dumps(self._asdict())


def read_record(text: str) -> ParameterRecord:
    """Read a record; InputError where the text is none."""
    try:
        found = json.loads(text)
        parameters, changed = parameter_values(found), tuple(map(str, found['changed']))
        record = ParameterRecord(
            str(found['node']),
            _tick(found),
            checked_stamp(int(found['stamp'])),
            parameters,
            changed,
            str(found.get('event', '')),
        )
        # Lone surrogates are JSON, and no text that can be written anywhere.
        ''.join((record.node, record.event)).encode()
        if not parameters.keys() >= set(changed):
            raise KeyError
    # A stranger's numbers may be infinite, his lists nested beyond what Python reads.
    except (TypeError, ValueError, KeyError, OverflowError, RecursionError, InputError) as error:
        raise InputError(
            'no record of parameters: expected JSON with node, tick, stamp, parameters and'
            ' changed'
        ) from error
    return record


def record_of(raw: bytes) -> ParameterRecord:
    """Read a record as it is sent, a serialised std_msgs/String; InputError where it is none."""
    try:
        text = text_of(raw)
    except InputError as error:
        raise InputError(f'no record of parameters: {error}') from error
    return read_record(text)


def parameter_values(found: Any) -> dict[str, Any]:
    """
    Return the `parameters` of an object read from JSON, by name.

    Raises TypeError, ValueError or KeyError where there are none, or one has a value that no
    parameter of ROS 2 has, such as a list in a list.
    """
    values = dict(found['parameters'])
    for name, value in values.items():
        name.encode()
        for entry in value if isinstance(value, list) else () if value is None else (value,):
            _check_scalar(entry)
    return values


def _check_scalar(value: Any) -> None:
    if isinstance(value, str):
        value.encode()
    elif isinstance(value, int):
        if value not in _INTEGERS:
            raise ValueError(value)
    elif not isinstance(value, float):
        raise TypeError(value)


def _tick(found: Any) -> int:
    tick = int(found['tick'])
    if tick not in _INTEGERS or tick < 0:
        raise ValueError(tick)
    return tick
