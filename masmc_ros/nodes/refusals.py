# SPDX-License-Identifier: Apache-2.0
"""Messages that a node refuses: counted by topic, told once a second."""

from __future__ import annotations

from collections import Counter
import time
from typing import Any

_QUIET = 1.0
"""Least time in s between two lines about the same topic."""


class Refusals:
    """Counts what is refused and says why.

    Attributes:
        counts: refused messages by topic.
    """

    def __init__(self, log: Any) -> None:
        """Take the node's logger."""
        self._log = log
        self._told: dict[str, float] = {}
        self.counts: Counter[str] = Counter()

    def add(self, topic: str, reason: object) -> None:
        """Count a message of a topic, and log the reason unless one was logged just now."""
        self.counts[topic] += 1
        now = time.monotonic()
        if now - self._told.get(topic, -_QUIET) >= _QUIET:
            self._told[topic] = now
            self._log.error(f'{topic} refused: {reason}')
