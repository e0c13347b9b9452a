# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the nodes in a viewer: current values and changes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
import math
import threading
import time
from typing import Any, NamedTuple, Protocol

from masmc_ros.errors import InputError
from masmc_ros.messages.parameter_record import ParameterRecord, record_of
from masmc_ros.messages.topics import PARAMETER_NODES
from masmc_ros.nodes.middleware.ros_topics import deserialized
from masmc_ros.nodes.parameters.services import ServiceCall
from masmc_ros.params.declaration import MutableValues, Values
from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient

_PATIENCE = 3.0
"""Longest time in s until the response of a node."""

_VIEWER_PATIENCE = 5.0
"""Longest time in s that a viewer's thread waits for the response to a change."""


@dataclass
class ParameterRequest:
    """Request of a viewer to set parameters, by name; complete after `finish`."""

    values: MutableValues
    _finished: threading.Event = field(default_factory=threading.Event)

    @property
    def is_finished(self) -> bool:
        """Return True if all nodes have responded, or have not done so in time."""
        return self._finished.is_set()

    def finish(self) -> None:
        """Signal to the viewer's thread that the current values are ready."""
        self._finished.set()

    def wait(self) -> None:
        """Wait for the end, for a limited time."""
        self._finished.wait(_VIEWER_PATIENCE)


class ParameterView(Protocol):
    """Display of parameters; names are such as `/controller.k_s1`."""

    @property
    def values(self) -> Values:
        """Return the shown values by name."""

    def show_values(self, values: Values) -> None:
        """Show current values by name."""

    def show_error(self, name: str, reason: str) -> None:
        """Show the reason why a parameter was not set."""

    def clear_error(self, name: str) -> None:
        """Remove the error of a parameter."""


class ViewerParameters:
    """
    Connection of the parameters of the nodes with a viewer.

    Names are those of a viewer, `/controller.k_s1`.
    """

    def __init__(
        self, node: Node, view: ParameterView, log_error: Callable[[str], object]
    ) -> None:
        """
        Create the clients.

        Parameters
        ----------
        node
            Node of the clients, which does not spin yet.
        view
            Viewer, or server of viewers, that shows the values.
        log_error
            Function that logs a line about a change that was rejected.

        """
        self._view = view
        self._log_error = log_error
        self._clients = {
            full: AsyncParameterClient(node, full)
            for full in (node.resolve_service_name(name) for name in PARAMETER_NODES)
        }
        self._pending: list[_Pending] = []

    def on_record(self, node: str, raw: bytes) -> ParameterRecord:
        """
        Show the values in a message of a node's topic `~/parameters`, and return the record.

        Raises InputError if the message is not a record of parameters.
        """
        record = record_of(raw)
        values = record.parameters
        shown = self._view.values
        # The record has an array for one number that applies to all axes; the number stays shown.
        self._show(
            node,
            {n: v for n, v in values.items() if not _is_broadcast(shown.get(f'{node}.{n}'), v)},
        )
        return record

    def on_event(self, raw: bytes) -> None:
        """Show the values in a message of /parameter_events; InputError if it is invalid."""
        event = deserialized(raw, ParameterEvent)
        if event.node not in self._clients:
            return
        changed = (*event.new_parameters, *event.changed_parameters)
        try:
            values = {entry.name: parameter_value_to_python(entry.value) for entry in changed}
        except RuntimeError as error:
            raise InputError(str(error)) from error
        self._show(event.node, values)

    def request(self, change: ParameterRequest) -> None:
        """Request a change from the nodes; it is finished when all have responded."""
        countdown = _Countdown(len(change.values), change.finish)
        for name, value in change.values.items():
            node, _, parameter = name.partition('.')
            client = self._clients.get(node)
            if client is None:
                error = f'there is no such node; nodes are {", ".join(self._clients)}'
            elif not client.services_are_ready():
                error = f'{node} is not running'
            elif (request := _ros_parameter(parameter, value)) is None:
                error = f'{value!r} is no value of a parameter'
            else:
                call = ServiceCall(partial(client.set_parameters, [request]))
                limit = time.monotonic() + _PATIENCE
                self._pending.append(
                    _Pending(name, node, client, countdown, limit, call, self._on_result)
                )
                continue
            self._reject(name, error)
            countdown.count()

    def update(self) -> None:
        """Process responses; repeat requests without one, and end them after some time."""
        now = time.monotonic()
        for pending in tuple(self._pending):
            response = pending.service_call.response()
            if response is not None:
                self._pending.remove(pending)
                pending.on_response(pending, response)
            elif now > pending.limit:
                self._pending.remove(pending)
                self._reject(pending.name, f'{pending.node} does not answer')
                pending.countdown.count()

    def _on_result(self, pending: _Pending, response: SetParameters.Response) -> None:
        """Show the result of a change, and request the current value."""
        # A third-party node with the same name may send any response.
        if not response.results:
            self._reject(pending.name, f'{pending.node} answers without a result')
        elif response.results[0].successful:
            self._view.clear_error(pending.name)
        else:
            self._reject(pending.name, response.results[0].reason)
        _, _, parameter = pending.name.partition('.')
        call = ServiceCall(partial(pending.client.get_parameters, [parameter]))
        self._pending.append(
            pending._replace(service_call=call, on_response=self._on_value)
        )

    def _on_value(self, pending: _Pending, response: GetParameters.Response) -> None:
        _, _, parameter = pending.name.partition('.')
        for value in response.values:
            try:
                self._show(pending.node, {parameter: parameter_value_to_python(value)})
            except RuntimeError as error:
                self._log_error(f'{pending.name} is not shown: {error}')
        pending.countdown.count()

    def _reject(self, name: str, reason: str) -> None:
        self._view.show_error(name, reason)
        self._log_error(f'{name} is not set: {reason}')

    def _show(self, node: str, values: Values) -> None:
        self._view.show_values(
            {f'{node}.{name}': plain(value) for name, value in values.items() if value is not None}
        )


def _is_broadcast(shown: object, value: object) -> bool:
    """Return True if an array repeats the shown number for every axis."""
    return isinstance(shown, float) and isinstance(value, list) and set(value) == {shown}


class _Countdown:
    """Number of missing responses, with a function that is called after the last one."""

    def __init__(self, count: int, on_end: Callable[[], None]) -> None:
        self._left = count
        self._on_end = on_end
        if not count:
            on_end()

    def count(self) -> None:
        self._left -= 1
        if not self._left:
            self._on_end()


class _Pending(NamedTuple):
    """A request to a node without a response."""

    name: str
    node: str
    client: AsyncParameterClient
    countdown: _Countdown
    limit: float
    service_call: ServiceCall
    on_response: Callable[[_Pending, object], None]


def _ros_parameter(name: str, value: object) -> Parameter | None:
    """Return a viewer's value as a ROS 2 parameter; None if it has no ROS 2 type."""
    if isinstance(value, list):
        numbers = [v for v in value if isinstance(v, int | float) and not isinstance(v, bool)]
        if value and len(numbers) == len(value):
            # A viewer sends 150.0 as 150.
            return Parameter(name, Parameter.Type.DOUBLE_ARRAY, [float(v) for v in value])
        if all(isinstance(v, str) for v in value):
            return Parameter(name, Parameter.Type.STRING_ARRAY, value)
        return None
    if isinstance(value, int) and not isinstance(value, bool) and not -(2**63) <= value < 2**63:
        return None
    return Parameter(name, value=value) if isinstance(value, bool | int | float | str) else None


def plain(value: Any) -> object:
    """Return a parameter's value for viewers: arrays as lists, infinity and NaN as text."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return [plain(element) for element in value]
