# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Messages that are missing from a topic that is sent at a steady rate, by their stamps."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from masmc_ros.control.stamp_order import in_time
from masmc_ros.messages.layout import NANOSECONDS
from masmc_ros.messages.names import STATE_TOPIC
from mcap.reader import make_reader
import numpy as np
from numpy.typing import NDArray

MISSING = 'missing_messages'
"""Metadata record: what is missing of each topic in which something is."""

_BLOCK = 1000
"""Messages over which a rate is taken for steady."""

_FEWEST = 20
"""Messages that tell a rate."""

_USUAL = 0.9
"""Share of the intervals that are no gaps: joints of several drivers come in turns."""

_GAP = 1.5
"""Times the usual interval from which on something is missing."""

_LATE = 5
"""Usual intervals by which a message may be late that others have overtaken."""


class Gaps:
    """
    Counts what is missing between the first and the last message of a topic.

    Whether it was never sent, lost on its way or not taken, the stamps do not tell.

    Attributes
    ----------
    count
        gaps.
    missing
        messages that would have come in them at the rate around them.
    longest
        the longest interval between two messages in ns, of those that are gaps.
    at
        stamp in ns at which that begins.

    """

    def __init__(self) -> None:
        """Begin with nothing."""
        self.count = self.missing = self.longest = self.at = 0
        self._waiting: list[int] = []
        self.add = self._waiting.append
        """Take the next stamp in ns, in the order of arrival; looked at by `look`."""

    def look(self) -> None:
        """Count in what has come, where it is enough to tell a rate."""
        stamps = self._waiting.copy()
        while len(stamps) >= _FEWEST:
            taken = _cut(stamps, min(_BLOCK, len(stamps) - 1))
            # The last one is the first of the next block.
            self._count(np.array(stamps[: taken + 1], np.int64))
            del stamps[:taken], self._waiting[:taken]

    def _count(self, stamps: NDArray[np.int64]) -> None:
        steps = np.diff(stamps)
        # A robot that is set back, and a message that comes twice, leave no gap.
        forward = steps[steps > 0]
        if not len(forward):
            return
        usual = np.quantile(forward, _USUAL, method='lower')
        if (steps < 0).any():
            stamps = _in_order(stamps, int(_LATE * usual))
            steps = np.diff(stamps)
        found = np.flatnonzero(steps > _GAP * usual)
        if not len(found):
            return
        self.count += len(found)
        self.missing += int((np.rint(steps[found] / np.median(forward)) - 1).sum())
        worst = found[np.argmax(steps[found])]
        if steps[worst] > self.longest:
            self.longest, self.at = int(steps[worst]), int(stamps[worst])

    def text(self) -> str:
        """Return it in words."""
        gaps = 'a gap' if self.count == 1 else f'{self.count} gaps'
        return (
            f'{self.missing} missing in {gaps}, the longest of {self.longest / NANOSECONDS:.3f} s'
            f' from t = {self.at / NANOSECONDS:.3f} s'
        )


def _cut(stamps: Sequence[int], end: int) -> int:
    """Return a place up to the end, and close to it, that nobody who is late comes across."""
    for place in range(end, max(end - _FEWEST, 0), -1):
        before = stamps[max(place - _LATE, 0) : place]
        if max(before) <= stamps[place] <= min(stamps[place : place + 1 + _LATE]):
            return place
    return end


def _in_order(stamps: NDArray[np.int64], late: int) -> NDArray[np.int64]:
    """Return stamps with those that came late, by so many ns at most, where they belong."""
    kept = in_time(stamps, late)
    begins = np.zeros(len(stamps), np.int64)
    begins[kept[1:]] = np.diff(stamps[kept]) < 0
    # One pass after the other, each by its stamps.
    return stamps[np.lexsort((stamps, np.cumsum(begins)))]


def gaps_in(stamps: Sequence[int] | NDArray[np.int64]) -> Gaps:
    """Return the gaps among stamps in ns, in the order of arrival."""
    gaps = Gaps()
    for stamp in np.asarray(stamps, np.int64).tolist():
        gaps.add(stamp)
    gaps.look()
    return gaps


def state_gaps(path: Path) -> dict[str, Gaps]:
    """Return the gaps of each topic of joint states of a complete log that has any."""
    found: dict[str, Gaps] = defaultdict(Gaps)
    with path.open('rb') as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        channels = summary.channels.values() if summary is not None else ()
        topics = [c.topic for c in channels if f'/{c.topic}'.endswith(f'/{STATE_TOPIC}')]
        if topics:
            for _, channel, message in reader.iter_messages(topics, log_time_order=False):
                found[channel.topic].add(message.log_time)
    for gaps in found.values():
        gaps.look()
    return {topic: gaps for topic, gaps in found.items() if gaps.count}
