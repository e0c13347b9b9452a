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

"""Readable records of a log that was truncated or damaged, and their copy into a new file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
import re
from typing import Any, IO, NamedTuple
import zlib

from masmc_ros.log.mcap.chunks import (
    index_messages,
    indexed_chunk,
    IndexedChunk,
    Indexes,
    OpenChunk,
    span,
)
from masmc_ros.log.mcap.record_stream import RecordStream, Stream
from masmc_ros.log.mcap.records import (
    all_records,
    Data,
    decompressed,
    LargeChunkError,
    MAGIC,
    MESSAGE_HEAD,
    packed,
    PRIVATE,
    RECORD_HEAD,
    records,
    stream_of,
)
from masmc_ros.log.mcap.summary import read_summary, Summary
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
import numpy as np

_KINDS: dict[int, Any] = {
    Opcode.HEADER: Header,
    Opcode.FOOTER: Footer,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.CHUNK_INDEX: ChunkIndex,
    Opcode.ATTACHMENT: Attachment,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex,
    Opcode.STATISTICS: Statistics,
    Opcode.METADATA: Metadata,
    Opcode.METADATA_INDEX: MetadataIndex,
    Opcode.SUMMARY_OFFSET: SummaryOffset,
    Opcode.DATA_END: DataEnd,
}
"""Records that are sound if they are equal to what mcap writes for their content."""

_COPIED = (
    Opcode.CHUNK,
    Opcode.SCHEMA,
    Opcode.CHANNEL,
    Opcode.MESSAGE,
    Opcode.ATTACHMENT,
    Opcode.METADATA,
)
"""Records that a new file takes over; the writer makes all others."""

_HEADS = re.compile(rb'(?s)(?=[\x06\x09\x0c].{5}\0\0\0|\x0f\x04\0{7})')
"""Possible starts of a chunk, attachment or metadata below 2**40 bytes, or of the data end."""

_BLOCK = 256 * 1024
"""Bytes of single messages that are compressed together."""


class _Found(NamedTuple):
    """
    A sound record.

    Attributes
    ----------
    opcode, start, end
        kind of the record and its place in the file.
    chunk, content, indexes
        of a chunk: the record, its unpacked records, the indexes of its messages.

    """

    opcode: int
    start: int
    end: int
    chunk: Chunk | None = None
    content: bytes = b''
    indexes: Indexes | None = None


class Salvage:
    """
    Readable records of a file.

    Attributes
    ----------
    dropped
        bytes of the file that cannot be read.
    damaged
        first and last log time in ns of each damaged chunk, as its head states them.
    is_complete
        whether the file has its end, and every checksum, index and count is right.

    """

    def __init__(self, data: Data, stream: IO[bytes]) -> None:
        """
        Read a file.

        Parameters
        ----------
        data
            content of the file.
        stream
            the same file, for mcap's reader.

        Raises
        ------
        LargeChunkError
            if a chunk without damage is too large to be unpacked.

        """
        self._data = data
        self.dropped = 0
        self.damaged: list[tuple[int, int]] = []
        self._copied: list[int] = []
        self._summary = Summary()
        self._is_consistent = True
        self._data_end: int | None = None
        self._footer: int | None = None
        self._indexes: Indexes = {}
        self._has_gap = False
        self._read()
        self.is_complete = self._check_end(stream)

    def _read(self) -> None:
        data, position = self._data, len(MAGIC)
        while position < len(data) and self._footer is None:
            found = _record_at(data, position, self._indexes)
            if found is None:
                self._note_damage(position)
                following = _next_record(data, position + 1)
                self.dropped += following - position
                position = following
            else:
                self._take(found)
                position = found.end

    def _note_damage(self, start: int) -> None:
        self._is_consistent = False
        opcode, _, end = next(records(self._data, start), (0, 0, 0))
        if opcode == Opcode.CHUNK and end - start >= RECORD_HEAD.size + 16:
            body = self._data[start + RECORD_HEAD.size:start + RECORD_HEAD.size + 16]
            first, last = (int.from_bytes(part, 'little') for part in (body[:8], body[8:]))
            if first <= last:
                self.damaged.append((first, last))

    def _take(self, found: _Found) -> None:
        opcode, start, end, chunk, content, indexes = found
        body = b'' if chunk else self._data[start + RECORD_HEAD.size:end]
        summary = self._summary
        if self._data_end is not None:
            # Definitions in a chunk have a checksum; those of the summary stand in for lost ones.
            self._define(opcode, body, is_certain=False)
            self._footer = start if opcode == Opcode.FOOTER else None
            return
        if opcode in _COPIED:
            self._copied.append(start)
            # Definitions may be in the part that is lost: the new file then starts with all.
            self._has_gap |= self.dropped > 0
        elif opcode == Opcode.MESSAGE_INDEX and summary.chunks:
            channel = int.from_bytes(body[:2], 'little')
            summary.chunks[-1].message_index_offsets[channel] = start
            summary.chunks[-1].message_index_length += end - start
            return
        elif opcode >= PRIVATE:
            self.dropped += end - start
        self._indexes = indexes or {}
        if chunk is not None and indexes is not None:
            times = chunk.message_start_time, chunk.message_end_time
            self._is_consistent &= not indexes or times == span(indexes)
            summary.note_chunk(IndexedChunk(chunk, indexes), start, end - start)
            for kind, first, last in all_records(content):
                if kind != Opcode.MESSAGE:
                    self._define(kind, content[first + RECORD_HEAD.size:last], is_certain=True)
        elif opcode == Opcode.MESSAGE:
            channel, _, time, _ = MESSAGE_HEAD.unpack_from(body)
            summary.count(channel, 1, time, time)
        elif opcode == Opcode.ATTACHMENT:
            summary.note_attachment(Attachment.read(stream_of(body)), start, end - start)
        elif opcode == Opcode.METADATA:
            summary.note_metadata(Metadata.read(stream_of(body)).name, start, end - start)
        elif opcode == Opcode.DATA_END:
            self._data_end = start
            crc = int.from_bytes(body, 'little')
            with memoryview(self._data) as whole, whole[:start] as before:
                self._is_consistent &= crc in (0, zlib.crc32(before) if crc else 0)
        else:
            self._define(opcode, body, is_certain=True)

    def _define(self, opcode: int, body: bytes, *, is_certain: bool) -> None:
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            record = _KINDS[opcode].read(stream_of(body))
            summary = self._summary
            known = summary.schemas if opcode == Opcode.SCHEMA else summary.channels
            if is_certain or record.id not in known:
                summary.register(record)

    def _check_end(self, stream: IO[bytes]) -> bool:
        """Return True if the file has an end that agrees with its content."""
        footer, begin = self._footer, self._data_end
        if footer is None or begin is None or not self._is_consistent:
            return False
        end = footer + RECORD_HEAD.size + 20
        crc = int.from_bytes(self._data[end - 4:end], 'little')
        begin += RECORD_HEAD.size + 4
        start = int.from_bytes(self._data[footer + RECORD_HEAD.size:][:8], 'little')
        if (
            self._data[end:] != MAGIC
            or start != (begin if begin < footer else 0)
            or crc not in (0, zlib.crc32(self._data[begin:end - 4]))
        ):
            return False
        try:
            stated = read_summary(stream)
        except Exception:  # mcap raises many kinds for damaged bytes
            return False
        return stated is None or self._summary.agrees_with(stated)

    def write(self, stream: Stream) -> Summary:
        """Write the readable records into a new file; return its summary."""
        output, definitions = RecordStream(stream), self._summary
        known = {
            number
            for number, channel in definitions.channels.items()
            if not channel.schema_id or channel.schema_id in definitions.schemas
        }
        output.start()
        output.summary.schemas = definitions.schemas
        output.summary.channels = definitions.channels
        if self._has_gap:
            for record in (*definitions.schemas.values(), *definitions.channels.values()):
                output.write(packed(record))
        loose = OpenChunk()
        for position in self._copied:
            found = _record_at(self._data, position)
            assert found is not None
            opcode, start, end, chunk, content, indexes = found
            body = b'' if chunk else self._data[start + RECORD_HEAD.size:end]
            if loose.indexes and (chunk or loose.size > _BLOCK):
                output.add_chunk(indexed_chunk(loose.content(), loose.indexes))
                loose = OpenChunk()
            if chunk is not None and indexes is not None:
                _add_chunk(output, chunk, content, indexes, known)
            elif opcode == Opcode.MESSAGE:
                channel, _, log_time, publish_time = MESSAGE_HEAD.unpack_from(body)
                if channel in known:
                    data = body[MESSAGE_HEAD.size:]
                    loose.add_message(channel, log_time, publish_time, data)
            elif opcode == Opcode.ATTACHMENT:
                output.add_attachment(Attachment.read(stream_of(body)))
            elif opcode == Opcode.METADATA:
                output.add_metadata(Metadata.read(stream_of(body)))
            else:
                output.write(self._data[start:end])
        if loose.indexes:
            output.add_chunk(indexed_chunk(loose.content(), loose.indexes))
        output.finish()
        return output.summary


def _record_at(data: Data, start: int, indexes: Indexes | None = None) -> _Found | None:
    """
    Return the record at a place of a file; None if it is not sound.

    Message indexes are compared with `indexes` if these are known.
    """
    opcode, _, end = next(records(data, start), (0, 0, 0))
    if not opcode:
        return None
    body = data[start + RECORD_HEAD.size:end]
    try:
        if opcode == Opcode.CHUNK:
            stream = stream_of(body)
            chunk = Chunk.read(stream)
            content = decompressed(chunk)
            is_sound = (stream.count, len(content)) == (len(body), chunk.uncompressed_size)
            made = _Found(opcode, start, end, chunk, content, index_messages(content))
            return made if is_sound else None
        if opcode == Opcode.MESSAGE:
            is_sound = len(body) >= MESSAGE_HEAD.size
        elif opcode == Opcode.MESSAGE_INDEX:
            is_sound = _is_index(body, indexes or {})
        elif opcode == Opcode.ATTACHMENT:
            crc = int.from_bytes(body[-4:], 'little')
            is_sound = crc in (0, zlib.crc32(body[:-4])) and _again(opcode, body)[:-4] == body[:-4]
        else:
            is_sound = opcode >= PRIVATE or _again(opcode, body) == body
    except LargeChunkError as error:
        raise LargeChunkError(
            f'the chunk at byte {start} is {error}: write the log again with smaller chunks'
        ) from None
    except Exception:  # mcap and the compressors raise many kinds for damaged bytes
        return None
    return _Found(opcode, start, end) if is_sound else None


def _again(opcode: int, body: bytes) -> bytes:
    """Return the content of a record as mcap writes it."""
    return packed(_KINDS[opcode].read(stream_of(body)))[RECORD_HEAD.size:]


def _is_index(body: bytes, indexes: Indexes) -> bool:
    """Return True if a message index has the messages of its channel, in any order."""
    entry = np.dtype([('time', '<u8'), ('place', '<u8')])
    stated = np.frombuffer(body[6:], entry)
    expected = np.array(indexes.get(int.from_bytes(body[:2], 'little'), ()), '<u8').view(entry)
    has_size = int.from_bytes(body[2:6], 'little') == len(body) - 6
    return has_size and np.array_equal(np.sort(stated), np.sort(expected))


def _next_record(data: Data, position: int) -> int:
    """Return the next place with a sound record that carries data, or the end of the file."""
    for match in _HEADS.finditer(data, position):
        if _record_at(data, match.start()) is not None:
            return match.start()
    return len(data)


def _add_chunk(
    output: RecordStream, chunk: Chunk, content: bytes, indexes: Indexes, known: set[int]
) -> None:
    """Write a chunk without the messages of channels that are not defined in the file."""
    if indexes.keys() <= known:
        first, last = span(indexes)
        chunk = replace(chunk, message_start_time=first, message_end_time=last)
        output.add_chunk(IndexedChunk(chunk, indexes))
        return
    content = b''.join(_of_channels(content, known))
    indexes = index_messages(content)
    if indexes:
        output.add_chunk(indexed_chunk(content, indexes))


def _of_channels(content: bytes, channels: set[int]) -> Iterator[bytes]:
    """Yield the records of a chunk without the messages of other channels."""
    for opcode, start, end in all_records(content):
        if opcode == Opcode.MESSAGE:
            channel, *_ = MESSAGE_HEAD.unpack_from(content, start + RECORD_HEAD.size)
            if channel not in channels:
                continue
        yield content[start:end]
