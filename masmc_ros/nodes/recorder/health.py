# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The recorder's report on /diagnostics, with the gaps in its log."""

from __future__ import annotations

from collections.abc import Mapping

from masmc_ros.log.read.gaps import Gaps
from masmc_ros.log.write.recording import Recording
from masmc_ros.nodes.process.diagnostics import Health, OK, WARN

_MEGABYTE = 1_000_000


class RecorderHealth:
    """Text of the report, and whether it has become worse."""

    def __init__(self, recording: Recording) -> None:
        """Take the recording; no topic is watched yet."""
        self._recording = recording
        self._gaps: dict[str, Gaps] = {}
        self._problems = 0

    def watch(self, topic: str) -> Gaps:
        """Return what counts the gaps of a topic that comes at a steady rate."""
        return self._gaps.setdefault(topic, Gaps())

    def missing(self) -> dict[str, str]:
        """Return in words what is missing of each topic in which something is."""
        return {topic: gaps.text() for topic, gaps in list(self._gaps.items()) if gaps.count}

    def look(self) -> None:
        """Count what is missing in what has come."""
        for gaps in self._gaps.values():
            gaps.look()

    def report(self, counts: Mapping[str, int]) -> Health:
        """Return how the recorder is; `counts` are the messages of each topic that came."""
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
