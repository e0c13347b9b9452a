# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Bulk reading of the records of an MCAP file, in the order in which they were written."""

from __future__ import annotations

import mmap
import os
from pathlib import Path
import struct

from masmc_ros.errors import InputError
from masmc_ros.log import codec
from masmc_ros.log.bag import part_names, REPEATED
from masmc_ros.log.read.decode import LATEST_TIME, LogContents, Topic
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Metadata, Schema

_LARGEST_RATIO = 500
"""Maximum ratio of the unpacked size of a log to its own size; runs reach about 50."""

_MEMORY = os.sysconf('SC_PHYS_PAGES') * os.sysconf('SC_PAGE_SIZE') // 2
"""Maximum unpacked size of a log in bytes: half of the machine's memory."""

_READ = Opcode.CHUNK, Opcode.METADATA, Opcode.ATTACHMENT, Opcode.SCHEMA, Opcode.CHANNEL
"""Records whose content is read, in addition to messages."""

_MESSAGE_OPCODE = int(Opcode.MESSAGE)  # numbers compare faster than members of an enumeration

_MESSAGE = struct.Struct('<9xH4xQ8x')
"""Channel and log time in ns before the content of a message."""

_SIZE = struct.Struct('<25xQ')
"""Unpacked size in the record of a chunk."""


def scan(path: Path) -> LogContents:
    """
    Read a whole log.

    Parameters
    ----------
    path
        file, or folder of a recording in parts.

    Raises
    ------
    InputError
        if a file is missing, no MCAP file, damaged or incomplete, or if a folder is not a
        recording.

    """
    contents = LogContents()
    is_folder = os.path.isdir(path)
    for part in [path / name for name in part_names(path)] if is_folder else [path]:
        _scan_file(part, contents)
    for topic in contents.topics.values():
        _decompress_messages(path, topic)
    return contents


def _decompress_messages(path: Path, topic: Topic) -> None:
    """Decompress the messages of a topic of a bag with message compression."""
    if not topic.messages or not topic.messages[0].startswith(codec.ZSTD_MAGIC):
        return
    room = min(max(codec.LARGEST_CHUNK, _LARGEST_RATIO * sum(map(len, topic.messages))), _MEMORY)
    for index, message in enumerate(topic.messages):
        try:
            topic.messages[index] = codec.decompressed_zstd(message, room)
        except ValueError as error:
            raise InputError(f'{path}: {topic.name}: message {index}: {error}') from error
        room -= len(topic.messages[index])


def _scan_file(path: Path, contents: LogContents) -> None:
    """Add the content of a file."""
    if os.path.exists(path) and not os.path.isfile(path):
        raise InputError(f'{path}: is not a file; name a .mcap file')
    try:
        with path.open('rb') as stream:
            if not os.fstat(stream.fileno()).st_size:
                raise InputError(f'{path}: is empty; name a log such as run.mcap')
            with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
                if data[: len(codec.ZSTD_MAGIC)] == codec.ZSTD_MAGIC:
                    limit = min(max(codec.LARGEST_CHUNK, _LARGEST_RATIO * len(data)), _MEMORY)
                    _scan_data(path, codec.decompressed_zstd(data, limit), contents)
                else:
                    _scan_data(path, data, contents)
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise InputError(f'{path}: cannot be read: {reason}') from error


def _scan_data(path: Path, data: codec.Data, contents: LogContents) -> None:
    codec.check_magic(path, data[: len(codec.MAGIC)])
    if len(data) == len(codec.MAGIC) or data[-len(codec.MAGIC):] != codec.MAGIC:
        raise InputError(codec.truncated_message(path))
    _check_size(path, data)
    collector, opcode, end = _Collector(contents), 0, len(codec.MAGIC)
    hint = f'`masmc recover {path}` completes it'
    for opcode, start, end in codec.records(data):
        try:
            collector.add(data, opcode, start, end)
        except Exception as error:  # mcap and the compressors raise many kinds for damaged bytes
            reason = f'channel {error} is not declared' if type(error) is KeyError else error
            raise InputError(
                f'{path}: the log is damaged: {reason}, at byte {start}; {hint}'
            ) from error
        if opcode == Opcode.FOOTER:
            break
    if opcode != Opcode.FOOTER or data[end:] != codec.MAGIC:
        raise InputError(
            f'{path}: the log is damaged: no record can be read at byte {end}; {hint}'
        )


