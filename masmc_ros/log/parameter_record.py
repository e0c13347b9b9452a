# SPDX-License-Identifier: Apache-2.0
"""What a node says on `NODE/parameters`: its parameters in force, and events, as JSON."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

from masmc_ros.errors import InputError


class ParameterRecord(NamedTuple):
    """The parameters of a node in force from one tick on.

    Attributes:
        node: its full name.
        tick: the first tick that was computed with them.
        stamp: of that tick, ns.
        parameters: all of them by name.
        changed: names of those that are new; none at the start of a node and with an event.
        event: what else changed at the tick, one of the controller's EVENTS; empty for none.
    """

    node: str
    tick: int
    stamp: int
    parameters: dict[str, Any]
    changed: tuple[str, ...]
    event: str = ''

    @property
    def is_start(self) -> bool:
        """Whether the node tells what it started with."""
        return not self.changed and not self.event

    @property
    def changes(self) -> dict[str, Any]:
        """The new values by name."""
        return {name: self.parameters[name] for name in self.changed}

    def to_text(self) -> str:
        """Return the record as it is published."""
        return json.dumps(self._asdict())


def read_record(text: str) -> ParameterRecord:
    """Read a record; InputError where the text is none."""
    try:
        found = json.loads(text)
        parameters, changed = dict(found['parameters']), tuple(map(str, found['changed']))
        record = ParameterRecord(
            str(found['node']),
            int(found['tick']),
            int(found['stamp']),
            parameters,
            changed,
            str(found.get('event', '')),
        )
        if not parameters.keys() >= set(changed):
            raise KeyError
    except (TypeError, ValueError, KeyError) as error:
        raise InputError(
            'no record of parameters: expected JSON with node, tick, stamp, parameters and'
            ' changed'
        ) from error
    return record
