# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
MCAP format in bulk: single records, chunks of many messages, and the output of a file.

The library mcap makes an object of every message and takes three times as long to write a run
(docs/development/decisions/log_writer.md). This module puts many messages into a chunk at once;
all other records (channels, metadata, indexes) are those of mcap. A `RecordStream` writes a file
from its header to its indexes and its footer.
"""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from io import BytesIO
import mmap
from pathlib import Path
import struct
from typing import NamedTuple
import zlib

import lz4.frame
from masmc_ros import __version__
from masmc_ros.aliases import AnyArray, Bytes, Indices, Integers, Records
from masmc_ros.errors import InputError
from mcap import records as mcap
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Schema
from mcap.stream_reader import StreamReader
from mcap.summary import Summary
from mcap.well_known import Profile
import numpy as np
import zstandard

Data = mmap.mmap | bytes
"""A file, or the records of a chunk."""

MAGIC = b'\x89MCAP0\r\n'

RECORD_HEAD = struct.Struct('<BQ')
"""Opcode and length of the record's content."""

MESSAGE_HEAD = struct.Struct('<BQHIQQ')
"""Head, channel, sequence number, log time and publish time at the start of a message."""

LARGEST_CHUNK = 2**28
"""Maximum unpacked size of a compressed chunk in bytes; a larger one is not compressed."""

_BLOCK = 2**16
"""Number of compressed bytes that are unpacked at a time."""


class LargeChunkError(ValueError):
    """A chunk is larger than LARGEST_CHUNK, and its checksum and sizes show no damage."""


ZSTD_MAGIC = zstandard.FRAME_HEADER
"""First bytes of a file or message that rosbag2 compressed as a whole; no CDR starts so."""


def decompressed_zstd(data: Data, limit: int) -> bytes:
    """
    Return the content of a file or message that rosbag2 compressed as a whole.

    Raises
    ------
    ValueError
        if the data are damaged, or if the content is longer than a limit in bytes.

    """
    decompressor = zstandard.ZstdDecompressor().decompressobj()
    parts, size = [], 0
    try:
        for first in range(0, len(data), _BLOCK):
            parts.append(decompressor.decompress(data[first:first + _BLOCK]))
            size += len(parts[-1])
            if size > limit:
                raise ValueError(f'its {len(data)} bytes unpack to more than {limit} bytes')
    except zstandard.ZstdError as error:
        raise ValueError(f'its compressed data are damaged: {error}') from error
    if not decompressor.eof:
        raise ValueError('its compressed data are damaged: they do not end')
    return b''.join(parts)


def check_magic(path: Path, start: bytes) -> None:
    """Raise InputError if the first bytes of a file are not those of an MCAP file."""
    if not MAGIC.startswith(start[: len(MAGIC)]):
        raise InputError(f'{path}: is not an MCAP file; name a log such as run.mcap')


def truncated_message(path: Path) -> str:
    """Return the error message for a log without its end."""
    return (
        f'{path}: truncated: its recorder was killed before it completed the log;'
        f' `masmc recover {path}` completes it'
    )


