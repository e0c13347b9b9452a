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

"""The subscription to /clock by which rclpy sets a node's time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.nodes.middleware.messages import deserialized
from rosgraph_msgs.msg import Clock

_PERIOD = 1.0
"""Time in s between two log lines about rejected messages."""


def clock_reader(callback: Callable[[Any], None], log: Any) -> Callable[[bytes], None]:
    """
    Return a callback for raw messages that passes on those which are a time.

    The time source of rclpy raises for negative times, and its typed subscription for bytes
    that are no message. Either would end the node.
    """

    def read(raw: bytes) -> None:
        try:
            message = deserialized(raw, Clock)
            if message.clock.sec < 0:
                raise InputError(f'{message.clock.sec} s is negative; expected >= 0')
        except InputError as error:
            log.error(f'/clock rejected: {error}', throttle_duration_sec=_PERIOD)
            return
        callback(message)

    return read
