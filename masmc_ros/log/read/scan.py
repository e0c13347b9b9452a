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

"""Reads the records of an MCAP file in the order in which they were written."""

from __future__ import annotations

import mmap
import os
from pathlib import Path

from masmc_ros.errors import InputError
from masmc_ros.log.bag import part_names
from masmc_ros.log.mcap.records import (
    check_magic,
    cut_off,
    Data,
    decompressed,
    LARGEST_CHUNK,
    LARGEST_RATIO,
    MAGIC,
    MESSAGE_HEAD,
    RECORD_HEAD,
    records,
    stream_of,
    unpacked_size,
)
from masmc_ros.log.read.contents import Records, Topic
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Metadata, Schema

_MEMORY = os.sysconf('SC_PHYS_PAGES') * os.sysconf('SC_PAGE_SIZE') // 2
"""Bytes that a log may take at most: half of what the machine has."""


def scan(path: Path) -> Records:
    """
    Read a whole log.

    Parameters
    ----------
    path
        the file, or the folder of a recording in parts.

    Raises
    ------
    InputError
        for a file that is missing, no MCAP file, damaged or incomplete, and for a
        folder that is no recording.

    """
    records = Records()
    if not os.path.isdir(path):
        _scan_file(path, records)
        return records
    for name in part_names(path):
        _scan_file(path / name, records)
    return records


def _scan_file(path: Path, found: Records) -> None:
    """Add what a file holds."""
    if os.path.exists(path) and not os.path.isfile(path):
        raise InputError(f'{path}: is not a file; name a .mcap file')
    try:
        with path.open('rb') as stream:
            if not os.fstat(stream.fileno()).st_size:
                raise InputError(f'{path}: is empty; name a log such as run.mcap')
            with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
                _scan_data(path, data, found)
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise InputError(f'{path}: cannot be read: {reason}') from error


def _scan_data(path: Path, data: Data, found: Records) -> None:
    check_magic(path, data[: len(MAGIC)])
    hint = f'`masmc recover {path}` makes a complete one of it'
    _check_size(path, data)
    collector, end, is_over = _Collector(found), len(MAGIC), False
    for opcode, start, end in records(data):
        try:
            collector.take(opcode, data[start + RECORD_HEAD.size:end])
        # Whatever a library says of bytes that were never written so.
        except Exception as error:
            reason = f'channel {error} is not declared' if type(error) is KeyError else error
            raise InputError(
                f'{path}: the log is damaged: {reason}, at byte {start}; {hint}'
            ) from error
        is_over = opcode == Opcode.FOOTER
        if is_over:
            break
    if is_over and data[end:] == MAGIC:
        return
    is_cut = data[-len(MAGIC):] != MAGIC or len(data) == len(MAGIC)
    if MAGIC.startswith(data[end:]) if is_over else is_cut:
        raise InputError(cut_off(path))
    raise InputError(f'{path}: the log is damaged: no record can be read at byte {end}; {hint}')


def _check_size(path: Path, data: Data) -> None:
    """Refuse a log that unpacks to what no run can mean, or to more than there is memory."""
    size = sum(
        unpacked_size(data, start)
        for opcode, start, _ in records(data)
        if opcode == Opcode.CHUNK
    )
    if size > max(LARGEST_CHUNK, LARGEST_RATIO * len(data)):
        raise InputError(
            f'{path}: its {len(data)} bytes say that they unpack to {size} bytes; expected at'
            f' most {LARGEST_RATIO} times as many'
        )
    if size > _MEMORY:
        raise InputError(
            f'{path}: unpacks to {size} bytes, and half the memory of this machine is {_MEMORY}'
            ' bytes; expected a shorter run, or one part of it'
        )


class _Collector:
    """Sorts records by topic."""

    def __init__(self, found: Records) -> None:
        self._records = found
        self._schemas: dict[int, Schema] = {}
        self._topics: dict[int, Topic] = {}
        self._number = sum(len(topic.messages) for topic in found.topics.values())
        # A later part begins with messages that are still valid: these are there already.
        self._repeated = {
            topic.name: topic.messages[-1] for topic in found.topics.values() if topic.messages
        }

    def take(self, opcode: int, body: bytes) -> None:
        if opcode == Opcode.CHUNK:
            self._split(decompressed(Chunk.read(stream_of(body))))
        elif opcode == Opcode.METADATA:
            metadata = Metadata.read(stream_of(body))
            self._records.metadata.setdefault(metadata.name, []).append(metadata.metadata)
        elif opcode == Opcode.ATTACHMENT:
            attachment = Attachment.read(stream_of(body))
            self._records.attachments[attachment.name] = attachment.data
        else:
            self._take_part(opcode, body)

    def _take_part(self, opcode: int, body: bytes) -> None:
        """Take a record that may stand in a chunk."""
        if opcode == Opcode.MESSAGE:
            channel, _, log_time, _ = MESSAGE_HEAD.unpack_from(body)
            self._add(channel, log_time, body[MESSAGE_HEAD.size:])
        elif opcode == Opcode.SCHEMA:
            schema = Schema.read(stream_of(body))
            self._schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            self._open(Channel.read(stream_of(body)))

    def _split(self, chunk: bytes) -> None:
        """
        Take the records out of a chunk.

        The library makes an object of each message, which takes five times as long.
        """
        position, size = 0, len(chunk)
        while position < size:
            opcode, length = RECORD_HEAD.unpack_from(chunk, position)
            start = position + RECORD_HEAD.size
            position = start + length
            if position > size:
                raise ValueError('a record goes beyond the end of its chunk')
            if opcode == Opcode.MESSAGE:
                channel, _, log_time, _ = MESSAGE_HEAD.unpack_from(chunk, start)
                self._add(channel, log_time, chunk[start + MESSAGE_HEAD.size:position])
            else:
                self._take_part(opcode, chunk[start:position])

    def _open(self, channel: Channel) -> None:
        # A topic of several channels is one topic, and the summary repeats the channels.
        self._topics[channel.id] = self._records.topics.setdefault(
            channel.topic,
            Topic(channel.topic, channel.message_encoding, self._schemas.get(channel.schema_id)),
        )

    def _add(self, channel: int, log_time: int, data: bytes) -> None:
        topic = self._topics[channel]
        if self._repeated and self._repeated.pop(topic.name, None) == data:
            return
        topic.orders.append(self._number)
        self._number += 1
        topic.log_times.append(log_time)
        topic.messages.append(data)
