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

"""Messages that a node refuses: counted by topic, told once a second."""

from __future__ import annotations

from collections import Counter
from typing import Any

from masmc_ros.nodes.process.throttle import Throttle


class Refusals:
    """
    Counts what is refused, or otherwise not understood, and says why.

    Attributes
    ----------
    counts
        refused messages by topic.

    """

    def __init__(self, log: Any, what: str = 'refused') -> None:
        """Take the node's logger, and what happens to such a message."""
        self._log = log
        self._what = what
        self._throttle = Throttle(period=1.0)
        self.counts: Counter[str] = Counter()

    def add(self, topic: str, reason: object) -> None:
        """Count a message of a topic, and log the reason unless one was logged just now."""
        self.counts[topic] += 1
        if self._throttle.is_due(topic):
            self._log.error(f'{topic} {self._what}: {reason}')
