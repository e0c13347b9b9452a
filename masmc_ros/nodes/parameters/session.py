# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Parameters of running nodes, read and set by their services.

For command-line tools: every call waits for its result, for a limited time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import os
import time
from types import TracebackType
from typing import Any

from masmc_ros.errors import suggestion, UserError
from masmc_ros.nodes.middleware.rcl_setup import prepare_rcl
from masmc_ros.nodes.parameters.services import ServiceCall
from rcl_interfaces.msg import ParameterValue, SetParametersResult
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future

_SERVICE = '/list_parameters'
_SPIN = 0.05
_DISCOVERY = 2.0
"""Time in s without a further node after which the list of nodes is complete."""


class ParameterSession:
    """A short-lived client node as a context manager."""

    def __init__(self, patience: float) -> None:
        """Create the node; `patience` is the longest time in s of each call."""
        self._patience = patience
        prepare_rcl()
        self._context = Context()
        self._clients: dict[str, AsyncParameterClient] = {}
        self._context.init([])
        # A name that starts with _ is hidden from `ros2 node list`.
        self._node = Node(
            f'_masmc_param_{os.getpid()}',
            context=self._context,
            start_parameter_services=False,
            use_global_arguments=False,
            enable_rosout=False,
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)

    def __enter__(self) -> ParameterSession:
        """Return the session."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Destroy the node."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    def nodes(self) -> list[str]:
        """Return all nodes that have parameters, after no further one is discovered."""
        nodes, since = self._visible(), time.monotonic()
        limit = since + self._patience
        while time.monotonic() < min(limit, since + (_DISCOVERY if nodes else self._patience)):
            self._executor.spin_once(_SPIN)
            current = self._visible()
            if current != nodes:
                nodes, since = current, time.monotonic()
        return nodes

    def names(self, node: str) -> list[str]:
        """Return the sorted names of a node's parameters; UserError if there is no such node."""
        response = self._call(node, lambda client: client.list_parameters([], None))
        return sorted(response.result.names)

    def values(self, node: str, names: Sequence[str]) -> list[ParameterValue]:
        """
        Return the current values, of type PARAMETER_NOT_SET for one without a value.

        Raises UserError if there is no such node or no such parameter.
        """
        known = self.names(node)
        for name in names:
            if name not in known:
                raise UserError(f"{node} has no parameter '{name}'; {suggestion(name, known)}")
        values = self._answered(node, names)
        if len(values) != len(names):
            # If one of them has no value, the service returns none of them.
            single = (self._answered(node, [name]) for name in names)
            values = [value[0] if value else ParameterValue() for value in single]
        return values

    def assign(self, node: str, parameter: Parameter) -> SetParametersResult:
        """Set a parameter; return the node's result. UserError if there is no such node."""
        response = self._call(node, lambda client: client.set_parameters([parameter]))
        return response.results[0]

    def _answered(self, node: str, names: Sequence[str]) -> list[ParameterValue]:
        response = self._call(node, lambda client: client.get_parameters(list(names)))
        return list(response.values)

    def _call(self, node: str, send: Callable[[AsyncParameterClient], Future]) -> Any:
        if node not in self._clients:
            self._clients[node] = AsyncParameterClient(self._node, node)
        client = self._clients[node]
        if not self._spin_until(client.services_are_ready):
            nodes = ', '.join(self._visible()) or 'none'
            raise UserError(
                f'no node {node} within {self._patience:g} s; nodes with parameters: {nodes}'
            )
        response = self._spin_until(ServiceCall(lambda: send(client)).response)
        if response is None:
            raise UserError(f'{node} does not answer within {self._patience:g} s')
        return response

    def _spin_until(self, condition: Callable[[], object]) -> Any:
        """Spin until a condition has a true value, or the patience is over; return the value."""
        limit = time.monotonic() + self._patience
        while not (value := condition()) and time.monotonic() <= limit:
            self._executor.spin_once(_SPIN)
        return value

    def _visible(self) -> list[str]:
        # ROS lists a service that has only a client, such as this node's: the node must exist too.
        names = self._node.get_node_names_and_namespaces()
        nodes = {f'{namespace.rstrip("/")}/{name}' for name, namespace in names}
        services = {name for name, _ in self._node.get_service_names_and_types()}
        return sorted(n for n in nodes if '/_' not in n and f'{n}{_SERVICE}' in services)
