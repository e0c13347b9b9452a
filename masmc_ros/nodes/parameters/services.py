# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Parameter services that respond to every request, also to one with invalid types.

rclpy 7.1 raises ValueError for a parameter of an unknown type, and an exception from a callback
ends the node; rclcpp has the same fault (ros2/rclcpp issue 3257). This file can be removed when
rclpy's services reject such a request.
"""

from __future__ import annotations

from collections.abc import Sequence

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService

_TYPES = {kind.value: kind for kind in Parameter.Type}


class CheckedParameterService(ParameterService):
    """The parameter services of rclpy, with rejection of types unknown to ParameterType."""

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
