# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Taking what is under way until nothing more comes."""

from __future__ import annotations

from collections.abc import Callable
import time

_QUIET = 0.3
"""Time in s without a message after which nothing more is under way."""

_AT_ONCE = 0.1
"""Longest time in s that counts as quiet at once."""

_LONGEST = 10.0


def take_rest(spin: Callable[[], None], last_arrival: Callable[[], float]) -> None:
    """
    Spin until it has been quiet for 0.3 s, for 10 s at most.

    `spin` handles received messages within 0.1 s; `last_arrival` is the time of the last one.
    A process that is held up hears nothing, nor does one that waited for its own messages to
    be taken: only time in which it listens is quiet.
    """
    limit = time.monotonic() + _LONGEST
    quiet = 0.0
    while quiet < _QUIET and (begun := time.monotonic()) < limit:
        latest = last_arrival()
        spin()
        listened = min(time.monotonic() - begun, _AT_ONCE)
        quiet = quiet + listened if last_arrival() == latest else 0.0
