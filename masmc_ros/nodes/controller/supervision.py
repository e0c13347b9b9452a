# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The controller's services, and the topic that tells whether it is active."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from masmc_ros.loop.supervisor import FAULT, Supervisor
from masmc_ros.nodes.middleware.latched import Latched
from rclpy.node import Node
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger


class Supervision:
    """A supervisor with its services: enable, emergency_stop, clear_fault, reset_adaptation."""

    def __init__(
        self,
        node: Node,
        supervisor: Supervisor,
        publisher: Latched,
        *,
        reset: Callable[[], None],
        stopped: Callable[[], None],
    ) -> None:
        """
        Create the services and publish the state.

        `reset` forgets what was learned; `stopped` is called when torque is no longer
        computed.
        """
        self._log = node.get_logger()
        self._supervisor = supervisor
        self._publisher = publisher
        self._reset = reset
        self._stopped = stopped
        self._told = ''
        self._was_active = False
        node.create_service(SetBool, '~/enable', self._on_enable)
        node.create_service(Trigger, '~/emergency_stop', self._on_stop)
        node.create_service(Trigger, '~/clear_fault', self._on_clear)
        node.create_service(Trigger, '~/reset_adaptation', self._on_reset)
        self.tell()

    def tell(self) -> None:
        """Publish and log the state where it has changed."""
        supervisor = self._supervisor
        text = supervisor.text
        if text == self._told:
            return
        if supervisor.state == FAULT:
            self._log.error(text)
        elif self._told:
            self._log.info(text)
        self._told = text
        self._publisher.publish(String(data=text))
        if self._was_active and not supervisor.is_active:
            self._stopped()
        self._was_active = supervisor.is_active

    def fail(self, cause: str, reason: str, *, is_latched: bool = False) -> None:
        """Note a fault and tell it."""
        if self._supervisor.fail(cause, reason, is_latched=is_latched):
            self.tell()

    def recover(self, cause: str, *, is_anew: bool) -> None:
        """Become active again where a passing fault of this cause stands."""
        if self._supervisor.recover(cause, is_anew=is_anew):
            self.tell()

    def _answer(self, response: Any, *, success: bool = True, message: str = '') -> Any:
        self.tell()
        response.success = success
        response.message = message or self._supervisor.text
        return response

    def _on_enable(self, request: Any, response: Any) -> Any:
        if request.data:
            self._supervisor.enable()
        else:
            self._supervisor.disable()
        return self._answer(response)

    def _on_stop(self, _: Any, response: Any) -> Any:
        self._supervisor.stop()
        return self._answer(response)

    def _on_clear(self, _: Any, response: Any) -> Any:
        if self._supervisor.clear():
            return self._answer(response)
        message = f'{self._supervisor.text}; there is no fault'
        return self._answer(response, success=False, message=message)

    def _on_reset(self, _: Any, response: Any) -> Any:
        self._reset()
        return self._answer(response, message='theta_hat is that of the nominal model')
