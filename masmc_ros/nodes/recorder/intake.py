# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Reception of messages: those of the robot, their log times, and the last ones of a run."""

from __future__ import annotations

from collections.abc import Callable
import time

from masmc_ros.log.codec import Message
from masmc_ros.log.write.recording import Recording
from masmc_ros.messages.topics import TRANSFORMS, transforms_topic
from masmc_ros.messages.transforms import first_frames, first_names, is_of_robot
from rclpy.node import Node

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


class OwnFrames:
    """Frames of the robot, which have its prefix."""

    def __init__(self, node: Node, prefix: str) -> None:
        """Initialise the frames for a node in the robot's namespace and the prefix of names."""
        self._node, self._log = node, node.get_logger()
        self._prefix = prefix
        self._names = first_names(prefix)

    @property
    def topic(self) -> str:
        """Return the full name of their topic."""
        return transforms_topic(self._node.get_namespace(), self._prefix)

    def are_in(self, raw: bytes) -> bool:
        """Return True if a TFMessage is from this robot; log the first one that is not."""
        if raw.startswith(*self._names) or is_of_robot(raw, self._prefix):
            return True
        parent, child = first_frames(raw)
        self._log.info(
            f'{TRANSFORMS.name}: frames of others, such as {parent} to {child}, are not recorded',
            once=True,
        )
        return False

    def go_by(self, prefix: object) -> None:
        """Use the prefix of the plant."""
        if not isinstance(prefix, str) or prefix == self._prefix:
            return
        recorded = self.topic
        self._prefix, self._names = prefix, first_names(prefix)
        if recorded != self.topic:
            self._log.warning(
                f'the plant sends its frames on {self.topic} (frame_prefix {prefix!r}), and what '
                f'is recorded is {recorded}; give the recorder the same frame_prefix'
            )


_QUIET = 0.3
"""Time in s without a message after which all messages have arrived."""

_AT_ONCE = 0.1
"""Maximum time in s of one call that counts as quiet."""

_LONGEST = 10.0
"""Maximum time in s of the reception."""


def take_rest(spin: Callable[[], None], last_arrival: Callable[[], float]) -> None:
    """
    Spin until it has been quiet for 0.3 s, for 10 s at most.

    `spin` handles received messages within 0.1 s; `last_arrival` returns the time of the last one.
    Only the time in `spin` counts, because a delayed process receives nothing.
    """
    limit = time.monotonic() + _LONGEST
    quiet = 0.0
    while quiet < _QUIET and (start := time.monotonic()) < limit:
        latest = last_arrival()
        spin()
        listened = min(time.monotonic() - start, _AT_ONCE)
        quiet = quiet + listened if last_arrival() == latest else 0.0
