# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Messages that a node rejects: counted by topic, logged at most once a second."""

from __future__ import annotations

from collections import Counter
import time

from masmc_ros.throttle import Throttle
from rclpy.impl.rcutils_logger import RcutilsLogger


class RejectedMessages:
    """
    Count and log of messages that a node rejects or cannot read.

    Attributes
    ----------
    counts
        Number of rejected messages by topic.

    """

    def __init__(self, log: RcutilsLogger, effect: str = 'rejected') -> None:
        """Initialise with the node's logger and the effect on such a message, for the log."""
        self._log = log
        self._effect = effect
        self._throttle = Throttle(period=1.0)
        self.counts: Counter[str] = Counter()

    @property
    def total(self) -> int:
        """Return the number of rejected messages of all topics."""
        return sum(self.counts.values())

    def figures(self) -> dict[str, str]:
        """Return the counts by topic for /diagnostics."""
        return {f'{topic} rejected': str(count) for topic, count in self.counts.items()}

    def add(self, topic: str, reason: object) -> None:
        """Count a message of a topic; log the reason unless the last line is less than 1 s old."""
        self.counts[topic] += 1
        if self._throttle.is_due(topic, time.monotonic()):
            self._log.error(f'{topic} {self._effect}: {reason}')
