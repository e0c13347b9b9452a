# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a robot's nodes for a viewer: current values and changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
import time
from typing import Any, NamedTuple

from masmc_ros.errors import InputError
from masmc_ros.messages.parameter_record import record_of
from masmc_ros.messages.topics import PARAMETER_NODES
from masmc_ros.nodes.live.server import Change, LiveServer, plain
from masmc_ros.nodes.middleware.messages import deserialized
from masmc_ros.nodes.parameters.service_call import ServiceCall
from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient

_PATIENCE = 3.0
"""Longest time in s that a node may take to answer."""


class LiveParameters:
    """
    Shows what nodes say of their parameters, and asks them to change.

    Names are those of a viewer, `/controller.k_s1`.
    """

    def __init__(
        self, node: Node, server: LiveServer, complain: Callable[[str], object]
    ) -> None:
        """Create clients on `node`, before it spins; `complain` is called with rejections."""
        self._server = server
        self._complain = complain
        self._clients = {
            full: AsyncParameterClient(node, full)
            for full in (node.resolve_service_name(name) for name in PARAMETER_NODES)
        }
        self._pending: list[_Pending] = []

    def on_record(self, node: str, raw: bytes) -> Mapping[str, Any]:
        """
        Read a message of a node's topic `~/parameters`; return its values.

        Raises InputError for one that is no record of parameters.
        """
        values = record_of(raw).parameters
        shown = self._server.in_force
        # A node knows one number for all axes as an array too; it stays what it was set to.
        self._show(
            node,
            {n: v for n, v in values.items() if not _is_broadcast(shown.get(f'{node}.{n}'), v)},
        )
        return values

    def on_event(self, raw: bytes) -> None:
        """Take a message of /parameter_events; InputError for one that cannot be read."""
        event = deserialized(raw, ParameterEvent)
        if event.node not in self._clients:
            return
        changed = (*event.new_parameters, *event.changed_parameters)
        try:
            values = {each.name: parameter_value_to_python(each.value) for each in changed}
        except RuntimeError as error:
            raise InputError(str(error)) from error
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
                question = ServiceCall(partial(client.set_parameters, [wanted]))
                limit = time.monotonic() + _PATIENCE
                self._pending.append(
                    _Pending(name, node, client, left, limit, question, self._on_answer)
                )

    def look_after(self) -> None:
        """Take answers; ask again, and in the end give up, where there is none."""
        now = time.monotonic()
        for pending in tuple(self._pending):
            response = pending.question.answer()
            if response is not None:
                self._pending.remove(pending)
                pending.then(pending, response)
            elif now > pending.limit:
                self._pending.remove(pending)
                self._refuse(pending.name, f'{pending.node} does not answer')
                pending.left.count()

    def _on_answer(self, pending: _Pending, response: Any) -> None:
        """Pass on a node's response to a change, and request the value that is current then."""
        # Another node may answer in the place of the real one, with anything.
        if not response.results:
            self._refuse(pending.name, f'{pending.node} answers without a result')
        elif response.results[0].successful:
            self._server.accept(pending.name)
        else:
            self._refuse(pending.name, response.results[0].reason)
        _, _, parameter = pending.name.partition('.')
        question = ServiceCall(partial(pending.client.get_parameters, [parameter]))
        self._pending.append(pending._replace(question=question, then=self._on_value))

    def _on_value(self, pending: _Pending, response: Any) -> None:
        _, _, parameter = pending.name.partition('.')
        for value in response.values:
            try:
                self._show(pending.node, {parameter: parameter_value_to_python(value)})
            except RuntimeError as error:
                self._complain(f'{pending.name} is not shown: {error}')
        pending.left.count()

    def _refuse(self, name: str, reason: str) -> None:
        self._server.refuse(name, reason)
        self._complain(f'{name} is not set: {reason}')

    def _show(self, node: str, values: Mapping[str, Any]) -> None:
        self._server.set_in_force(
            {f'{node}.{name}': plain(value) for name, value in values.items() if value is not None}
        )


def _is_broadcast(shown: Any, told: Any) -> bool:
    """Return True if an array is the number that is already shown, once for every axis."""
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


class _Pending(NamedTuple):
    """A question to a node that is not answered yet."""

    name: str
    node: str
    client: AsyncParameterClient
    left: _Countdown
    limit: float
    question: ServiceCall
    then: Callable[[_Pending, Any], None]


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
