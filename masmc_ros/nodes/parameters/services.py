# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Services of nodes: checked parameter services, and requests that are repeated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import time
from typing import Any

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService
from rclpy.task import Future

_TYPES = {kind.value: kind for kind in Parameter.Type}


class CheckedParameterService(ParameterService):
    """
    The parameter services of rclpy, with rejection of types unknown to ParameterType.

    rclpy 7.1 raises ValueError for a parameter of an unknown type, and an exception from a
    callback ends the node; rclcpp has the same fault (ros2/rclcpp issue 3257). This class can be
    removed when rclpy's services reject such a request.
    """

    def _set_parameters_callback(
        self, request: SetParameters.Request, response: SetParameters.Response
    ) -> SetParameters.Response:
        response.results = [self._set([message]) for message in request.parameters]
        return response

    def _set_parameters_atomically_callback(
        self,
        request: SetParametersAtomically.Request,
        response: SetParametersAtomically.Response,
    ) -> SetParametersAtomically.Response:
        response.result = self._set(request.parameters)
        return response

    def _set(self, messages: Sequence[ParameterMessage]) -> SetParametersResult:
        """Set parameters together, or none of them if one is rejected."""
        for message in messages:
            if message.value.type not in _TYPES:
                return SetParametersResult(
                    successful=False,
                    reason=(
                        f'{message.name}: type {message.value.type} is unknown; expected one of '
                        f'rcl_interfaces/msg/ParameterType, {min(_TYPES)} to {max(_TYPES)}'
                    ),
                )
        try:
            return self._get_node().set_parameters_atomically(
                [Parameter.from_parameter_msg(message) for message in messages]
            )
        except ParameterNotDeclaredException as error:
            return SetParametersResult(successful=False, reason=str(error))


_RETRY = 1.0
"""Time in s after which the request is sent again."""


class ServiceCall:
    """
    A service request that is repeated until a response arrives; the server may process it twice.

    rmw_fastrtps drops the response to a client that the server does not discover within 0.1 s.
    This happens if a client sends its request as soon as it has discovered the server (ros2/ros2
    issue 1253). This class can be removed when a server waits for the client or reports the loss
    to it. The caller polls `response`, which also repeats the request.
    """

    def __init__(self, send: Callable[[], Future]) -> None:
        """Send the request for the first time, by `send`."""
        self._send = send
        self._futures = [send()]
        self._sent = time.monotonic()

    def response(self) -> Any:
        """Return the response, or None before it arrives."""
        for future in self._futures:
            if future.done():
                return future.result()
        if time.monotonic() - self._sent > _RETRY:
            self._futures.append(self._send())
            self._sent = time.monotonic()
        return None
