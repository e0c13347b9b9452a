# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Messages with their log times, before they are passed to the writing thread."""

from __future__ import annotations

from masmc_ros.log.mcap.chunks import Message
from masmc_ros.log.write.recording import Recording

_TOGETHER = 256
"""Number of messages that are passed to the writing thread together."""


class Intake:
    """
    Received messages that are not passed to the recording yet.

    A message without a stamp has the log time of the latest state; earlier messages wait for
    the first state.

    Attributes
    ----------
    latest
        stamp in ns of the latest state; None before the first.

    """

    def __init__(self, recording: Recording, most_early: float) -> None:
        """
        Initialise the intake.

        Parameters
        ----------
        recording
            the recording.
        most_early
            maximum size in bytes of the messages that wait for the first state.

        """
        self._recording = recording
        self._most_early = most_early
        self.latest: int | None = None
        self._taken: list[Message] = []
        self._early: list[tuple[int, bytes]] = []
        self._early_size = 0

    def note_state(self, stamp: int) -> None:
        """Set the time of messages without a stamp to that of a state, in ns."""
        if self.latest is None:
            self._release_early(stamp)
        self.latest = stamp

    def keep(self, channel: int, stamp: int | None, raw: bytes) -> None:
        """Keep a message with its stamp in ns, or without one, for the log."""
        time_ns = self.latest if stamp is None else stamp
        if time_ns is None:
            self._keep_early(channel, raw)
            return
        self._taken.append((channel, time_ns, raw))
        if len(self._taken) >= _TOGETHER:
            self.hand_over()

    def hand_over(self) -> None:
        """Pass the messages to the writing thread."""
        if self._taken:
            self._recording.write_all(self._taken)
            self._taken = []

    def finish(self) -> None:
        """Pass all messages, early ones too, to the writing thread."""
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
