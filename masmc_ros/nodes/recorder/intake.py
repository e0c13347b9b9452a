# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Messages on their way to the thread that writes, with the times that the log has them at."""

from __future__ import annotations

from masmc_ros.log.mcap.chunks import Message
from masmc_ros.log.write.recording import Recording

_TOGETHER = 256
"""Messages that are handed to the thread that writes at once."""


class Intake:
    """
    What has come and is not handed over yet.

    A message without a stamp has the log time of the latest state; what comes before the first
    one waits for it.

    Attributes
    ----------
    latest
        stamp in ns of the latest state, None before the first.

    """

    def __init__(self, recording: Recording, most_early: float) -> None:
        """Take the recording, and how many bytes may wait for the first state."""
        self._recording = recording
        self._most_early = most_early
        self.latest: int | None = None
        self._taken: list[Message] = []
        self._early: list[tuple[int, bytes]] = []
        self._early_size = 0

    def note_state(self, stamp: int) -> None:
        """Take a state's stamp in ns for the time of what has none."""
        if self.latest is None:
            self._release_early(stamp)
        self.latest = stamp

    def keep(self, channel: int, stamp: int | None, raw: bytes) -> None:
        """Keep a message of a stamp in ns, or without one, for the log."""
        time_ns = self.latest if stamp is None else stamp
        if time_ns is None:
            self._keep_early(channel, raw)
            return
        self._taken.append((channel, time_ns, raw))
        if len(self._taken) >= _TOGETHER:
            self.hand_over()

    def hand_over(self) -> None:
        """Hand what has come to the thread that writes."""
        if self._taken:
            self._recording.write_all(self._taken)
            self._taken = []

    def finish(self) -> None:
        """Hand over everything."""
        self._release_early(self.latest or 0)
        self.hand_over()

    def _keep_early(self, channel: int, raw: bytes) -> None:
        self._early.append((channel, raw))
        self._early_size += len(raw)
        if self._early_size > self._most_early:
            self.latest = 0
            self._release_early(0)

    def _release_early(self, stamp: int) -> None:
        self._taken += [(channel, stamp, raw) for channel, raw in self._early]
        self._early.clear()
        self._early_size = 0
