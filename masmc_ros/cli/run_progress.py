# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Progress of a run on real nodes, from the stamps of odom."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
import os

from masmc_ros.errors import InputError
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.nodes.middleware.rcl_setup import client_node
from nav_msgs.msg import Odometry
from rclpy.qos import QoSProfile


@contextmanager
def run_progress(domain: int) -> Iterator[Callable[[], float]]:
    """Yield a function that returns the time of a run in s, after at most 0.1 s of waiting."""
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    stamp = 0

    def on_odometry(raw: bytes) -> None:
        nonlocal stamp
        with suppress(InputError):  # odometry of a third-party node
            stamp = header_stamp(raw)

    with client_node('progress', domain) as (node, executor):

        def time() -> float:
            executor.spin_once(timeout_sec=0.1)
            return stamp * 1e-9

        node.create_subscription(Odometry, 'odom', on_odometry, QoSProfile(depth=1), raw=True)
        yield time
