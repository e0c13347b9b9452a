# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Reads the records of an MCAP file in the order in which they were written."""

from __future__ import annotations

import mmap
import os
from pathlib import Path
import struct

from masmc_ros.errors import InputError
from masmc_ros.log.bag import part_names
from masmc_ros.log.mcap.records import (
    all_records,
    check_magic,
    cut_off,
    Data,
    decompressed,
    LARGEST_CHUNK,
    LARGEST_RATIO,
    MAGIC,
    MESSAGE_HEAD,
    parsed,
    RECORD_HEAD,
    records,
)
from masmc_ros.log.read.contents import Records, Topic
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Metadata, Schema

_MEMORY = os.sysconf('SC_PHYS_PAGES') * os.sysconf('SC_PAGE_SIZE') // 2
"""Bytes that a log may take at most: half of what the machine has."""

_READ = Opcode.CHUNK, Opcode.METADATA, Opcode.ATTACHMENT, Opcode.SCHEMA, Opcode.CHANNEL
"""Records whose content is read, in addition to messages."""

_MESSAGE = struct.Struct('<9xH4xQ')
"""Channel and log time in ns of the record of a message."""

_MESSAGE_HEAD = RECORD_HEAD.size + MESSAGE_HEAD.size
"""Bytes before the content of a message."""

_SIZE = slice(RECORD_HEAD.size + 16, RECORD_HEAD.size + 24)
"""Place of the unpacked size in the record of a chunk."""


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
            collector.take(data, opcode, start, end)
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
    """Raise InputError for a log that unpacks to more than a run, or half the memory, can be."""
    size = sum(
        int.from_bytes(data[start + _SIZE.start:start + _SIZE.stop], 'little')
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
    """Records of one file, sorted by topic."""

    def __init__(self, contents: Records) -> None:
        """Initialise the collector with the content of earlier files."""
        self._records = contents
        self._schemas: dict[int, Schema] = {}
        self._topics: dict[int, Topic] = {}
        self._number = sum(len(topic.messages) for topic in contents.topics.values())
        # A later part starts with messages that are still valid: these are there already.
        self._repeated = {
            topic.name: topic.messages[-1] for topic in contents.topics.values() if topic.messages
        }

    def take(self, data: Data, opcode: int, start: int, end: int) -> None:
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
            self._add_message(data, start, end)
            return
        record = parsed(data[start:end]) if opcode in _READ else None
        if isinstance(record, Chunk):
            content = decompressed(record)
            for kind, first, last in all_records(content):
                if kind == Opcode.MESSAGE:
                    self._add_message(content, first, last)
                else:
                    self.take(content, kind, first, last)
        elif isinstance(record, Metadata):
            self._records.metadata.setdefault(record.name, []).append(record.metadata)
        elif isinstance(record, Attachment):
            self._records.attachments[record.name] = record.data
        elif isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel):
            # A topic of several channels is one topic, and the summary repeats the channels.
            schema = self._schemas.get(record.schema_id)
            topic = Topic(record.topic, record.message_encoding, schema)
            self._topics[record.id] = self._records.topics.setdefault(topic.name, topic)

    def _add_message(self, data: Data, start: int, end: int) -> None:
        # mcap makes an object of each message, which takes five times as long.
        channel, log_time = _MESSAGE.unpack_from(data, start)
        topic = self._topics[channel]
        message = data[start + _MESSAGE_HEAD:end]
        if self._repeated and self._repeated.pop(topic.name, None) == message:
            return
        topic.orders.append(self._number)
        self._number += 1
        topic.log_times.append(log_time)
        topic.messages.append(message)
