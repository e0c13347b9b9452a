# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
