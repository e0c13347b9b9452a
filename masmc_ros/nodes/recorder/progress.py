# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Progress of the recording, reported to the plant, which waits for it in lock-step.

A lost message is repeated by its sender, which can take the three seconds of Fast DDS's
heartbeat, while other topics continue. A plant that followed the other topics would continue until
the lost message has left its sender's history. Therefore it follows the topic furthest behind.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
import time

from builtin_interfaces.msg import Time
from masmc_ros.log.write.recording import Recording
from masmc_ros.messages.cdr_layout import NANOSECONDS

_MISSED = 4.0
"""Time in s after which a topic that is behind has ended."""


@dataclass
class _Topic:
    last: int
    step: int = 0
    """Interval of its last two stamps in ns; 0 if the next stamp is unknown."""
    behind_since: float | None = None


class Coverage:
    """
    Latest stamps in ns.

    Attributes
    ----------
    answered
        stamp of the last command; -1 before the first.

    """

    def __init__(self) -> None:
        """Initialise without messages."""
        self._state = self.answered = -1
        self._topics: dict[str, _Topic] = {}

    def add_state(self, stamp: int) -> None:
        """Note a state; after a reset of the robot, all topics are expected from its stamp."""
        if stamp < self._state:
            for topic in self._topics.values():
                topic.last = stamp - topic.step
        self._state = stamp

    def add(self, name: str, stamp: int) -> None:
        """Note a message of a topic that is sent at every tick, or every few ticks."""
        topic = self._topics.get(name)
        if topic is None:
            self._topics[name] = _Topic(stamp)
            return
        topic.step = max(0, stamp - topic.last)
        topic.last = stamp
        topic.behind_since = None

    def forget(self, names: Iterable[str]) -> None:
        """Expect no messages of some topics until the next one."""
        for name in names:
            self._topics.pop(name, None)

    def reached(self) -> int:
        """Return the stamp up to which states, commands and all other topics have arrived."""
        reached = min(self._state, self.answered)
        for topic in self._topics.values():
            if not topic.step or topic.last + topic.step >= reached:
                continue
            time_s = time.monotonic()
            topic.behind_since = topic.behind_since or time_s
            if time_s - topic.behind_since > _MISSED:
                topic.step = 0
            else:
                reached = topic.last + topic.step
        return reached


_EVERY = 100
"""Answered states between two reports of progress."""


class Progress:
    """
    Reports of the time up to which all messages have arrived.

    Attributes
    ----------
    coverage
        coverage of the topics.

    """

    def __init__(self, recording: Recording, publish: Callable[[Time], None]) -> None:
        """Initialise the reports of a recording, which `publish` sends."""
        self._recording, self._publish = recording, publish
        self.coverage = Coverage()
        self._reported = -1
        self._unreported = 0

    def add_answer(self, stamp: int) -> None:
        """Note that the state with a stamp in ns is answered."""
        self.coverage.answered = stamp
        self._unreported += 1
        if self._unreported >= _EVERY:
            self.report()

    def report(self) -> None:
        """Report the time up to which all has arrived, if it has changed and the disk keeps up."""
        reached = self.coverage.reached()
        if reached != self._reported and not self._recording.is_congested:
            self._report(reached)

    def start(self) -> None:
        """Report for the first time that the recorder is ready."""
        self._report(self.coverage.reached())

    def _report(self, reached: int) -> None:
        self._unreported = 0
        self._reported = reached
        seconds, nanoseconds = divmod(max(reached, 0), NANOSECONDS)
        self._publish(Time(sec=seconds, nanosec=nanoseconds))
