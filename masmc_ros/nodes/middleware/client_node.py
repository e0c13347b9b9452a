# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Node of a command that talks to running nodes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from masmc_ros.nodes.middleware.log_folder import prepare_log_folder
from masmc_ros.nodes.middleware.transport import prepare_transport
import rclpy
from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions


@contextmanager
def client_node(name: str, domain: int | None = None) -> Iterator[tuple[Node, Executor]]:
    """Yield a node and its executor, in a ROS domain; None: that of the environment."""
    prepare_transport()
    prepare_log_folder()
    context = Context()
    options = SignalHandlerOptions.NO
    # Without the arguments of the command: rcl accepts only UTF-8.
    rclpy.init(args=[], context=context, domain_id=domain, signal_handler_options=options)
    node = rclpy.create_node(name, context=context, enable_rosout=False)
    executor = EventsExecutor(context=context)
    executor.add_node(node)
    try:
        yield node, executor
    finally:
        executor.remove_node(node)
        node.destroy_node()
        executor.shutdown()
        context.try_shutdown()
