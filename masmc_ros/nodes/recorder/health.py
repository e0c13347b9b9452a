# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The recorder's report on /diagnostics, with the gaps in its log."""

from __future__ import annotations

from collections.abc import Mapping

from masmc_ros.log.read.gaps import Gaps
from masmc_ros.log.write.recording import Recording
from masmc_ros.nodes.process.base import Health, OK, WARN

_MEGABYTE = 1_000_000


class RecorderHealth:
    """Health of a recorder with its counts; it is worse if messages were lost since the last."""

    def __init__(self, recording: Recording) -> None:
        """Initialise the health of a recording, without watched topics."""
        self._recording = recording
        self._gaps: dict[str, Gaps] = {}
        self._problems = 0

    def watch(self, topic: str) -> Gaps:
        """Return the gaps of a topic that is sent at a steady rate."""
        return self._gaps.setdefault(topic, Gaps())

    def missing(self) -> dict[str, str]:
        """Return a description of the gaps of each topic that has any."""
        return {topic: gaps.text() for topic, gaps in list(self._gaps.items()) if gaps.count}

    def look(self) -> None:
        """Count the gaps in the received messages."""
        for gaps in self._gaps.values():
            gaps.look()

    def report(self, counts: Mapping[str, int]) -> Health:
        """Return the health; `counts` are the received messages of each topic."""
        self.look()
        recording = self._recording
        lost = sum(recording.lost.values())
        missing = sum(gaps.missing for gaps in self._gaps.values())
        values = {
            'messages': str(sum(counts.values())),
            'waiting for the disk (MB)': f'{recording.backlog / _MEGABYTE:.3f}',
            'lost to the disk': str(lost),
            'missing by their stamps': str(missing),
            **{f'{topic} by its stamps': text for topic, text in self.missing().items()},
            **{f'{t} not understood': str(n) for t, n in recording.not_understood.items()},
        }
        is_worse, self._problems = lost + missing > self._problems, lost + missing
        if recording.trouble is not None:
            return Health(WARN, recording.trouble, values)
        if is_worse:
            return Health(WARN, 'messages are missing', values)
        return Health(OK, 'recording', values)
