# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Reception of the last messages at the end of a recording."""

from __future__ import annotations

from collections.abc import Callable
import time

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
