# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Chunks of an MCAP file: layout of many messages, indexes and compression."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
import struct
from typing import NamedTuple
import zlib

import lz4.frame
from masmc_ros.log.mcap import codec
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Schema
import numpy as np
from numpy.typing import NDArray
import zstandard

Message = tuple[int, int, bytes]
"""Number of a channel, log and publish time in ns, and content of a message."""

Indexes = dict[int, 'array[int]']
"""Log time in ns and place in the chunk of each message, by channel."""

COMPRESSIONS: dict[str, Callable[[bytes], bytes]] = {
    'zstd': zstandard.compress,
    'lz4': lz4.frame.compress,
    'none': bytes,
}

_HEAD = np.dtype(
    {
        'names': ['opcode', 'length', 'channel', 'sequence', 'log_time', 'publish_time'],
        'formats': ['u1', '<u8', '<u2', '<u4', '<u8', '<u8'],
    }
)
"""Bytes before the content of a message: `MESSAGE_HEAD` for many messages."""

INDEX_HEAD = struct.Struct('<BQHI')
"""Opcode, length, channel and size of the entries in bytes at the start of an index."""


class ChannelRows(NamedTuple):
    """
    Messages of one channel in bulk.

    Attributes
    ----------
    channel
        number that `LogWriter.channel` returned.
    times
        (N) log and publish times in ns, ascending.
    rows
        (N) or (N, size) messages of one size.

    """

    channel: int
    times: NDArray[np.int64]
    rows: NDArray[np.generic]


class MessageRecords(NamedTuple):
    """
    Records of N messages as a chunk contains them.

    Attributes
    ----------
    content
        bytes of the records, one after the other.
    starts, ends
        (N) place of each record in the content.
    channels
        (N) channel of each message.
    times
        (N) log time of each message in ns.

    """

    content: NDArray[np.uint8]
    starts: NDArray[np.intp]
    ends: NDArray[np.intp]
    channels: NDArray[np.intp]
    times: NDArray[np.int64]


