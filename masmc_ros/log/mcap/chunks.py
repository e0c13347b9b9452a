# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Chunks of an MCAP file as they are made: records put together, indexed and compressed."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
from typing import NamedTuple
import zlib

import lz4.frame
from masmc_ros.log.mcap.records import all_records, LARGEST_CHUNK, MESSAGE_HEAD, RECORD_HEAD
from mcap.opcode import Opcode
from mcap.records import Chunk
import numpy as np
from numpy.typing import NDArray
import zstandard

Message = tuple[int, int, bytes]
"""Number of a channel, log and publish time in ns, and the message."""

Indexes = dict[int, 'array[int]']
"""By channel, for each of its messages in a chunk: log time in ns, place in the chunk."""

COMPRESSIONS: dict[str, Callable[[bytes], bytes]] = {
    'zstd': zstandard.compress,
    'lz4': lz4.frame.compress,
    'none': bytes,
}

_HEAD = np.dtype(
    [
        ('opcode', 'u1'),
        ('length', '<u8'),
        ('channel', '<u2'),
        ('sequence', '<u4'),
        ('log_time', '<u8'),
        ('publish_time', '<u8'),
    ]
)
"""What stands before the bytes of a message; `RECORD_HEAD` and `MESSAGE_HEAD` for many."""

INDEX_HEAD = RECORD_HEAD.size + 2 + 4
"""Bytes before the entries of an index: head of the record, channel, and size of the entries."""


class ChannelRows(NamedTuple):
    """
    Messages of one channel in bulk.

    Attributes
    ----------
    channel
        as `LogWriter.channel` returned it.
    times
        (N) log and publish times in ns, ascending.
    rows
        (N) or (N, size) the messages, all of one size.

    """

    channel: int
    times: NDArray[np.int64]
    rows: NDArray[np.generic]


class MessageRecords(NamedTuple):
    """
    The records of messages as they stand in a chunk.

    Attributes
    ----------
    content
        the records' bytes, one after the other.
    starts
        (N) where each begins.
    ends
        (N) where each ends.
    channels
        (N) which each is of.
    times
        (N) its log time in ns.

    """

    content: NDArray[np.uint8]
    starts: NDArray[np.intp]
    ends: NDArray[np.intp]
    channels: NDArray[np.intp]
    times: NDArray[np.int64]


def merged_records(sources: Sequence[ChannelRows]) -> MessageRecords:
    """
    Return the records of messages of several channels, in the order of their times.

    Each source has some; those of one time are in the order of `sources`.
    """
    sizes = np.array([_HEAD.itemsize + each.rows.nbytes // len(each.rows) for each in sources])
    owners = np.repeat(np.arange(len(sources)), [len(each.times) for each in sources])
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
    Return the records of messages of any sizes, of which there are some, in their order.

    Raises OverflowError for a time that is no int64.
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
    """Return what stands before messages of such sizes in bytes, at times (N) in ns."""
    heads = np.zeros(len(times), _HEAD)
    heads['opcode'] = Opcode.MESSAGE
    heads['length'] = MESSAGE_HEAD.size + sizes
    heads['channel'] = channels
    heads['log_time'] = heads['publish_time'] = times
    return heads


def _lay_out(
    source: ChannelRows, content: NDArray[np.uint8], starts: NDArray[np.intp]
) -> None:
    count = len(source.rows)
    rows = np.ascontiguousarray(source.rows).view(np.uint8)
    rows = rows.reshape(count, source.rows.nbytes // count)
    heads = _heads(source.channel, source.times, rows.shape[1])
    records = np.hstack((heads.view(np.uint8).reshape(count, -1), rows))
    # A record may begin at every byte of the content: each is copied there as a whole.
    size = records.shape[1]
    record = np.dtype((np.void, size))
    places = np.ndarray(len(content) - size + 1, record, content, strides=(1,))
    places[starts] = records.view(record)[:, 0]


class OpenChunk:
    """
    A chunk under way.

    Attributes
    ----------
    size
        of its records in bytes.
    indexes
        of its messages.

    """

    def __init__(self) -> None:
        """Start with nothing in it."""
        self._parts: list[bytes] = []
        self.size = 0
        self.indexes: Indexes = {}

    def add_record(self, record: bytes) -> None:
        """Add a schema or a channel."""
        self._parts.append(record)
        self.size += len(record)

    def add_messages(self, messages: MessageRecords, first: int, stop: int, limit: int) -> int:
        """
        Add messages until there are more than `limit` bytes, or no more.

        Parameters
        ----------
        messages
            of which to add some.
        first
            the first to add.
        stop
            the first not to add in any case.
        limit
            in bytes.

        Returns
        -------
            the first that was not added.

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

    def content(self) -> bytes:
        """Return its records."""
        return b''.join(self._parts)


class IndexedChunk(NamedTuple):
    """A chunk and the indexes of its messages, of which it has at least one."""

    chunk: Chunk
    indexes: Indexes


def indexed_chunk(content: bytes, indexes: Indexes, compression: str = 'zstd') -> IndexedChunk:
    """
    Make a chunk of records.

    Parameters
    ----------
    content
        the records.
    indexes
        of the messages among them.
    compression
        one of COMPRESSIONS; not used for a chunk that would be too large to be unpacked.

    """
    first, last = span(indexes)
    if len(content) > LARGEST_CHUNK:
        compression = 'none'
    chunk = Chunk(
        compression=compression if compression != 'none' else '',
        data=COMPRESSIONS[compression](content),
        message_start_time=first,
        message_end_time=last,
        uncompressed_crc=zlib.crc32(content),
        uncompressed_size=len(content),
    )
    return IndexedChunk(chunk, indexes)


def span(indexes: Indexes) -> tuple[int, int]:
    """Return the first and the last log time in ns of messages; 0 where there are none."""
    times = [index[::2] for index in indexes.values()]
    return min(map(min, times), default=0), max(map(max, times), default=0)


def index_messages(content: bytes) -> tuple[Indexes, list[bytes]]:
    """
    Return the indexes of the messages in a chunk, and its schemas and channels as records.

    Raises ValueError if the chunk has other content.
    """
    indexes: Indexes = {}
    definitions = []
    for opcode, start, end in all_records(content):
        if opcode == Opcode.MESSAGE and end - start >= RECORD_HEAD.size + MESSAGE_HEAD.size:
            channel, _, time, _ = MESSAGE_HEAD.unpack_from(content, start + RECORD_HEAD.size)
            indexes.setdefault(channel, array('Q')).extend((time, start))
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            definitions.append(content[start:end])
        else:
            raise ValueError(f'a record of kind {opcode} at byte {start} of a chunk')
    return indexes, definitions


def index_record(channel: int, index: array[int]) -> bytes:
    """Return the record of a channel's index."""
    entries = index.tobytes()
    return (
        RECORD_HEAD.pack(Opcode.MESSAGE_INDEX, INDEX_HEAD - RECORD_HEAD.size + len(entries))
        + channel.to_bytes(2, 'little')
        + len(entries).to_bytes(4, 'little')
        + entries
    )
