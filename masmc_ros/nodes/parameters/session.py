# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Parameters of nodes that run elsewhere, read and set by their services.

For short-lived commands: every call waits, at most for a specified time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import os
import time
from types import TracebackType
from typing import Any

from masmc_ros.errors import suggestion, UserError
from masmc_ros.nodes.middleware.transport import prepare_transport
from masmc_ros.nodes.parameters.service_call import ServiceCall
from rcl_interfaces.msg import ParameterValue, SetParametersResult
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future

_SERVICE = '/list_parameters'
_SPIN = 0.05
_STEADY = 2.0
"""Time in s in which no further node turns up until they are taken for all."""


class ParameterSession:
    """A short-lived node that asks others; a context manager."""

    def __init__(self, patience: float) -> None:
        """Join the graph; `patience` is the longest time in s that anything may take."""
        self._patience = patience
        prepare_transport()
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
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    def nodes(self) -> list[str]:
        """Return all nodes that have parameters, once no further one turns up."""
        found, since = self._visible(), time.monotonic()
        limit = since + self._patience
        while time.monotonic() < min(limit, since + (_STEADY if found else self._patience)):
            self._executor.spin_once(_SPIN)
            now = self._visible()
            if now != found:
                found, since = now, time.monotonic()
        return found

    def names(self, node: str) -> list[str]:
        """Return the sorted names of a node's parameters; UserError where there is no node."""
        answer = self._answer(node, lambda client: client.list_parameters([], None))
        return sorted(answer.result.names)

    def values(self, node: str, names: Sequence[str]) -> list[ParameterValue]:
        """
        Return the current values.

        Raises UserError where there is no such node, or where it has no such parameter.
        """
        known = self.names(node)
        for name in names:
            if name not in known:
                raise UserError(f"{node} has no parameter '{name}'; {suggestion(name, known)}")
        answer = self._answer(node, lambda client: client.get_parameters(list(names)))
        return list(answer.values)

    def assign(self, node: str, parameter: Parameter) -> SetParametersResult:
        """Set a parameter; return what the node says. UserError where there is no node."""
        answer = self._answer(node, lambda client: client.set_parameters([parameter]))
        return answer.results[0]

    def _answer(self, node: str, ask: Callable[[AsyncParameterClient], Future]) -> Any:
        if node not in self._clients:
            self._clients[node] = AsyncParameterClient(self._node, node)
        client = self._clients[node]
        if not self._come(client.services_are_ready):
            there = ', '.join(self._visible()) or 'none'
            raise UserError(
                f'no node {node} within {self._patience:g} s; nodes with parameters: {there}'
            )
        answer = self._come(ServiceCall(lambda: ask(client)).answer)
        if answer is None:
            raise UserError(f'{node} does not answer within {self._patience:g} s')
        return answer

    def _come(self, what: Callable[[], Any]) -> Any:
        """Spin until something is true, and return it; what it is then where it never is."""
        limit = time.monotonic() + self._patience
        while not (found := what()) and time.monotonic() <= limit:
            self._executor.spin_once(_SPIN)
        return found

    def _visible(self) -> list[str]:
        # Services alone are no proof: one with only a client, such as this node, is listed.
        here = self._node.get_node_names_and_namespaces()
        nodes = {f'{namespace.rstrip("/")}/{name}' for name, namespace in here}
        services = {name for name, _ in self._node.get_service_names_and_types()}
        return sorted(n for n in nodes if '/_' not in n and f'{n}{_SERVICE}' in services)
