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

"""What can be had of a log that was cut off or damaged, and the end that makes it complete."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
import mmap
import struct
from typing import BinaryIO
import zlib

from masmc_ros import __version__
from masmc_ros.log.records import (
    all_records,
    chunk_at,
    cut_off_chunk,
    FoundChunk,
    index_messages,
    is_sound,
    MAGIC,
    MESSAGE_HEAD,
    new_chunk,
    next_chunk,
    next_sound,
    PRIVATE,
    RECORD_HEAD,
    records,
    stream_of,
)
from masmc_ros.log.recover.summary import Summary
from mcap.data_stream import RecordBuilder
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

_MADE_ANEW = frozenset(
    {
        Opcode.HEADER,
        Opcode.MESSAGE_INDEX,
        Opcode.DATA_END,
        Opcode.FOOTER,
        Opcode.STATISTICS,
        Opcode.SUMMARY_OFFSET,
        Opcode.CHUNK_INDEX,
        Opcode.ATTACHMENT_INDEX,
        Opcode.METADATA_INDEX,
    }
)
"""Records that say nothing which the others do not say."""


class _DamagedError(ValueError):
    """A record is not what it says."""


@dataclass
class _OpenChunk:
    """
    A chunk whose message indexes are being read.

    Attributes
    ----------
    start
        where it begins in the file.
    found
        what is in it.
    indexed
        log time and offset of its messages, by channel.
    offsets
        where the index of each channel begins in the file.
    index_length
        of all indexes.

    """

    start: int
    found: FoundChunk
    indexed: dict[int, list[tuple[int, int]]]
    offsets: dict[int, int] = field(default_factory=dict)
    index_length: int = 0


class Salvage:
    """
    What the records of a file say, and the end that makes it a complete one.

    Up to `end` the file is whole and stays as it is, byte for byte. What can be read of the
    rest is written behind that by `write_tail`, in its order.

    Attributes
    ----------
    end
        up to where the file stays as it is.
    dropped
        bytes of the file in which nothing could be read.
    is_damaged
        whether something can be read behind bytes that cannot.
    data_end
        where the records ended that hold data, if nothing was broken; else None.
    statistics
        of what there is, complete after `write_tail`.

    """

    def __init__(self, data: mmap.mmap | bytes) -> None:
        """Read a file through."""
        self._data = data
        self.end = 0
        self.dropped = 0
        self.is_damaged = False
        self.data_end: int | None = None
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
        self._again: list[tuple[int, int]] = []
        """Where records begin and end that are written behind the end."""
        self._is_chunked = False
        self._partial: tuple[Chunk, bytes] | None = None
        """A chunk that was cut off, as far as it goes."""
        if next(records(data), None) is not None:  # else not even a header: made anew
            self.end = len(MAGIC)
            self._take_rest(self._take_whole())

    def write_tail(self, stream: BinaryIO) -> None:
        """Write what has to stand behind `end`; `statistics` are complete then."""
        if not self.end:
            stream.write(_empty_log())
            return
        tail = _Tail(stream, self.end)
        if self.is_damaged:
            # Those in force may have stood in what cannot be read.
            for definition in (*self._schemas.values(), *self._channels.values()):
                definition.write(tail.builder)
        for start, end in self._again:
            self._write_again(tail, start, end)
            tail.flush()
        if self._partial is not None:
            self._add_chunk(tail, *self._partial)
        statistics = self.statistics
        statistics.attachment_count = len(self._attachments)
        statistics.metadata_count = len(self._metadata)
        statistics.chunk_count = len(self._chunks)
        statistics.channel_count = len(self._channels)
        statistics.schema_count = len(self._schemas)
        DataEnd(0).write(tail.builder)
        tail.flush()
        self._write_summary(tail)

    def agrees_with(self, summary: Summary) -> bool:
        """
        Tell whether a summary says of an undamaged file what is in it.

        Parts of it may be missing, as in logs of writers that leave them out.
        """
        found, told = self.statistics, summary.statistics
        counts = {number: count for number, count in found.channel_message_counts.items() if count}
        return (
            (not summary.chunks or summary.chunks == self._chunks)
            and (not summary.attachments or summary.attachments == self._attachments)
            and (not summary.metadata or summary.metadata == self._metadata)
            and all(self._schemas.get(each.id) == each for each in summary.schemas)
            and all(self._channels.get(each.id) == each for each in summary.channels)
            and (not summary.chunks or counts.keys() <= {each.id for each in summary.channels})
            and (
                told is None
                or (
                    told.message_count == found.message_count
                    and told.chunk_count == len(self._chunks)
                    and told.attachment_count == len(self._attachments)
                    and told.metadata_count == len(self._metadata)
                    and {n: c for n, c in told.channel_message_counts.items() if c} == counts
                    and (told.message_start_time, told.message_end_time)
                    == (found.message_start_time, found.message_end_time)
                )
            )
        )

    # Reading.

    def _take_whole(self) -> int:
        """Take the records as far as they are whole; return where that ends."""
        data, position = self._data, len(MAGIC)
        for opcode, start, end in records(data):
            if opcode == Opcode.DATA_END and end - start == RECORD_HEAD.size + 4:
                position = start
                try:
                    self._close_chunk()
                except _DamagedError:
                    break
                self.end = self.data_end = start
                return start
            try:
                self._take_record(opcode, start, end)
            except _DamagedError:
                break
            self.end = position = end
        if self._open is not None:
            # Its message indexes may be cut off or wrong: it is written again with new ones.
            self.end = self._open.start
            self._again.append((self._open.start, self._open.found.end))
            self._open = None
        return position

    def _take_rest(self, position: int) -> None:
        """Note what can be read behind a place, whatever is broken there."""
        data, is_readable = self._data, True
        while position < len(data):
            found = self._record_at(position)
            if found is not None:
                is_readable = True
                position = found
                continue
            if _is_end(data, position):
                return
            skipped = self._end_of_damaged_chunk(position)
            if skipped is not None:
                # Others may have come to stand in it.
                inner = next_chunk(data, position + 1, skipped)
                skipped = skipped if inner is None else inner
                self.dropped += skipped - position
                position = skipped
                continue
            behind = next_sound(data, position + 1, has_chunks=self._is_chunked)
            following = len(data) if behind is None else behind
            if is_readable and behind is None:
                self._take_partial(data[position:])
            self.dropped += following - position
            position, is_readable = following, False

    def _record_at(self, start: int) -> int | None:
        """Note the record at a place behind the end; return where it ends, None for none."""
        data = self._data
        found = chunk_at(data, start)
        if found is not None:
            self._register_all(found.content)
            self._keep(start, found.end)
            return found.end
        opcode, _, end = next(records(data, start), (0, 0, 0))
        self._is_chunked |= opcode == Opcode.CHUNK
        if opcode in _MADE_ANEW or opcode >= PRIVATE:
            return end if self._is_followed(end) else None
        # In a log of chunks single messages are those of a damaged one.
        if not is_sound(data, opcode, start, end) or (
            opcode == Opcode.MESSAGE and self._is_chunked
        ):
            return None
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            self._register(opcode, data[start + RECORD_HEAD.size:end], is_sure=False)
        else:
            self._keep(start, end)
        return end

    def _keep(self, start: int, end: int) -> None:
        """Let a record be written behind the end: what was broken is before it."""
        self._again.append((start, end))
        self.is_damaged = True

    def _end_of_damaged_chunk(self, start: int) -> int | None:
        """Return where a chunk ends whose records are damaged, but not its length."""
        opcode, _, end = next(records(self._data, start), (0, 0, 0))
        return end if opcode == Opcode.CHUNK and self._is_followed(end) else None

    def _is_followed(self, position: int) -> bool:
        """Tell whether at a place a record or the end of the file stands."""
        data = self._data
        if position == len(data) or _is_end(data, position):
            return True
        opcode, _, _ = next(records(data, position), (0, 0, 0))
        return 0 < opcode <= Opcode.DATA_END or opcode >= PRIVATE

    def _take_partial(self, rest: bytes) -> None:
        """Take what can be had of a chunk at the end that was cut off."""
        opcode, length = RECORD_HEAD.unpack_from(rest.ljust(RECORD_HEAD.size, b'\0'))
        if opcode != Opcode.CHUNK or RECORD_HEAD.size + length <= len(rest):
            return  # a whole one is damaged: nobody can tell which of its messages are right
        try:
            salvaged = cut_off_chunk(rest)
            if salvaged is not None:
                self._register_all(salvaged[1])
                self._partial = salvaged
        except Exception:  # whatever a library says of bytes that were never written so
            return

    def _take_record(self, opcode: int, start: int, end: int) -> None:
        """Take a record of the part that is whole; _DamagedError where it is not."""
        data = self._data
        body = data[start + RECORD_HEAD.size:end]
        if opcode == Opcode.MESSAGE_INDEX:
            self._take_index(start, end, body)
            return
        self._close_chunk()
        self._is_chunked |= opcode == Opcode.CHUNK
        if opcode == Opcode.CHUNK:
            found = chunk_at(data, start)
            if found is None or found.end != end:
                raise _DamagedError('a chunk')
            self._register_all(found.content)
            indexes, _ = index_messages(found.content)
            indexed = {index.channel_id: sorted(index.records) for index in indexes}
            times = [time for each in indexed.values() for time, _ in each]
            span = (found.chunk.message_start_time, found.chunk.message_end_time)
            if not indexed.keys() <= self._known() or (times and span != (min(times), max(times))):
                raise _DamagedError('head of a chunk')
            self._open = _OpenChunk(start, found, indexed)
        elif opcode == Opcode.MESSAGE:
            if not is_sound(data, opcode, start, end):
                raise _DamagedError('a message')
            channel, _, time, _ = MESSAGE_HEAD.unpack_from(body)
            if channel not in self._known():
                raise _DamagedError('a channel')
            self._count(channel, 1, time, time)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.ATTACHMENT, Opcode.METADATA):
            if not is_sound(data, opcode, start, end):
                raise _DamagedError('a record')
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._register(opcode, body, is_sure=True)
            else:
                self._note(opcode, body, start)
        elif not (opcode == Opcode.HEADER or opcode >= PRIVATE) or chunk_at(data, start):
            raise _DamagedError('a record that has no place here')

    def _take_index(self, start: int, end: int, body: bytes) -> None:
        if self._open is None:
            raise _DamagedError('an index without a chunk')
        try:
            stream = stream_of(body)
            index = MessageIndex.read(stream)
        except Exception as error:  # as in `_take_partial`
            raise _DamagedError('an index') from error
        told = sorted(index.records)
        if told != self._open.indexed.get(index.channel_id, []) or stream.count != len(body):
            raise _DamagedError('an index')
        self._open.offsets[index.channel_id] = start
        self._open.index_length += end - start

    def _close_chunk(self) -> None:
        """Note a chunk that is followed by something else, so that its indexes are whole."""
        found = self._open
        if found is None:
            return
        if found.offsets and not found.indexed.keys() <= found.offsets.keys():
            raise _DamagedError('an index is missing')
        self._open = None
        counts = Counter({channel: len(each) for channel, each in found.indexed.items()})
        length = found.found.end - found.start
        self._note_chunk(found.found.chunk, found.start, length, counts)
        self._chunks[-1].message_index_offsets = found.offsets
        self._chunks[-1].message_index_length = found.index_length

    def _known(self) -> set[int]:
        """Return the channels whose messages a reader understands."""
        return {
            number
            for number, channel in self._channels.items()
            if not channel.schema_id or channel.schema_id in self._schemas
        }

    def _register_all(self, content: bytes) -> None:
        for opcode, start, end in records(content, 0):
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                body = content[start + RECORD_HEAD.size:end]
                self._register(opcode, body, is_sure=True)

    def _register(self, opcode: int, body: bytes, *, is_sure: bool) -> None:
        """Note a definition; one that no checksum has told to be right only where none is."""
        kind, known = (
            (Schema, self._schemas) if opcode == Opcode.SCHEMA else (Channel, self._channels)
        )
        record = kind.read(stream_of(body))
        if is_sure or record.id not in known:
            known[record.id] = record

    # Counting.

    def _note(self, opcode: int, body: bytes, start: int) -> None:
        """Note an attachment or metadata at a place of the file that is made."""
        length = RECORD_HEAD.size + len(body)
        if opcode == Opcode.METADATA:
            name = Metadata.read(stream_of(body)).name
            self._metadata.append(MetadataIndex(offset=start, length=length, name=name))
            return
        attachment = Attachment.read(stream_of(body))
        self._attachments.append(
            AttachmentIndex(
                offset=start,
                length=length,
                create_time=attachment.create_time,
                log_time=attachment.log_time,
                data_size=len(attachment.data),
                name=attachment.name,
                media_type=attachment.media_type,
            )
        )

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

    # Writing.

    def _write_again(self, tail: _Tail, start: int, end: int) -> None:
        """Write a record of the file behind its new end, as far as readers understand it."""
        data = self._data
        found = chunk_at(data, start)
        if found is not None:
            self._add_chunk(tail, found.chunk, found.content)
            return
        opcode, body = data[start], data[start + RECORD_HEAD.size:end]
        if opcode == Opcode.MESSAGE:
            channel, _, time, _ = MESSAGE_HEAD.unpack_from(body)
            if channel not in self._known():
                self.dropped += end - start
                return
            self._count(channel, 1, time, time)
        else:
            self._note(opcode, body, tail.position)
        tail.builder.write(data[start:end])

    def _add_chunk(self, tail: _Tail, chunk: Chunk, content: bytes) -> None:
        """Write a chunk and the indexes of its messages, those of unknown channels left out."""
        indexes, counts = index_messages(content)
        if not counts.keys() <= self._known():
            content = b''.join(_of_channels(content, self._known()))
            filtered = new_chunk(content)
            if filtered is None:
                return
            chunk = filtered
            indexes, counts = index_messages(content)
        times = [time for index in indexes for time, _ in index.records] or [0]
        chunk.message_start_time, chunk.message_end_time = min(times), max(times)
        start = tail.position
        chunk.write(tail.builder)
        after = tail.position
        self._note_chunk(chunk, start, after - start, counts)
        for index in indexes:
            self._chunks[-1].message_index_offsets[index.channel_id] = tail.position
            index.write(tail.builder)
        self._chunks[-1].message_index_length = tail.position - after

    def _write_summary(self, tail: _Tail) -> None:
        summary, offsets = tail.position, []
        for opcode, group in (
            (Opcode.SCHEMA, self._schemas.values()),
            (Opcode.CHANNEL, self._channels.values()),
            (Opcode.STATISTICS, (self.statistics,)),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        ):
            start = tail.position
            for record in group:
                record.write(tail.builder)
            offsets.append(SummaryOffset(opcode, start, tail.position - start))
        summary_offsets = tail.position
        for offset in offsets:
            offset.write(tail.builder)
        head = struct.pack('<BQQQ', Opcode.FOOTER, 20, summary, summary_offsets)
        crc = zlib.crc32(head, zlib.crc32(tail.flush()))
        Footer(summary, summary_offsets, crc).write(tail.builder)
        tail.builder.write(MAGIC)
        tail.flush()


class _Tail:
    """What is written behind the end of a file, from its records' bytes on."""

    def __init__(self, stream: BinaryIO, start: int) -> None:
        self.builder = RecordBuilder()
        self._stream = stream
        self._written = start

    @property
    def position(self) -> int:
        """Where in the file the next record begins."""
        return self._written + int(self.builder.count)

    def flush(self) -> bytes:
        """Write what was built, and return it."""
        built: bytes = self.builder.end()
        self._stream.write(built)
        self._written += len(built)
        return built


def _is_end(data: mmap.mmap | bytes, position: int) -> bool:
    return len(data) - position == len(MAGIC) and data[position:] == MAGIC


def _of_channels(content: bytes, channels: set[int]) -> Iterator[bytes]:
    """Yield the records of a chunk but the messages of other channels."""
    for opcode, start, end in all_records(content):
        if opcode == Opcode.MESSAGE:
            (channel,) = struct.unpack_from('<H', content, start + RECORD_HEAD.size)
            if channel not in channels:
                continue
        yield content[start:end]


def _empty_log() -> bytes:
    """Return a log with nothing in it, for a file that was cut off before it had anything."""
    stream = BytesIO()
    writer = Writer(stream)
    writer.start(profile=Profile.ROS2, library=f'masmc_ros {__version__}')
    writer.finish()
    return stream.getvalue()
