# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Messages that a node refuses: counted by topic, told once a second."""

from __future__ import annotations

from collections import Counter
import time
from typing import Any

from masmc_ros.throttle import Throttle


class Refusals:
    """
    Counts what is refused, or otherwise not understood, and says why.

    Attributes
    ----------
    counts
        refused messages by topic.

    """

    def __init__(self, log: Any, what: str = 'refused') -> None:
        """Take the node's logger, and what happens to such a message."""
        self._log = log
        self._what = what
        self._throttle = Throttle(period=1.0)
        self.counts: Counter[str] = Counter()

    def add(self, topic: str, reason: object) -> None:
        """Count a message of a topic, and log the reason unless one was logged just now."""
        self.counts[topic] += 1
        if self._throttle.is_due(topic, time.monotonic()):
            self._log.error(f'{topic} {self._what}: {reason}')
