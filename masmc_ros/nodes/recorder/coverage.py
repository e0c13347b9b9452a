# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Up to where a recorder has everything of a run that comes with the ticks.

A message that is lost on its way is repeated by its sender, which can take the three seconds
of Fast DDS's heartbeat, while other topics go on. A plant that followed those would send on
until the lost message has left its sender's history: it is to follow the one furthest behind.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
import time

_MISSED = 4.0
"""Time in s after which a topic that is behind has come to its end, not just to a gap."""


@dataclass
class _Topic:
    last: int
    step: int = 0
    """Between its last two stamps in ns; 0 while it is not known when the next is due."""
    behind_since: float | None = None


class Coverage:
    """
    Stamps in ns of what came last.

    Attributes
    ----------
    answered
        of the last command; -1 for none.

    """

    def __init__(self) -> None:
        """Begin with nothing."""
        self._state = self.answered = -1
        self._topics: dict[str, _Topic] = {}

    def add_state(self, stamp: int) -> None:
        """Note a state; where the robot was set back, everything is expected from there on."""
        if stamp < self._state:
            for topic in self._topics.values():
                topic.last = stamp - topic.step
        self._state = stamp

    def add(self, name: str, stamp: int) -> None:
        """Note a message of a topic that comes with the ticks, or every few of them."""
        topic = self._topics.get(name)
        if topic is None:
            self._topics[name] = _Topic(stamp)
            return
        topic.step = max(0, stamp - topic.last)
        topic.last = stamp
        topic.behind_since = None

    def forget(self, names: Iterable[str]) -> None:
        """Expect no more of some topics until they come again."""
        for name in names:
            self._topics.pop(name, None)

    def reached(self) -> int:
        """Return the stamp up to which states, commands and all else have come."""
        reached = min(self._state, self.answered)
        for topic in self._topics.values():
            if not topic.step or topic.last + topic.step >= reached:
                continue
            now = time.monotonic()
            topic.behind_since = since = topic.behind_since or now
            if now - since > _MISSED:
                topic.step = 0
            else:
                reached = topic.last + topic.step
        return reached
