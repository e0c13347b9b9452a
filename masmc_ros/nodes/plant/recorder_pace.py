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

"""How far the recorder has come: lock-step must not run ahead of it by more than its queues."""

from __future__ import annotations

import time
from typing import Any

_AHEAD = 800
"""Ticks that lock-step may be ahead of what the recorder has written; its queues are deeper."""

_PATIENCE = 5.0
"""Time in s after which a silent recorder no longer holds up lock-step."""


class RecorderPace:
    """What the recorder has reported, and whether to wait for it."""

    def __init__(self, log: Any) -> None:
        """Take the node's logger; no recorder has reported yet."""
        self._log = log
        self._reached: int | None = None
        self._reported = 0.0
        self._waiting_since: float | None = None

    @property
    def is_there(self) -> bool:
        """Whether a recorder has reported, and was not given up."""
        return self._reached is not None

    def note(self, reached: int, tick: int) -> None:
        """Note up to which tick it has recorded, while the robot is at `tick`."""
        self._reported = time.monotonic()
        # What was reported before a reset, or to a plant before this one, is not of this run.
        self._reached = min(reached, tick)

    def set_back(self) -> None:
        """Let it have recorded nothing of a run that begins anew."""
        if self._reached is not None:
            self._reached = 0

    def holds_up(self, tick: int) -> bool:
        """Tell whether tick must wait for it; one that stays silent is given up."""
        if self._reached is None:
            return False
        if tick - self._reached <= _AHEAD:
            self._waiting_since = None
            return False
        now = time.monotonic()
        # A slow run may take longer than its patience to get so far ahead.
        self._waiting_since = since = self._waiting_since or now
        if now - max(since, self._reported) < _PATIENCE:
            return True
        self._log.warning('the recorder does not answer; going on without it')
        self._reached = self._waiting_since = None
        return False
