# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Progress of a run on real nodes, from the stamps of odom."""

from __future__ import annotations

from contextlib import suppress
import os
from types import TracebackType

from masmc_ros.errors import InputError
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.nodes.middleware.transport import prepare_transport
from nav_msgs.msg import Odometry
import rclpy
from rclpy.context import Context
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions


class RunProgress:
    """Context manager that subscribes to a run in a domain of this machine."""

    def __init__(self, domain: int) -> None:
        """Initialise the node in a domain."""
        os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
        self._time = 0.0
        prepare_transport()
        self._context = Context()
        rclpy.init(
            context=self._context,
            domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        self._node = rclpy.create_node('progress', context=self._context, enable_rosout=False)
        self._node.create_subscription(
            Odometry, 'odom', self._on_odometry, QoSProfile(depth=1), raw=True
        )
        self._executor = EventsExecutor(context=self._context)
        self._executor.add_node(self._node)

    def time(self) -> float:
        """Return the time of the run in s, after at most 0.1 s for a message."""
        self._executor.spin_once(timeout_sec=0.1)
        return self._time

    def _on_odometry(self, raw: bytes) -> None:
        with suppress(InputError):  # odometry of a third-party node
            self._time = header_stamp(raw) * 1e-9

    def __enter__(self) -> RunProgress:
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave the domain."""
        self._executor.remove_node(self._node)
        self._node.destroy_node()
        self._executor.shutdown()
        self._context.try_shutdown()
