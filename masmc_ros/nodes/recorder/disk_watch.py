# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Log lines about a disk that cannot be written, and about lost messages."""

from __future__ import annotations

from masmc_ros.log.write.recording import Recording
from rclpy.impl.rcutils_logger import RcutilsLogger


class DiskWatch:
    """Log lines when the disk fails, when it recovers, and when messages are lost."""

    def __init__(self, recording: Recording, queue_size: float, log: RcutilsLogger) -> None:
        """
        Initialise the watch.

        Parameters
        ----------
        recording
            the recording.
        queue_size
            maximum size in MB of the messages that wait for the disk.
        log
            logger of the node.

        """
        self._recording, self._queue_size, self._log = recording, queue_size, log
        self._logged_trouble: str | None = None
        self._logged_lost = 0

    def look(self) -> None:
        """Log a failure of the disk, its end, and lost messages, once per change."""
        recording, log = self._recording, self._log
        trouble = recording.trouble
        if trouble != self._logged_trouble:
            self._logged_trouble = trouble
            if trouble is not None:
                log.error(
                    f'{recording.path}: {trouble}; up to {self._queue_size:g} MB of'
                    ' messages are kept until there is space again'
                )
            else:
                log.info(f'{recording.path}: the disk takes messages again')
        lost = sum(recording.lost.values())
        if lost > self._logged_lost:
            self._logged_lost = lost
            log.error(
                f'{lost} messages lost so far: the disk does not keep up with them',
                throttle_duration_sec=1.0,
            )
