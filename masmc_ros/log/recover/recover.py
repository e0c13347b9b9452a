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

"""Completes logs that were cut off or damaged: what is whole stays, indexes are made anew."""

from __future__ import annotations

from collections.abc import Iterator
import fcntl
from io import BytesIO
import mmap
import os
from pathlib import Path
import shutil
from typing import IO, NamedTuple

from masmc_ros.errors import InputError
from masmc_ros.log.records import check_magic, MAGIC
from masmc_ros.log.recover.salvage import Salvage
from masmc_ros.log.summary import read_summary

_BLOCK = 2**20
"""Bytes that are copied at a time."""


class Recovered(NamedTuple):
    """
    What there is in a log that was completed.

    Attributes
    ----------
    messages
        how many.
    begin
        log time of the first, ns.
    end
        log time of the last, ns.
    dropped
        bytes of the file in which nothing could be read.

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
    """
    Complete the logs in a folder, and in recordings in it, that this package left.

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
    """
    Complete a log in its place.

    Whole chunks stay where they are, byte for byte. Of a chunk that was cut off, the messages
    that can be decompressed are kept. Where more can be read behind what is damaged, the log
    is written anew beside its place and takes it over as a whole: damaged chunks are left out,
    all others kept in their order. A recovery that is itself cut off can be repeated.

    Parameters
    ----------
    path
        a log that a recorder left without its end, or that was damaged.

    Returns
    -------
        What is in it; None for a log that is complete already, which is left as it is: every
        record was read, and every checksum and index is right.

    Raises
    ------
    InputError
        for a file that is missing, no MCAP file, being recorded, or not writable.

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
    data: mmap.mmap | bytes = b''
    if size:
        data = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
    try:
        try:
            contents = Salvage(data)
        except InputError as error:
            raise InputError(f'{path}: is left as it is: {error}') from None
        if _is_whole(data, contents):
            return None
        if contents.is_damaged:
            _write_anew(path, data, contents)
        else:
            _complete(stream, contents)
    finally:
        if isinstance(data, mmap.mmap):
            data.close()
    statistics = contents.summary.statistics
    return Recovered(
        statistics.message_count,
        statistics.message_start_time,
        statistics.message_end_time,
        contents.dropped,
    )


def _is_whole(data: mmap.mmap | bytes, contents: Salvage) -> bool:
    """Tell whether a file is complete, its end saying what is in it."""
    if contents.data_end is None or contents.is_damaged:
        return False
    summary = read_summary(data, contents.data_end)
    return summary is not None and contents.agrees_with(summary)


def _complete(stream: IO[bytes], contents: Salvage) -> None:
    """Write the end of a file behind the part of it that is whole."""
    written = BytesIO()
    contents.write_tail(written)
    tail, end, done = written.getbuffer(), contents.end, 0
    # The whole records before it are not touched: cut off here, it can be recovered again.
    while done < len(tail):
        done += os.pwrite(stream.fileno(), tail[done:], end + done)
    os.ftruncate(stream.fileno(), end + len(tail))
    os.fsync(stream.fileno())


def _write_anew(path: Path, data: mmap.mmap | bytes, contents: Salvage) -> None:
    """Write what there is into another file, and let that take the place of the damaged one."""
    beside = path.with_name(f'{path.name}.part')
    try:
        with beside.open('wb') as stream:
            for start in range(0, contents.end, _BLOCK):
                stream.write(data[start:min(start + _BLOCK, contents.end)])
            contents.write_tail(stream)
            stream.flush()
            os.fsync(stream.fileno())
        shutil.copymode(path, beside)
        os.replace(beside, path)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise
