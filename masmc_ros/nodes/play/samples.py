# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Samples of the page: latest messages of topics, and moving windows of time."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator

from masmc_ros.aliases import Array
import numpy as np
from numpy.typing import ArrayLike
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

WINDOW = 20.0
"""Length of the window in s of robot time."""

_SPAN = 3.0
"""Length of the window in s of real time for the speed of the robot's time."""


class SampleWindow:
    """
    Vectors with their times over the last `WINDOW` seconds; the memory is bounded.

    Attributes
    ----------
    times
        Times (k) in s, strictly increasing.
    values
        Vectors (k, width).

    """

    def __init__(self, width: int, most: int) -> None:
        """
        Initialise an empty window.

        Parameters
        ----------
        width
            Number of components of a vector.
        most
            Largest number of samples; the oldest are dropped.

        """
        self._most = most
        self.times: Array = np.zeros(0)
        self.values: Array = np.zeros((0, width))

    def append(self, time: float, vector: ArrayLike) -> None:
        """
        Append a vector (width) at a time in s.

        A sample at the last time is ignored: the robot is paused. An earlier time clears the
        window: the robot was reset.
        """
        if len(self.times) and time == self.times[-1]:
            return
        if len(self.times) and time < self.times[-1]:
            self.times, self.values = self.times[:0], self.values[:0]
        first = int(np.searchsorted(self.times, time - WINDOW))
        first = max(first, len(self.times) - self._most + 1)
        self.times = np.append(self.times[first:], time)
        self.values = np.vstack((self.values[first:], np.asarray(vector)[None]))

    def marks(self, times: Iterable[float]) -> Array:
        """Return 1 at the samples (k) that follow these times in s first, 0 elsewhere."""
        marks = np.zeros(len(self.times))
        places = np.searchsorted(self.times, list(times))
        marks[places[(places > 0) & (places < len(marks))]] = 1.0
        return marks


class TimeSpeed:
    """Speed of the robot's time relative to real time, over the last `_SPAN` seconds."""

    def __init__(self) -> None:
        """Initialise without a time."""
        self._times: deque[tuple[float, float]] = deque()

    def add(self, now: float, robot_time: float) -> None:
        """
        Add the robot's time in s at a monotonic time `now` in s.

        An earlier time of the robot clears the window: the robot was reset.
        """
        times = self._times
        if times and robot_time < times[-1][1]:
            times.clear()
        times.append((now, robot_time))
        while now - times[0][0] > _SPAN:
            times.popleft()

    @property
    def text(self) -> str:
        """Line about the speed; empty within the first second."""
        if not self._times:
            return ''
        (start, first), (end, last) = self._times[0], self._times[-1]
        if end - start < 1.0:
            return ''
        return f'time at {(last - first) / (end - start):.1f} of real time'


_LATEST = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)


class Sampler:
    """
    Periodic samples of topics with a message at every tick.

    A viewer does not need 1 kHz. The middleware keeps the latest message and discards the others
    without Python. The subscriptions have no callbacks and are on a hidden node without an
    executor. They are best-effort, so the senders repeat nothing for them.
    """

    def __init__(self, node: Node) -> None:
        """Create the hidden node in the context and namespace of `node`."""
        self._node = Node(
            f'_{node.get_name()}_samples',
            context=node.context,
            namespace=node.get_namespace(),
            # The names of the topics are already resolved.
            use_global_arguments=False,
            start_parameter_services=False,
            enable_rosout=False,
        )
        self._subscriptions: dict[str, Subscription] = {}

    def add(self, message_type: type, topic: str) -> None:
        """Subscribe to a topic by its full name."""
        self._subscriptions[topic] = self._node.create_subscription(
            message_type, topic, lambda _: None, _LATEST, raw=True
        )

    def take(self) -> Iterator[tuple[str, bytes]]:
        """Yield topics that have a new message, each with its latest one."""
        for topic, subscription in self._subscriptions.items():
            with subscription.handle:
                result = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if result is not None:
                yield topic, result[0]

    def close(self) -> None:
        """Destroy the hidden node."""
        self._node.destroy_node()
