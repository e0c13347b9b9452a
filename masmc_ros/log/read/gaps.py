# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Gaps in the stamps of a topic that is sent at a steady rate."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from masmc_ros.aliases import Integers, Stamps
from masmc_ros.errors import InputError
from masmc_ros.messages.cdr_layout import NANOSECONDS
from masmc_ros.messages.stamps import header_stamp, in_time
from masmc_ros.messages.topics import STATE_TOPIC
import numpy as np

MISSING = 'missing_messages'
"""Metadata record: description of the gaps of each topic that has any."""

_BLOCK = 1000
"""Number of messages during which a rate counts as steady."""

_FEWEST = 20
"""Minimum number of messages from which a rate is estimated."""

_USUAL = 0.9
"""Quantile of the intervals that is no gap: joints of several drivers arrive in turns."""

_GAP = 1.5
"""Minimum ratio of a gap to the usual interval."""

_LATE = 5
"""Maximum delay of a message that others have overtaken, in usual intervals."""


class Gaps:
    """
    Gaps between the first and the last message of a topic.

    The stamps do not show whether a message was never sent, lost on its way or not received.

    Attributes
    ----------
    count
        number of gaps.
    missing
        number of messages that the rate around the gaps predicts in them.
    longest
        longest gap in ns.
    at
        stamp in ns at which it starts.
    add
        function that adds the next stamp in ns, in the order of arrival.

    """

    def __init__(self) -> None:
        """Initialise the gaps without stamps."""
        self.count = self.missing = self.longest = self.at = 0
        self._waiting: list[int] = []
        self.add = self._waiting.append

    def look(self) -> None:
        """Count the gaps in the added stamps, as far as these are enough for a rate."""
        stamps = self._waiting.copy()
        while len(stamps) >= _FEWEST:
            taken = _cut(stamps, min(_BLOCK, len(stamps) - 1))
            # The last one is the first of the next block.
            self._count(np.array(stamps[: taken + 1], np.int64))
            del stamps[:taken], self._waiting[:taken]

    def _count(self, stamps: Stamps) -> None:
        steps = np.diff(stamps)
        # A reset of the robot and a repeated message are no gaps.
        forward = steps[steps > 0]
        if not len(forward):
            return
        usual = np.quantile(forward, _USUAL, method='lower')
        if (steps < 0).any():
            stamps = _in_order(stamps, int(_LATE * usual))
            steps = np.diff(stamps)
        gaps = steps[steps > _GAP * usual]
        self.count += len(gaps)
        self.missing += int((np.rint(gaps / np.median(forward)) - 1).sum())
        if gaps.max(initial=0) > self.longest:
            worst = np.argmax(steps)
            self.longest, self.at = int(steps[worst]), int(stamps[worst])

    def text(self) -> str:
        """Return a description."""
        gaps = 'a gap' if self.count == 1 else f'{self.count} gaps'
        return (
            f'{self.missing} missing in {gaps}, the longest of {self.longest / NANOSECONDS:.3f} s'
            f' from t = {self.at / NANOSECONDS:.3f} s'
        )


def _cut(stamps: Sequence[int], end: int) -> int:
    """Return the last place up to the end that no late message crosses, if one is close."""
    for place in range(end, max(end - _FEWEST, 0), -1):
        before = stamps[max(place - _LATE, 0) : place]
        if max(before) <= stamps[place] <= min(stamps[place : place + 1 + _LATE]):
            return place
    return end


def _in_order(stamps: Stamps, late: int) -> Integers:
    """Return stamps with late ones, by at most `late` ns, in their places."""
    kept = in_time(stamps, late)
    starts = np.zeros(len(stamps), np.int64)
    starts[kept[1:]] = np.diff(stamps[kept]) < 0
    # Passes stay in their order; stamps of a pass are sorted.
    return stamps[np.lexsort((stamps, np.cumsum(starts)))]


def gaps_in(stamps: Sequence[int] | Stamps) -> Gaps:
    """Return the gaps among stamps in ns, in the order of arrival."""
    gaps = Gaps()
    gaps._waiting += np.asarray(stamps, np.int64).tolist()
    gaps.look()
    return gaps


def state_gaps(path: Path) -> dict[str, Gaps]:
    """Return the gaps of each topic of joint states of a complete log that has any."""
    # Imported here: commands without a log do not need the package.
    from mcap.reader import make_reader

    topics: dict[str, Gaps] = defaultdict(Gaps)
    with path.open('rb') as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        channels = summary.channels.values() if summary is not None else ()
        names = [c.topic for c in channels if f'/{c.topic}'.endswith(f'/{STATE_TOPIC}')]
        if names:
            for _, channel, message in reader.iter_messages(names, log_time_order=False):
                # Other recorders log the time of arrival.
                with suppress(InputError):
                    topics[channel.topic].add(header_stamp(message.data))
    for gaps in topics.values():
        gaps.look()
    return {topic: gaps for topic, gaps in topics.items() if gaps.count}
