# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Lines about the disk: when it takes nothing, and when messages are lost."""

from __future__ import annotations

from typing import Any

from masmc_ros.log.write.recording import Recording


class DiskWatch:
    """Says what is new since the last look."""

    def __init__(self, recording: Recording, queue_size: float, log: Any) -> None:
        """Take the recording, how many MB may wait for the disk, and the node's logger."""
        self._recording, self._queue_size, self._log = recording, queue_size, log
        self._told_trouble: str | None = None
        self._told_lost = 0

    def look(self) -> None:
        """Say when the disk takes nothing, when messages are lost, and when that is over."""
        recording, log = self._recording, self._log
        trouble = recording.trouble
        if trouble != self._told_trouble:
            self._told_trouble = trouble
            if trouble is not None:
                log.error(
                    f'{recording.path}: {trouble}; up to {self._queue_size:g} MB of'
                    ' messages are kept until there is space again'
                )
            else:
                log.info(f'{recording.path}: the disk takes messages again')
        lost = sum(recording.lost.values())
        if lost > self._told_lost:
            self._told_lost = lost
            log.error(
                f'{lost} messages lost so far: the disk does not keep up with them',
                throttle_duration_sec=1.0,
            )
