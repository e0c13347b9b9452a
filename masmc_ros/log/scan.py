# SPDX-License-Identifier: Apache-2.0
"""Reads the records of an MCAP file in the order in which they were written."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
import os
from pathlib import Path
import struct

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, InvalidMagic, McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import CRCValidationError, get_chunk_data_stream, StreamReader
from zstandard import ZstdError

from masmc_ros.errors import InputError
from masmc_ros.log.bag import part_names
from masmc_ros.log.records import check_magic, cut_off, MAGIC

_RECORD = struct.Struct('<BQ')
_MESSAGE = struct.Struct('<HIQQ')


@dataclass
class Topic:
    """One topic of a log and its messages.

    Attributes:
        name: its full name.
        encoding: of the messages, `cdr` for ROS 2.
        schema: the definition of the messages; None for a log without.
        log_times: of each message, ns.
        messages: each as it was received.
        orders: position of each among all messages of the log.
    """

    name: str
    encoding: str
    schema: Schema | None
    log_times: list[int] = field(default_factory=list)
    messages: list[bytes] = field(default_factory=list)
    orders: list[int] = field(default_factory=list)


@dataclass
class Records:
    """What a log holds, in the order of the file.

    Attributes:
        topics: by name.
        metadata: the records of each name.
        attachments: the last file of each name.
    """

    topics: dict[str, Topic] = field(default_factory=dict)
    metadata: dict[str, list[dict[str, str]]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)


def scan(path: Path) -> Records:
    """Read a whole log.

    Args:
        path: the file, or the folder of a recording in parts.

    Raises:
        InputError: for a file that is missing, no MCAP file, damaged or incomplete, and for a
            folder that is no recording.
    """
    records = Records()
    if not os.path.isdir(path):
        _scan_file(path, records)
        return records
    for name in part_names(path):
        _scan_file(path / name, records)
    return records


def _scan_file(path: Path, records: Records) -> None:
    """Add what a file holds."""
    if os.path.exists(path) and not os.path.isfile(path):
        raise InputError(f'{path}: is not a file; name a .mcap file')
    try:
        with path.open('rb') as stream:
            check_magic(path, stream.read(len(MAGIC)))
            stream.seek(0)
            _Collector(records).collect(StreamReader(stream, emit_chunks=True).records)
    except OSError as error:
        raise InputError(f'{path}: cannot be read: {error.strerror}') from error
    except (InvalidMagic, EndOfFile, struct.error) as error:
        raise InputError(cut_off(path)) from error
    except (McapError, CRCValidationError, ZstdError, ValueError, KeyError) as error:
        raise InputError(f'{path}: the log is damaged: {error}') from error


class _Collector:
    """Sorts records by topic."""

    def __init__(self, records: Records) -> None:
        self._records = records
        self._schemas: dict[int, Schema] = {}
        self._topics: dict[int, Topic] = {}
        self._number = sum(len(topic.messages) for topic in records.topics.values())
        # A later part begins with messages that are still valid: these are there already.
        self._repeated = {
            topic.name: topic.messages[-1] for topic in records.topics.values() if topic.messages
        }

    def collect(self, records: Iterator[McapRecord]) -> None:
        for record in records:
            if isinstance(record, Chunk):
                stream, size = get_chunk_data_stream(record, validate_crc=True)
                self._split(stream.read(size))
            elif isinstance(record, Message):
                self._add(record.channel_id, record.log_time, record.data)
            elif isinstance(record, Schema):
                self._schemas[record.id] = record
            elif isinstance(record, Channel):
                self._open(record)
            elif isinstance(record, Metadata):
                self._records.metadata.setdefault(record.name, []).append(record.metadata)
            elif isinstance(record, Attachment):
                self._records.attachments[record.name] = record.data

    def _split(self, chunk: bytes) -> None:
        """Take the records out of a chunk.

        The library makes an object of each message, which takes five times as long.
        """
        position = 0
        while position < len(chunk):
            opcode, length = _RECORD.unpack_from(chunk, position)
            start = position + _RECORD.size
            position = start + length
            if opcode == Opcode.MESSAGE:
                channel, _, log_time, _ = _MESSAGE.unpack_from(chunk, start)
                self._add(channel, log_time, chunk[start + _MESSAGE.size : position])
            elif opcode == Opcode.SCHEMA:
                schema = Schema.read(_stream(chunk[start:position]))
                self._schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL:
                self._open(Channel.read(_stream(chunk[start:position])))

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


def _stream(data: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(data))
