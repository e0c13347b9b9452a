# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Progress of the recording, reported to the plant, which waits for it in lock-step."""

from __future__ import annotations

from collections.abc import Callable

from builtin_interfaces.msg import Time
from masmc_ros.log.write.recording import Recording
from masmc_ros.messages.cdr_layout import NANOSECONDS
from masmc_ros.nodes.recorder.coverage import Coverage

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