def merged_records(sources: Sequence[ChannelRows]) -> MessageRecords:
    """
    Return the records of messages of several channels, in the order of their times.

    No source is empty. Messages of the same time are in the order of `sources`.
    """
    sizes = np.array([_HEAD.itemsize + s.rows.nbytes // len(s.rows) for s in sources])
    owners = np.repeat(np.arange(len(sources)), [len(source.times) for source in sources])
    times = np.concatenate([source.times for source in sources])
    order = np.argsort(times, kind='stable')
    owners = owners[order]
    channels = np.array([source.channel for source in sources])[owners]
    ends = np.cumsum(sizes[owners])
    starts = np.append(0, ends[:-1])
    content = np.empty(ends[-1], np.uint8)
    for number, source in enumerate(sources):
        _lay_out(source, content, starts[owners == number])
    return MessageRecords(content, starts, ends, channels, times[order])


def arrived_records(messages: Sequence[Message]) -> MessageRecords:
    """
    Return the records of at least one message of any size, in the order of arrival.

    Raises OverflowError for a time that is not an int64.
    """
    numbers, stamps, datas = zip(*messages, strict=True)
    channels, times = np.array(numbers), np.array(stamps, np.int64)
    sizes = np.array(list(map(len, datas)))
    ends = np.cumsum(_HEAD.itemsize + sizes)
    parts = [b''] * (2 * len(datas))
    parts[::2] = _heads(channels, times, sizes).view(f'V{_HEAD.itemsize}').tolist()
    parts[1::2] = datas
    content = np.frombuffer(b''.join(parts), np.uint8)
    return MessageRecords(content, np.append(0, ends[:-1]), ends, channels, times)


def _heads(
    channels: NDArray[np.intp] | int, times: NDArray[np.int64], sizes: NDArray[np.intp] | int
) -> NDArray[np.void]:
    """Return the heads of messages of such sizes in bytes, at times (N) in ns."""
    heads = np.zeros(len(times), _HEAD)
    heads['opcode'] = Opcode.MESSAGE
    heads['length'] = codec.MESSAGE_HEAD.size - codec.RECORD_HEAD.size + sizes
    heads['channel'] = channels
    heads['log_time'] = heads['publish_time'] = times
    return heads


def _lay_out(
    source: ChannelRows, content: NDArray[np.uint8], starts: NDArray[np.intp]
) -> None:
    """Copy the records of a channel to their places in the content."""
    count = len(source.rows)
    rows = np.ascontiguousarray(source.rows).view(np.uint8)
    rows = rows.reshape(count, source.rows.nbytes // count)
    heads = _heads(source.channel, source.times, rows.shape[1])
    records = np.hstack((heads.view(np.uint8).reshape(count, -1), rows))
    # A record may start at every byte of the content: each is copied there as a whole.
    size = records.shape[1]
    record = np.dtype((np.void, size))
    places = np.ndarray(len(content) - size + 1, record, content, strides=(1,))
    places[starts] = records.view(record)[:, 0]


class OpenChunk:
    """
    A chunk to which records are added.

    Attributes
    ----------
    size
        size of its records in bytes.
    indexes
        indexes of its messages.

    """

    def __init__(self) -> None:
        """Initialise the chunk without records."""
        self._parts: list[bytes] = []
        self.size = 0
        self.indexes: Indexes = {}

    def add_record(self, record: bytes) -> None:
        """Add a schema or a channel."""
        self._parts.append(record)
        self.size += len(record)

    def add_messages(self, messages: MessageRecords, first: int, stop: int, limit: int) -> int:
        """
        Add messages until the chunk has more than `limit` bytes.

        Parameters
        ----------
        messages
            records of messages.
        first
            number of the first message to add.
        stop
            number after the last message to add.
        limit
            size in bytes.

        Returns
        -------
            Number of the first message that was not added.

        """
        start = messages.starts[first]
        full = int(np.searchsorted(messages.ends, start + limit - self.size, side='right'))
        part = slice(first, min(max(first, full) + 1, stop))
        entries = np.empty((part.stop - first, 2), '<u8')
        entries[:, 0] = messages.times[part]
        entries[:, 1] = messages.starts[part] - start + self.size
        channels = messages.channels[part]
        numbers, firsts = np.unique(channels, return_index=True)
        for channel in numbers[np.argsort(firsts)].tolist():
            index = self.indexes.setdefault(channel, array('Q'))
            index.frombytes(entries[channels == channel].tobytes())
        self.add_record(messages.content[start:messages.ends[part.stop - 1]].tobytes())
        return part.stop

    def close(self, compression: str = 'zstd') -> Chunk:
        """Return the record of the chunk, compressed as `packed_chunk` does."""
        return packed_chunk(b''.join(self._parts), self.indexes, compression)


def packed_chunk(content: bytes, indexes: Indexes, compression: str = 'zstd') -> Chunk:
    """
    Return a chunk of records.

    Parameters
    ----------
    content
        the records.
    indexes
        indexes of the messages among them.
    compression
        one of COMPRESSIONS; ignored for content that is too large to be unpacked.

    """
    first, last = span(indexes)
    if len(content) > codec.LARGEST_CHUNK:
        compression = 'none'
    return Chunk(
        compression=compression if compression != 'none' else '',
        data=COMPRESSIONS[compression](content),
        message_start_time=first,
        message_end_time=last,
        uncompressed_crc=zlib.crc32(content),
        uncompressed_size=len(content),
    )


def span(indexes: Indexes) -> tuple[int, int]:
    """Return the first and the last log time in ns; 0 without messages."""
    times = [index[::2] for index in indexes.values()]
    return min(map(min, times), default=0), max(map(max, times), default=0)


def index_messages(content: bytes) -> tuple[Indexes, list[Schema | Channel]]:
    """
    Return the indexes of the messages in a chunk, and its schemas and channels.

    Raises an exception of any kind if the chunk has other content.
    """
    indexes: Indexes = {}
    definitions: list[Schema | Channel] = []
    for opcode, start, end in codec.all_records(content):
        if opcode == Opcode.MESSAGE and end - start >= codec.MESSAGE_HEAD.size:
            _, _, channel, _, time, _ = codec.MESSAGE_HEAD.unpack_from(content, start)
            indexes.setdefault(channel, array('Q')).extend((time, start))
        else:
            record = codec.parsed(content[start:end])
            if not isinstance(record, (Schema, Channel)):
                raise ValueError(f'a record of kind {opcode} at byte {start} of a chunk')
            definitions.append(record)
    return indexes, definitions


def index_record(channel: int, index: array[int]) -> bytes:
    """Return the record of the index of a channel."""
    entries = index.tobytes()
    length = INDEX_HEAD.size - codec.RECORD_HEAD.size + len(entries)
    return INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, length, channel, len(entries)) + entries
