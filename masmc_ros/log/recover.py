# SPDX-License-Identifier: Apache-2.0
"""Completes logs whose recorder was cut off: what is whole stays, the indexes are made anew."""

from __future__ import annotations

from collections.abc import Iterator
import fcntl
import mmap
import os
from pathlib import Path
from typing import IO, NamedTuple

from mcap.opcode import Opcode

from masmc_ros.errors import InputError
from masmc_ros.log.records import check_magic, MAGIC, records
from masmc_ros.log.salvage import Salvage


class Recovered(NamedTuple):
    """What there is in a log that was completed.

    Attributes:
        messages: how many.
        begin: log time of the first, ns.
        end: log time of the last, ns.
        dropped: bytes at the end of the file that were no whole record.
    """

    messages: int
    begin: int
    end: int
    dropped: int


def is_complete(path: Path) -> bool:
    """Tell whether a log has its end; OSError where it cannot be read."""
    with path.open('rb') as stream:
        size = stream.seek(0, os.SEEK_END)
        if size < 2 * len(MAGIC):
            return False
        stream.seek(-len(MAGIC), os.SEEK_END)
        return stream.read() == MAGIC


def is_ours(path: Path) -> bool:
    """Tell whether this package began to record the file; OSError where it cannot be read."""
    with path.open('rb') as stream:
        return b'masmc_ros' in stream.read(256)


def recover_all(folder: Path) -> Iterator[tuple[Path, Recovered]]:
    """Complete the logs in a folder, and in recordings in it, that this package left.

    Logs that are being recorded, complete or of others are left as they are, and those that
    cannot be written. Yields each that was completed.
    """
    for path in sorted((*folder.glob('*.mcap'), *folder.glob('*/*.mcap'))):
        try:
            if is_complete(path) or not is_ours(path):
                continue
            recovered = recover(path)
        except (OSError, InputError):
            continue
        if recovered is not None:
            yield path, recovered


def recover(path: Path) -> Recovered | None:
    """Complete a log in its place.

    Whole chunks stay where they are, byte for byte. Of a chunk that was cut off, the messages
    that can be decompressed are kept. A recovery that is itself cut off can be repeated.

    Args:
        path: a log that a recorder left without its end.

    Returns:
        What is in it; None for a log that is complete already, which is left as it is.

    Raises:
        InputError: for a file that is missing, no MCAP file, being recorded, or not writable.
    """
    if not path.is_file():
        fault = 'is not a file' if path.exists() else 'does not exist'
        raise InputError(f'{path}: {fault}; name a .mcap file that a recorder left')
    try:
        with path.open('r+b') as stream:
            try:
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise InputError(
                    f'{path}: is being recorded; recover it when its recorder has ended'
                ) from None
            return _recover(path, stream)
    except OSError as error:
        raise InputError(f'{path}: cannot be recovered: {error.strerror or error}') from error


def _recover(path: Path, stream: IO[bytes]) -> Recovered | None:
    size = stream.seek(0, os.SEEK_END)
    stream.seek(0)
    check_magic(path, stream.read(len(MAGIC)))
    contents = Salvage()
    if size:
        with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
            if _is_whole(data):
                return None
            contents.take(data)
    end, tail = contents.end, contents.tail()
    # The whole records before it are not touched: cut off here, it can be recovered again.
    written = 0
    while written < len(tail):
        written += os.pwrite(stream.fileno(), tail[written:], end + written)
    os.ftruncate(stream.fileno(), end + len(tail))
    os.fsync(stream.fileno())
    statistics = contents.statistics
    return Recovered(
        statistics.message_count,
        statistics.message_start_time,
        statistics.message_end_time,
        contents.dropped,
    )


def _is_whole(data: mmap.mmap) -> bool:
    """Tell whether the records of a file go on to its footer and end."""
    if len(data) < 2 * len(MAGIC) or data[-len(MAGIC) :] != MAGIC:
        return False
    return any(
        opcode == Opcode.FOOTER and end + len(MAGIC) == len(data)
        for opcode, _, end in records(data)
    )
