# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Recovery of logs that were truncated or damaged: their complete chunks go into a new file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
import fcntl
import mmap
import os
from pathlib import Path
import stat
from typing import IO, NamedTuple
import zlib

from masmc_ros.errors import InputError
from masmc_ros.log.mcap import codec
from masmc_ros.log.recover.salvage import Salvage
from masmc_ros.output_files import replacing
from mcap.reader import make_reader, NonSeekingReader
from mcap.records import Footer, Statistics

_FOOTER_SIZE = codec.RECORD_HEAD.size + 20
"""Bytes of the record at the end of a file; the checksum of the summary is its last four."""


class Recovered(NamedTuple):
    """
    Content of a log that was completed.

    Attributes
    ----------
    messages
        number of messages.
    start
        log time of the first message in ns.
    end
        log time of the last message in ns.
    dropped
        bytes of the file that could not be read.
    damaged
        first and last log time in ns of each damaged chunk that was skipped.

    """

    messages: int
    start: int
    end: int
    dropped: int
    damaged: tuple[tuple[int, int], ...] = ()


def is_complete(path: Path) -> bool:
    """Return True if a log has its end; OSError if it cannot be read."""
    with path.open('rb') as stream:
        stream.seek(max(len(codec.MAGIC), stream.seek(0, os.SEEK_END) - len(codec.MAGIC)))
        return stream.read() == codec.MAGIC


def is_ours(path: Path) -> bool:
    """Return True if this package wrote the start of the file; OSError if it cannot be read."""
    with path.open('rb') as stream:
        return b'masmc_ros' in stream.read(256)


def recover_all(folder: Path) -> Iterator[tuple[Path, Recovered]]:
    """
    Complete the truncated logs of this package in a folder, and in recordings in it.

    Logs that are being recorded, that are complete, that another program wrote or that cannot
    be written are unchanged. Yields each completed log.
    """
    for path in sorted((*folder.glob('*.mcap'), *folder.glob('*/*.mcap'))):
        recovered = None
        with suppress(OSError, InputError):
            if is_ours(path) and not is_complete(path):
                recovered = recover(path)
        if recovered is not None:
            yield path, recovered


def recover(path: Path) -> Recovered | None:
    """
    Complete a log.

    The complete chunks are written into a new file next to the log, which then replaces it
    atomically. Damaged and truncated chunks are skipped. The log is unchanged if the recovery
    is interrupted or the disk is full.

    Parameters
    ----------
    path
        a log that its recorder did not complete, or that was damaged.

    Returns
    -------
        The content of the new file; None if the log is complete: it has its end, and every
        checksum, index and count is right.

    Raises
    ------
    InputError
        if the file is missing, no MCAP file, being recorded, or if it cannot be replaced.

    """
    if not path.is_file():
        fault = 'is not a file' if path.exists() else 'does not exist'
        raise InputError(f'{path}: {fault}; name a .mcap file that a recorder left')
    try:
        with path.open('r+b') as stream:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return _recover(path, stream)
    except BlockingIOError as error:
        raise InputError(
            f'{path}: is being recorded; recover it when its recorder has ended'
        ) from error
    except OSError as error:
        raise InputError(f'{path}: cannot be recovered: {error.strerror or error}') from error


def _recover(path: Path, stream: IO[bytes]) -> Recovered | None:
    size = stream.seek(0, os.SEEK_END)
    stream.seek(0)
    codec.check_magic(path, stream.read(len(codec.MAGIC)))
    # An empty file cannot be mapped.
    data = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) if size else b''
    try:
        salvage = Salvage(data)
    except codec.LargeChunkError as error:
        raise InputError(f'{path}: is left as it is: {error}') from None
    if salvage.is_unchanged() if is_ours(path) else _is_readable(stream, data, salvage):
        return None
    statistics = _replace(path, salvage, os.fstat(stream.fileno()))
    return Recovered(
        statistics.message_count,
        statistics.message_start_time,
        statistics.message_end_time,
        salvage.dropped,
        tuple(salvage.damaged),
    )


def _is_readable(stream: IO[bytes], data: codec.Data, salvage: Salvage) -> bool:
    """Return True if mcap reads the whole file, and its checksums and count are right."""
    if salvage.has_damage:
        return False
    stream.seek(0)
    try:
        summary = make_reader(stream).get_summary()
        stream.seek(0)
        reader = NonSeekingReader(stream, validate_crcs=True)
        count = sum(1 for _ in reader.iter_messages(log_time_order=False))
        footer = codec.parsed(data[-_FOOTER_SIZE - len(codec.MAGIC):-len(codec.MAGIC)])
    except Exception:  # mcap raises many kinds for damaged bytes
        return False
    assert isinstance(footer, Footer)
    start = footer.summary_start or len(data) - _FOOTER_SIZE - len(codec.MAGIC)
    statistics = None if summary is None else summary.statistics
    return footer.summary_crc in (0, zlib.crc32(data[start:-len(codec.MAGIC) - 4])) and (
        statistics is None or statistics.message_count == count
    )


def _replace(path: Path, salvage: Salvage, status: os.stat_result) -> Statistics:
    """Write the new file and let it replace the old one, with its owner and mode."""
    # The file that a symbolic link names is replaced, not the link.
    with replacing(path.resolve()) as stream:
        statistics = salvage.write(stream.write)
        stream.flush()
        with suppress(OSError):
            os.fchown(stream.fileno(), status.st_uid, status.st_gid)
        os.fchmod(stream.fileno(), stat.S_IMODE(status.st_mode))
        os.fsync(stream.fileno())
    return statistics
