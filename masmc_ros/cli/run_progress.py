# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Progress of a run on real nodes, from the stamps of odom."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
import os

from masmc_ros.errors import InputError
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.nodes.middleware.log_folder import prepare_log_folder
from masmc_ros.nodes.middleware.transport import prepare_transport
from nav_msgs.msg import Odometry
import rclpy
from rclpy.context import Context
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions


@contextmanager
def run_progress(domain: int) -> Iterator[Callable[[], float]]:
    """Yield a function that returns the time of a run in s, after at most 0.1 s of waiting."""
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    prepare_transport()
    prepare_log_folder()
    context = Context()
    options = SignalHandlerOptions.NO
    # Without the arguments of the command: rcl accepts only UTF-8.
    rclpy.init(args=[], context=context, domain_id=domain, signal_handler_options=options)
    node = rclpy.create_node('progress', context=context, enable_rosout=False)
    executor = EventsExecutor(context=context)
    executor.add_node(node)
    stamp = 0

    def on_odometry(raw: bytes) -> None:
        nonlocal stamp
        with suppress(InputError):  # odometry of a third-party node
            stamp = header_stamp(raw)

    def time() -> float:
        executor.spin_once(timeout_sec=0.1)
        return stamp * 1e-9

    node.create_subscription(Odometry, 'odom', on_odometry, QoSProfile(depth=1), raw=True)
    try:
        yield time
    finally:
        executor.remove_node(node)
        node.destroy_node()
        executor.shutdown()
        context.try_shutdown()
