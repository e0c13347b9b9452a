# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The file of a live recording: it always ends where a record ends, even on a full disk."""

from __future__ import annotations

from collections import deque
import fcntl
import os
from pathlib import Path


class RecordSink:
    """
    A stream that keeps what is written to it until `commit` has put it on the disk.

    A disk takes a record as a whole or not at all: where it takes a part, the file is cut back
    to where the last one ended, and the next commit tries again. While the sink is open its
    file is locked, so that nobody takes a recording under way for one that was cut off.
    """

    def __init__(self, path: Path) -> None:
        """Create the file, or empty it; OSError where that is not possible."""
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            os.ftruncate(self._descriptor, 0)
        except OSError:
            os.close(self._descriptor)
            raise
        self._pending: deque[bytes] = deque()
        self._pending_size = 0
        self._committed = 0
        self.closed = False

    @property
    def pending(self) -> int:
        """Bytes that are not on the disk yet."""
        return self._pending_size

    def write(self, data: bytes) -> None:
        """Keep whole records until the next commit."""
        self._pending.append(data)
        self._pending_size += len(data)

    def commit(self, *, durable: bool = False) -> None:
        """
        Put everything into the file; when `durable`, wait until a power cut cannot harm it.

        Raises OSError where the disk does not take it. Nothing is lost then.
        """
        is_new = bool(self._pending)
        try:
            while self._pending:
                self._append(self._pending[0])
                self._pending_size -= len(self._pending.popleft())
        except OSError:
            os.ftruncate(self._descriptor, self._committed)
            raise
        if durable and is_new:
            self.sync()

    def sync(self) -> None:
        """Wait until a power cut can harm nothing of what was committed; OSError if it can."""
        os.fdatasync(self._descriptor)

    def _append(self, records: bytes) -> None:
        """Put all of some records into the file; OSError where a part or nothing is taken."""
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
