# SPDX-License-Identifier: Apache-2.0
"""The file of a live recording: it always ends where a record ends, even on a full disk."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path


class RecordSink:
    """A stream that keeps what is written to it until `commit` has put it on the disk.

    A disk takes all of a commit or none of it: where it takes a part, the file is cut back
    to where it ended, and the next commit tries again. While the sink is open its file is
    locked, so that nobody takes a recording under way for one that was cut off.
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
        self._pending = bytearray()
        self._committed = 0
        self.closed = False

    @property
    def pending(self) -> int:
        """Bytes that are not on the disk yet."""
        return len(self._pending)

    def write(self, data: bytes) -> int:
        """Keep bytes until the next commit."""
        self._pending += data
        return len(data)

    def tell(self) -> int:
        """Return the length of the stream, committed or not."""
        return self._committed + len(self._pending)

    def flush(self) -> None:
        """Do nothing: a writer flushes between records, `commit` is called after them."""

    def commit(self, *, durable: bool = False) -> None:
        """Put everything into the file; when `durable`, wait until a power cut cannot harm it.

        Raises OSError where the disk does not take it. Nothing is lost then.
        """
        done = 0
        try:
            with memoryview(self._pending) as pending:
                while done < len(pending):
                    place = self._committed + done
                    # In pieces, so that a lock on the interpreter is never held for long.
                    done += os.pwrite(self._descriptor, pending[done : done + 2**22], place)
        except OSError:
            os.ftruncate(self._descriptor, self._committed)
            raise
        self._committed += done
        self._pending.clear()
        if durable and done:
            os.fdatasync(self._descriptor)

    def close(self) -> None:
        """Close the file with what was committed."""
        if not self.closed:
            self.closed = True
            os.close(self._descriptor)
