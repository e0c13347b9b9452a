# SPDX-License-Identifier: Apache-2.0
"""The parameters of a robot's nodes for a viewer: those in force, and changes of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import json
import time
from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.serialization import deserialize_message
from rclpy.task import Future

from masmc_ros.log.text import text_of
from masmc_ros.log.topics import PARAMETER_NODES
from masmc_ros.nodes.live_server import Change, LiveServer, plain

_PATIENCE = 3.0
"""Longest time in s that a node may take to answer."""


class LiveParameters:
    """Shows what nodes say of their parameters, and asks them to change.

    Names are those of a viewer, `/controller.k_s1`.
    """

    def __init__(
        self, node: Node, server: LiveServer, complain: Callable[[str], object]
    ) -> None:
        """Make clients on `node`, before it is spun; `complain` is told of refusals."""
        self._server = server
        self._complain = complain
        self._clients = {
            full: AsyncParameterClient(node, full)
            for full in (node.resolve_service_name(name) for name in PARAMETER_NODES)
        }
        self._pending: dict[Future, _Pending] = {}

    def on_record(self, node: str, raw: bytes) -> Mapping[str, Any]:
        """Take a message of a node's topic `~/parameters`; return the values that it tells."""
        values: Mapping[str, Any] = json.loads(text_of(raw))['parameters']
        shown = self._server.in_force
        # A node knows one number for all axes as an array too; it stays what it was set to.
        self._show(
            node,
            {n: v for n, v in values.items() if not _is_broadcast(shown.get(f'{node}.{n}'), v)},
        )
        return values

    def on_event(self, raw: bytes) -> None:
        """Take a message of /parameter_events."""
        event = deserialize_message(raw, ParameterEvent)
        if event.node in self._clients:
            changed = (*event.new_parameters, *event.changed_parameters)
            values = {each.name: parameter_value_to_python(each.value) for each in changed}
            self._show(event.node, values)

    def request(self, change: Change) -> None:
        """Ask the nodes for a change; the client is answered when all have answered."""
        left = _Countdown(len(change.values), change.finish)
        for name, value in change.values.items():
            node, _, parameter = name.partition('.')
            client = self._clients.get(node)
            if client is None:
                self._refuse(name, f'there is no such node; nodes are {", ".join(self._clients)}')
                left.count()
            elif not client.services_are_ready():
                self._refuse(name, f'{node} is not running')
                left.count()
            elif (wanted := _ros_parameter(parameter, value)) is None:
                self._refuse(name, f'{value!r} is no value of a parameter')
                left.count()
            else:
                future = client.set_parameters([wanted])
                pending = _Pending(name, node, client, left, time.monotonic() + _PATIENCE)
                self._pending[future] = pending
                future.add_done_callback(self._on_answer)

    def look_after(self) -> None:
        """Give up what was not answered."""
        now = time.monotonic()
        for future in [f for f, each in self._pending.items() if now > each.limit]:
            pending = self._pending.pop(future)
            self._refuse(pending.name, f'{pending.node} does not answer')
            pending.left.count()

    def _on_answer(self, future: Future) -> None:
        """Tell what a node says of a change, and ask for the value that is in force then."""
        pending = self._pending.pop(future, None)
        if pending is None:
            return
        result = future.result().results[0]
        if result.successful:
            self._server.accept(pending.name)
        else:
            self._refuse(pending.name, result.reason)
        _, _, parameter = pending.name.partition('.')
        again = pending.client.get_parameters([parameter])
        self._pending[again] = pending
        again.add_done_callback(self._on_value)

    def _on_value(self, future: Future) -> None:
        pending = self._pending.pop(future, None)
        if pending is None:
            return
        _, _, parameter = pending.name.partition('.')
        for value in future.result().values:
            self._show(pending.node, {parameter: parameter_value_to_python(value)})
        pending.left.count()

    def _refuse(self, name: str, reason: str) -> None:
        self._server.refuse(name, reason)
        self._complain(f'{name} is not set: {reason}')

    def _show(self, node: str, values: Mapping[str, Any]) -> None:
        self._server.set_in_force(
            {f'{node}.{name}': plain(value) for name, value in values.items() if value is not None}
        )


def _is_broadcast(shown: Any, told: Any) -> bool:
    """Tell whether an array is the number that is shown already, once for every axis."""
    return isinstance(shown, float) and isinstance(told, list) and set(told) == {shown}


class _Countdown:
    """Calls a function when it has counted to the end."""

    def __init__(self, count: int, then: Callable[[], None]) -> None:
        self._left = count
        self._then = then
        if not count:
            then()

    def count(self) -> None:
        self._left -= 1
        if not self._left:
            self._then()


class _Pending:
    """A question to a node that is not answered yet."""

    def __init__(
        self, name: str, node: str, client: AsyncParameterClient, left: _Countdown, limit: float
    ) -> None:
        self.name = name
        self.node = node
        self.client = client
        self.left = left
        self.limit = limit


def _ros_parameter(name: str, value: Any) -> Parameter | None:
    """Return a value as a viewer sends it in ROS 2's types; None where it has none."""
    if isinstance(value, list):
        numbers = [v for v in value if isinstance(v, int | float) and not isinstance(v, bool)]
        if value and len(numbers) == len(value):
            # A viewer writes 150.0 as 150.
            return Parameter(name, Parameter.Type.DOUBLE_ARRAY, [float(v) for v in value])
        if all(isinstance(v, str) for v in value):
            return Parameter(name, Parameter.Type.STRING_ARRAY, value)
        return None
    if isinstance(value, int) and not isinstance(value, bool) and not -(2**63) <= value < 2**63:
        return None
    return Parameter(name, value=value) if isinstance(value, bool | int | float | str) else None
