# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""File of a log that always ends with a complete record, even on a full disk."""

from __future__ import annotations

from collections import deque
import fcntl
import os
from pathlib import Path


class RecordSink:
    """
    A file whose records stay in memory until `commit` has put them on the disk.

    If the disk takes a part of a record, the file is truncated to the end of the previous one,
    and the next commit tries again. The file is locked while the sink is open, so a recording
    in progress is not taken for a truncated log.

    Attributes
    ----------
    pending
        bytes that are not on the disk yet.
    closed
        whether the file is closed.

    """

    def __init__(self, path: Path) -> None:
        """Create or empty the file; OSError if that is not possible."""
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            os.ftruncate(self._descriptor, 0)
        except OSError:
            os.close(self._descriptor)
            raise
        self._records: deque[bytes] = deque()
        self._committed = self.pending = 0
        self.closed = False

    def write(self, records: bytes) -> None:
        """Keep complete records until the next commit."""
        self._records.append(records)
        self.pending += len(records)

    def commit(self, *, durable: bool = False) -> None:
        """
        Put all records into the file; with `durable`, wait until a power failure cannot lose them.

        Raises OSError if the disk does not take them. Nothing is lost then.
        """
        is_new = bool(self._records)
        try:
            while self._records:
                self._append(self._records[0])
                self.pending -= len(self._records.popleft())
        except OSError:
            os.ftruncate(self._descriptor, self._committed)
            raise
        if durable and is_new:
            self.sync()

    def sync(self) -> None:
        """Wait until a power failure cannot lose what was committed; OSError if it can."""
        os.fdatasync(self._descriptor)

    def _append(self, records: bytes) -> None:
        """Put records into the file; OSError if the disk takes a part of them or nothing."""
        done = 0
        with memoryview(records) as data:
            while done < len(data):
                done += os.pwrite(self._descriptor, data[done:], self._committed + done)
        self._committed += done

    def close(self) -> None:
        """Close the file with what was committed."""
        if not self.closed:
            self.closed = True
            os.close(self._descriptor)