def _check_size(path: Path, data: codec.Data) -> None:
    """Raise InputError if a log unpacks to more than a run, or half of the memory, can be."""
    size = sum(
        _SIZE.unpack_from(data, start)[0]
        for opcode, start, end in codec.records(data)
        if opcode == Opcode.CHUNK and end - start >= _SIZE.size
    )
    limit = min(max(codec.LARGEST_CHUNK, _LARGEST_RATIO * len(data)), _MEMORY)
    if size > limit:
        raise InputError(
            f'{path}: its {len(data)} bytes unpack to {size} bytes; expected at most {limit}:'
            f' {_LARGEST_RATIO} times as many, and half the memory of this machine'
        )


class _Collector:
    """Content of files, sorted by topic."""

    def __init__(self, contents: LogContents) -> None:
        """Initialise the collector with the content of earlier files."""
        self._contents = contents
        self._schemas: dict[int, Schema] = {}
        self._topics: dict[int, Topic] = {}
        earlier = [topic for topic in contents.topics.values() if topic.messages]
        self._number = sum(len(topic.messages) for topic in earlier)
        # A later part starts with messages that are still valid: they are in an earlier part.
        self._repeated = {topic.name: topic.messages[-1] for topic in earlier}
        self._is_stated = False
        self._latched: set[int] = set()

    def add(self, data: codec.Data, opcode: int, start: int, end: int) -> None:
        """
        Add a record.

        Parameters
        ----------
        data
            a file, or the records of a chunk.
        opcode, start, end
            kind of the record and its place in the data.

        """
        if opcode == Opcode.MESSAGE:
            # mcap makes an object of each message, which takes five times as long.
            channel, log_time = _MESSAGE.unpack_from(data, start)
            topic, message = self._topics[channel], data[start + _MESSAGE.size:end]
            if self._repeated and self._is_repeated(channel, topic, message):
                return
            topic.orders.append(self._number)
            self._number += 1
            topic.log_times.append(min(log_time, LATEST_TIME))
            topic.messages.append(message)
            return
        record = codec.parsed(data[start:end]) if opcode in _READ else None
        if isinstance(record, Chunk):
            self._add_chunk(codec.decompressed(record))
        elif isinstance(record, Metadata):
            self._contents.metadata.setdefault(record.name, []).append(record.metadata)
            if record.name == REPEATED:
                self._is_stated = True
                names = self._repeated.keys() & record.metadata.keys()
                self._repeated = {name: self._repeated[name] for name in names}
        elif isinstance(record, Attachment):
            self._contents.attachments[record.name] = record.data
        elif isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel):
            # A topic of several channels is one topic, and the summary repeats the channels.
            schema = self._schemas.get(record.schema_id)
            topic = Topic(record.topic, record.message_encoding, schema)
            self._topics[record.id] = self._contents.topics.setdefault(topic.name, topic)
            if 'transient_local' in record.metadata.get('offered_qos_profiles', ''):
                self._latched.add(record.id)

    def _add_chunk(self, content: bytes) -> None:
        """Add the records of a chunk; nearly all are messages."""
        end, size, topics = 0, len(content), self._topics
        unpack, content_at, shortest = (
            codec.MESSAGE_HEAD.unpack_from, codec.RECORD_HEAD.size, codec.MESSAGE_HEAD.size
        )  # fmt: skip
        while end < size:
            # A loop without calls: a run of 20 s has 140 000 messages.
            number, last_start = self._number, -1 if self._repeated else size - shortest
            while end <= last_start:
                opcode, length, channel, _, log_time, _ = unpack(content, end)
                start, last = end + shortest, end + content_at + length
                if opcode != _MESSAGE_OPCODE or not start <= last <= size:
                    break
                topic = topics[channel]
                topic.orders.append(number)
                number += 1
                topic.log_times.append(log_time if log_time < LATEST_TIME else LATEST_TIME)
                topic.messages.append(content[start:last])
                end = last
            self._number = number
            if end == size:
                return
            other = next(codec.all_records(content, end))
            self.add(content, *other)
            end = other[2]

    def _is_repeated(self, channel: int, topic: Topic, message: bytes) -> bool:
        """
        Return True if a message is in an earlier file.

        Without the record of repeated topics these are the first messages of the file, and their
        topics are latched.
        """
        is_last = self._repeated.pop(topic.name, None) == message
        if not self._is_stated and not (is_last and channel in self._latched):
            self._repeated.clear()
            return False
        return is_last
