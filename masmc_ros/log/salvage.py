# SPDX-License-Identifier: Apache-2.0
"""What can be had of a log that was cut off, and the end that makes it a complete one."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from io import BytesIO
import mmap
import struct
import zlib

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.well_known import Profile
from mcap.writer import Writer

from masmc_ros import __version__
from masmc_ros.log.records import (
    cut_off_chunk,
    decompressed,
    index_messages,
    MAGIC,
    MESSAGE_HEAD,
    RECORD_HEAD,
    records,
)


@dataclass
class _OpenChunk:
    """A chunk whose message indexes are being read.

    Attributes:
        start: where it begins in the file.
        length: of the whole record.
        chunk: the record.
        content: its records, decompressed.
        indexed: log time and offset of its messages, by channel.
        offsets: where the index of each channel begins in the file.
        index_length: of all indexes.
    """

    start: int
    length: int
    chunk: Chunk
    content: bytes
    indexed: dict[int, list[tuple[int, int]]]
    offsets: dict[int, int] = field(default_factory=dict)
    index_length: int = 0


class Salvage:
    """What the whole records of a file say, and the end that makes it a complete one.

    Attributes:
        end: up to where the file stays as it is.
        dropped: bytes behind it that were no whole record.
        statistics: of what there is, complete after `tail`.
    """

    def __init__(self) -> None:
        """Begin with nothing."""
        self.end = 0
        self.dropped = 0
        self.statistics = Statistics(
            attachment_count=0,
            channel_count=0,
            channel_message_counts=Counter(),
            chunk_count=0,
            message_count=0,
            message_end_time=0,
            message_start_time=0,
            metadata_count=0,
            schema_count=0,
        )
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._open: _OpenChunk | None = None
        self._again: list[tuple[Chunk, bytes]] = []
        """Chunks that are written behind the end, with their records."""

    def take(self, data: mmap.mmap) -> None:
        """Read a file as far as it is whole."""
        if next(records(data), None) is None:
            return  # not even a header: the log is made anew
        self.end = len(MAGIC)
        rest = b''
        for opcode, start, end in records(data):
            if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                break
            try:
                self._take_record(opcode, start, data[start + RECORD_HEAD.size : end])
            except Exception:  # whatever a library says of bytes that were never written so
                # A damaged chunk is left out: nobody can tell which of its messages are right.
                self.dropped = len(data) - self.end
                break
            self.end = end
        else:
            rest = data[self.end :]
            self.dropped = len(rest)
        if self._open is not None:
            # Its message indexes may be cut off: it is written again with new ones.
            self.end = self._open.start
            self._again.append((self._open.chunk, self._open.content))
        try:
            salvaged = cut_off_chunk(rest)
            if salvaged is None:
                return
            self._register_all(salvaged[1])
            _, counts = index_messages(salvaged[1])
        except Exception:  # as above
            return
        if counts.keys() <= self._channels.keys():
            self._again.append(salvaged)

    def tail(self) -> bytes:
        """Return what has to stand behind `end`; `statistics` are complete then."""
        if not self.end:
            return _empty_log()
        builder = RecordBuilder()
        for chunk, content in self._again:
            self._add_chunk(builder, chunk, content)
        statistics = self.statistics
        statistics.attachment_count = len(self._attachments)
        statistics.metadata_count = len(self._metadata)
        statistics.chunk_count = len(self._chunks)
        statistics.channel_count = len(self._channels)
        statistics.schema_count = len(self._schemas)
        DataEnd(0).write(builder)
        summary = self.end + builder.count
        offsets = []
        for opcode, group in (
            (Opcode.SCHEMA, self._schemas.values()),
            (Opcode.CHANNEL, self._channels.values()),
            (Opcode.STATISTICS, (statistics,)),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        ):
            start = self.end + builder.count
            for record in group:
                record.write(builder)
            length = self.end + builder.count - start
            offsets.append(SummaryOffset(opcode, start, length))
        summary_offsets = self.end + builder.count
        for offset in offsets:
            offset.write(builder)
        data = builder.end()
        head = struct.pack('<BQQQ', Opcode.FOOTER, 20, summary, summary_offsets)
        crc = zlib.crc32(head, zlib.crc32(data[summary - self.end :]))
        Footer(summary, summary_offsets, crc).write(builder)
        return data + builder.end() + MAGIC

    def _take_record(self, opcode: int, start: int, body: bytes) -> None:
        """Take a whole record; raises whatever where its content is damaged."""
        length = RECORD_HEAD.size + len(body)
        if opcode == Opcode.MESSAGE_INDEX:
            if self._open is not None:
                index = MessageIndex.read(_stream(body))
                if sorted(index.records) != self._open.indexed.get(index.channel_id):
                    raise ValueError('index of messages')
                self._open.offsets[index.channel_id] = start
                self._open.index_length += length
            return
        self._close_chunk()
        if opcode == Opcode.CHUNK:
            chunk = Chunk.read(_stream(body))
            content = decompressed(chunk)
            self._register_all(content)
            indexes, _ = index_messages(content)
            indexed = {index.channel_id: sorted(index.records) for index in indexes}
            times = [time for records in indexed.values() for time, _ in records]
            span = (chunk.message_start_time, chunk.message_end_time)
            if not indexed.keys() <= self._channels.keys() or (
                times and span != (min(times), max(times))
            ):
                raise ValueError('head of a chunk')
            self._open = _OpenChunk(start, length, chunk, content, indexed)
        elif opcode == Opcode.MESSAGE:
            channel, _, time = MESSAGE_HEAD.unpack_from(body)
            if channel not in self._channels:
                raise ValueError('channel')
            self._count(channel, 1, time, time)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            self._register(opcode, body)
        elif opcode == Opcode.ATTACHMENT:
            attachment = Attachment.read(_stream(body))
            index_of_attachment = AttachmentIndex(
                offset=start,
                length=length,
                create_time=attachment.create_time,
                log_time=attachment.log_time,
                data_size=len(attachment.data),
                name=attachment.name,
                media_type=attachment.media_type,
            )
            self._attachments.append(index_of_attachment)
        elif opcode == Opcode.METADATA:
            name = Metadata.read(_stream(body)).name
            self._metadata.append(MetadataIndex(offset=start, length=length, name=name))

    def _close_chunk(self) -> None:
        """Note a chunk that is followed by something else, so that its indexes are whole."""
        found, self._open = self._open, None
        if found is None:
            return
        counts = Counter({channel: len(each) for channel, each in found.indexed.items()})
        self._note_chunk(found.chunk, found.start, found.length, counts)
        self._chunks[-1].message_index_offsets = found.offsets
        self._chunks[-1].message_index_length = found.index_length

    def _add_chunk(self, builder: RecordBuilder, chunk: Chunk, content: bytes) -> None:
        """Write a chunk and the indexes of its messages."""
        indexes, counts = index_messages(content)
        start = self.end + builder.count
        chunk.write(builder)
        after = self.end + builder.count
        self._note_chunk(chunk, start, after - start, counts)
        for index in indexes:
            self._chunks[-1].message_index_offsets[index.channel_id] = self.end + builder.count
            index.write(builder)
        self._chunks[-1].message_index_length = self.end + builder.count - after

    def _note_chunk(self, chunk: Chunk, start: int, length: int, counts: Counter[int]) -> None:
        index = ChunkIndex(
            message_start_time=chunk.message_start_time,
            message_end_time=chunk.message_end_time,
            chunk_start_offset=start,
            chunk_length=length,
            message_index_offsets={},
            message_index_length=0,
            compression=chunk.compression,
            compressed_size=len(chunk.data),
            uncompressed_size=chunk.uncompressed_size,
        )
        self._chunks.append(index)
        for channel, count in counts.items():
            self._count(channel, count, chunk.message_start_time, chunk.message_end_time)

    def _count(self, channel: int, count: int, begin: int, end: int) -> None:
        found = self.statistics
        is_first = not found.message_count
        found.message_start_time = begin if is_first else min(begin, found.message_start_time)
        found.message_end_time = max(end, found.message_end_time)
        found.message_count += count
        found.channel_message_counts[channel] += count

    def _register_all(self, content: bytes) -> None:
        for opcode, start, end in records(content, 0):
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._register(opcode, content[start + RECORD_HEAD.size : end])

    def _register(self, opcode: int, body: bytes) -> None:
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(_stream(body))
            self._schemas[schema.id] = schema
        else:
            channel = Channel.read(_stream(body))
            self._channels[channel.id] = channel


def _empty_log() -> bytes:
    """Return a log with nothing in it, for a file that was cut off before it had anything."""
    stream = BytesIO()
    writer = Writer(stream)
    writer.start(profile=Profile.ROS2, library=f'masmc_ros {__version__}')
    writer.finish()
    return stream.getvalue()


def _stream(data: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(data))