def records(data: Data, position: int = len(MAGIC)) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, start and end of the complete records from a position on."""
    while position + RECORD_HEAD.size <= len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, position)
        end = position + RECORD_HEAD.size + length
        if end > len(data) or not opcode:
            return
        yield opcode, position, end
        position = end


def all_records(content: bytes, first: int = 0) -> Iterator[tuple[int, int, int]]:
    """Yield the records of a chunk from a byte on; ValueError if the last one is not whole."""
    end = first
    for opcode, start, end in records(content, first):
        yield opcode, start, end
    if end != len(content):
        raise ValueError(f'a record at byte {end} of a chunk is longer than the chunk')


def decompressed(chunk: Chunk) -> bytes:
    """
    Return the records of a chunk.

    The function uses at most the memory that the chunk states, and at most LARGEST_CHUNK bytes.

    Raises
    ------
    LargeChunkError
        if the chunk is larger than LARGEST_CHUNK, and its head shows no damage.
    Exception
        of any kind if the records are damaged.

    """
    size, content = chunk.uncompressed_size, chunk.data
    if chunk.compression not in ('', 'zstd', 'lz4'):
        raise ValueError(f"compression '{chunk.compression}' is unknown")
    if chunk.compression:
        frame_size = _frame_size(chunk)
        if size > LARGEST_CHUNK:
            is_sound = chunk.uncompressed_crc and frame_size == size
            raise (LargeChunkError if is_sound else ValueError)(
                f'a chunk of {len(content)} bytes that unpacks to {size} bytes; expected at most '
                f'{LARGEST_CHUNK}'
            )
        if frame_size not in (size, None):
            raise ValueError(f'a chunk of {size} bytes that unpacks to {frame_size} bytes')
        if chunk.compression == 'zstd':
            content = zstandard.decompress(content, max_output_size=size)
        else:
            frame = lz4.frame.LZ4FrameDecompressor()
            content = frame.decompress(content, max_length=size + 1)
            if not frame.eof:
                raise ValueError(f'a chunk of {size} bytes whose compressed data do not end')
    if len(content) != size:
        raise ValueError(f'a chunk of {size} bytes that unpacks to {len(content)} bytes')
    if chunk.uncompressed_crc and zlib.crc32(content) != chunk.uncompressed_crc:
        raise ValueError('checksum of a chunk')
    return content


def _frame_size(chunk: Chunk) -> int | None:
    """Return the unpacked size in the head of compressed data; None if it is not stated."""
    if chunk.compression == 'zstd':
        size = zstandard.get_frame_parameters(chunk.data).content_size
        return None if size == zstandard.CONTENTSIZE_UNKNOWN else size
    return lz4.frame.get_frame_info(chunk.data)['content_size'] or None


def packed(record: McapRecord) -> bytes:
    """Return the bytes of a record in a file."""
    builder = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()
    return data


def parsed(data: bytes) -> McapRecord:
    """Return a record from its bytes; exceptions of any kind indicate damage."""
    reader = StreamReader(BytesIO(data), skip_magic=True, emit_chunks=True)
    record: McapRecord = next(reader.records)
    return record


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
    times: Integers
    rows: AnyArray


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

    content: Bytes
    starts: Indices
    ends: Indices
    channels: Indices
    times: Integers


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
    channels: Indices | int, times: Integers, sizes: Indices | int
) -> Records:
    """Return the heads of messages of such sizes in bytes, at times (N) in ns."""
    heads = np.zeros(len(times), _HEAD)
    heads['opcode'] = Opcode.MESSAGE
    heads['length'] = MESSAGE_HEAD.size - RECORD_HEAD.size + sizes
    heads['channel'] = channels
    heads['log_time'] = heads['publish_time'] = times
    return heads


def _lay_out(
    source: ChannelRows, content: Bytes, starts: Indices
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
    if len(content) > LARGEST_CHUNK:
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
    for opcode, start, end in all_records(content):
        if opcode == Opcode.MESSAGE and end - start >= MESSAGE_HEAD.size:
            _, _, channel, _, time, _ = MESSAGE_HEAD.unpack_from(content, start)
            indexes.setdefault(channel, array('Q')).extend((time, start))
        else:
            record = parsed(content[start:end])
            if not isinstance(record, (Schema, Channel)):
                raise ValueError(f'a record of kind {opcode} at byte {start} of a chunk')
            definitions.append(record)
    return indexes, definitions


def index_record(channel: int, index: array[int]) -> bytes:
    """Return the record of the index of a channel."""
    entries = index.tobytes()
    length = INDEX_HEAD.size - RECORD_HEAD.size + len(entries)
    return INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, length, channel, len(entries)) + entries


class RecordStream:
    """
    The records of a file, one after the other.

    Attributes
    ----------
    position
        place in the file at which the next record starts.
    summary
        definitions and indexes of the records before it, without those of new chunks.
    statistics
        of the messages; the other counts are set by `finish`.

    """

    def __init__(
        self, write: Callable[[bytes], object], position: int = 0, summary: Summary | None = None
    ) -> None:
        """
        Initialise the output.

        Parameters
        ----------
        write
            function that writes whole records.
        position
            bytes of the file that precede those records.
        summary
            summary of these bytes.

        """
        self._write = write
        self.position = position
        self.summary = summary or Summary()
        self.statistics = self.summary.statistics or mcap.Statistics(
            message_count=0, channel_message_counts={}, message_start_time=0, message_end_time=0,
            chunk_count=0, channel_count=0, schema_count=0, attachment_count=0, metadata_count=0,
        )
        self._counts = Counter(self.statistics.channel_message_counts)
        # Bytes: an object for each chunk would take ten times the memory, and a recording of a
        # day has half a million chunks.
        self._chunk_indexes = bytearray(b''.join(map(packed, self.summary.chunk_indexes)))
        self._chunk_count = len(self.summary.chunk_indexes)

    def start(self, header: mcap.Header | None = None) -> None:
        """Start a file, with a header of this package by default."""
        self.write(MAGIC)
        self.write(packed(header or mcap.Header(Profile.ROS2, f'masmc_ros {__version__}')))

    def write(self, record: bytes) -> None:
        """Write whole records that the summary does not list."""
        self._write(record)
        self.position += len(record)

    def register(self, record: mcap.Schema | mcap.Channel) -> None:
        """Add a definition to the summary."""
        if isinstance(record, mcap.Schema):
            self.summary.schemas[record.id] = record
        else:
            self.summary.channels[record.id] = record

    def add_attachment(self, attachment: mcap.Attachment) -> None:
        """Write a file that accompanies the messages."""
        record = packed(attachment)
        self.summary.attachment_indexes.append(
            mcap.AttachmentIndex(
                offset=self.position,
                length=len(record),
                create_time=attachment.create_time,
                log_time=attachment.log_time,
                data_size=len(attachment.data),
                name=attachment.name,
                media_type=attachment.media_type,
            )
        )
        self.write(record)

    def add_metadata(self, metadata: mcap.Metadata) -> None:
        """Write names and texts."""
        record = packed(metadata)
        self.summary.metadata_indexes.append(
            mcap.MetadataIndex(self.position, len(record), metadata.name)
        )
        self.write(record)

    def add_chunk(self, chunk: mcap.Chunk, indexes: Indexes) -> None:
        """Write a chunk with at least one message, followed by the indexes of its messages."""
        record, start = packed(chunk), self.position
        self.write(record)
        records, offsets, end = [], {}, self.position
        for channel, entries in indexes.items():
            offsets[channel] = end
            records.append(index_record(channel, entries))
            end += len(records[-1])
            count = len(entries) // 2
            self.count(channel, count, chunk.message_start_time, chunk.message_end_time)
        index = mcap.ChunkIndex(
            message_start_time=chunk.message_start_time,
            message_end_time=chunk.message_end_time,
            chunk_start_offset=start,
            chunk_length=len(record),
            message_index_offsets=offsets,
            message_index_length=end - self.position,
            compression=chunk.compression,
            compressed_size=len(chunk.data),
            uncompressed_size=chunk.uncompressed_size,
        )
        self._chunk_indexes += packed(index)
        self._chunk_count += 1
        self.write(b''.join(records))

    def count(self, channel: int, count: int, first: int, last: int) -> None:
        """Count messages of a channel, with the first and the last log time in ns."""
        statistics = self.statistics
        start = min(first, statistics.message_start_time) if statistics.message_count else first
        statistics.message_start_time = start
        statistics.message_end_time = max(last, statistics.message_end_time)
        statistics.message_count += count
        self._counts[channel] += count

    def finish(self) -> None:
        """Write the end of the file, with all indexes."""
        self.write(packed(mcap.DataEnd(0)))
        start, summary, offsets = self.position, bytearray(), []
        for opcode, records in self._summary_records():
            offsets.append(mcap.SummaryOffset(opcode, start + len(summary), len(records)))
            summary += records
        summary_offsets = start + len(summary)
        summary += b''.join(map(packed, offsets))
        head = struct.pack('<BQQQ', Opcode.FOOTER, 20, start, summary_offsets)
        crc = zlib.crc32(head, zlib.crc32(summary))
        self.write(bytes(summary))
        self.write(packed(mcap.Footer(start, summary_offsets, crc)))
        self.write(MAGIC)

    def _summary_records(self) -> Iterable[tuple[Opcode, bytes | bytearray]]:
        """Return the records of the summary in their order, by kind."""
        summary, statistics = self.summary, self.statistics
        statistics.channel_message_counts = self._counts
        statistics.attachment_count = len(summary.attachment_indexes)
        statistics.metadata_count = len(summary.metadata_indexes)
        statistics.chunk_count = self._chunk_count
        statistics.channel_count = len(summary.channels)
        statistics.schema_count = len(summary.schemas)
        return (
            (Opcode.SCHEMA, _joined(summary.schemas.values())),
            (Opcode.CHANNEL, _joined(summary.channels.values())),
            (Opcode.STATISTICS, packed(statistics)),
            (Opcode.CHUNK_INDEX, self._chunk_indexes),
            (Opcode.ATTACHMENT_INDEX, _joined(summary.attachment_indexes)),
            (Opcode.METADATA_INDEX, _joined(summary.metadata_indexes)),
        )


def _joined(records: Iterable[mcap.McapRecord]) -> bytes:
    return b''.join(map(packed, records))
