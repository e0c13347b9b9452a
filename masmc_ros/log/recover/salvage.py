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

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
import mmap
from typing import BinaryIO

from masmc_ros.log.chunks import index_messages, indexed_chunk, IndexedChunk, Indexes, span
from masmc_ros.log.record_stream import RecordStream
from masmc_ros.log.records import (
    all_records,
    check_chunk_size,
    chunk_at,
    cut_off_records,
    FoundChunk,
    is_sound,
    MAGIC,
    MESSAGE_HEAD,
    next_chunk,
    next_sound,
    packed,
    PRIVATE,
    RECORD_HEAD,
    records,
    stream_of,
)
from masmc_ros.log.summary import Summary
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, MessageIndex, Metadata, Schema

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
        its messages.
    offsets
        where the index of each channel begins in the file.
    index_length
        of all indexes.

    """

    start: int
    found: FoundChunk
    indexed: Indexes
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
    summary
        of what there is, complete after `write_tail`.

    """

    def __init__(self, data: mmap.mmap | bytes) -> None:
        """Read a file through."""
        self._data = data
        self.end = 0
        self.dropped = 0
        self.is_damaged = False
        self.data_end: int | None = None
        self.summary = Summary()
        self._open: _OpenChunk | None = None
        self._again: list[tuple[int, int]] = []
        """Where records begin and end that are written behind the end."""
        self._is_chunked = False
        self._partial: tuple[IndexedChunk, bytes] | None = None
        """A chunk that was cut off, as far as it goes."""
        if next(records(data), None) is not None:  # else not even a header: made anew
            self.end = len(MAGIC)
            self._take_rest(self._take_whole())

    def write_tail(self, stream: BinaryIO) -> None:
        """Write what has to stand behind `end`; `summary` is complete then."""
        tail = RecordStream(stream, self.end, self.summary)
        if not self.end:
            tail.start()
        if self.is_damaged:
            # Those in force may have stood in what cannot be read.
            for definition in (*self.summary.schemas.values(), *self.summary.channels.values()):
                tail.write(packed(definition))
        for start, end in self._again:
            self._write_again(tail, start, end)
        if self._partial is not None:
            self._add_chunk(tail, *self._partial)
        tail.finish()

    def agrees_with(self, summary: Summary) -> bool:
        """
        Tell whether a summary says of an undamaged file what is in it.

        Parts of it may be missing, as in logs of writers that leave them out.
        """
        found = self.summary
        told, counted = summary.statistics, found.statistics
        counts = {number: n for number, n in counted.channel_message_counts.items() if n}
        return (
            (not summary.chunks or summary.chunks == found.chunks)
            and (not summary.attachments or summary.attachments == found.attachments)
            and (not summary.metadata or summary.metadata == found.metadata)
            and summary.schemas.items() <= found.schemas.items()
            and summary.channels.items() <= found.channels.items()
            and (not summary.chunks or counts.keys() <= summary.channels.keys())
            and (
                not summary.has_statistics
                or (
                    told.message_count == counted.message_count
                    and told.chunk_count == len(found.chunks)
                    and told.attachment_count == len(found.attachments)
                    and told.metadata_count == len(found.metadata)
                    and {n: c for n, c in told.channel_message_counts.items() if c} == counts
                    and (told.message_start_time, told.message_end_time)
                    == (counted.message_start_time, counted.message_end_time)
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
            content = cut_off_records(rest)
            indexes = index_messages(content)
            if indexes:
                self._register_all(content)
                self._partial = indexed_chunk(content, indexes), content
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
            check_chunk_size(data, start, end)
            found = chunk_at(data, start)
            if found is None or found.end != end:
                raise _DamagedError('a chunk')
            self._register_all(found.content)
            indexed = index_messages(found.content)
            times = found.chunk.message_start_time, found.chunk.message_end_time
            if not indexed.keys() <= self._known() or (indexed and times != span(indexed)):
                raise _DamagedError('head of a chunk')
            self._open = _OpenChunk(start, found, indexed)
        elif opcode == Opcode.MESSAGE:
            if not is_sound(data, opcode, start, end):
                raise _DamagedError('a message')
            channel, _, time, _ = MESSAGE_HEAD.unpack_from(body)
            if channel not in self._known():
                raise _DamagedError('a channel')
            self.summary.count(channel, 1, time, time)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.ATTACHMENT, Opcode.METADATA):
            if not is_sound(data, opcode, start, end):
                raise _DamagedError('a record')
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._register(opcode, body, is_sure=True)
            else:
                self._note(opcode, body, start, end - start)
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
        found = self._open.indexed.get(index.channel_id, ())
        if (
            sorted(index.records) != sorted(zip(found[::2], found[1::2], strict=True))
            or stream.count != len(body)
        ):
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
        indexed = IndexedChunk(found.found.chunk, found.indexed)
        told = self.summary.note_chunk(indexed, found.start, found.found.end - found.start)
        told.message_index_offsets = found.offsets
        told.message_index_length = found.index_length

    def _known(self) -> set[int]:
        """Return the channels whose messages a reader understands."""
        return {
            number
            for number, channel in self.summary.channels.items()
            if not channel.schema_id or channel.schema_id in self.summary.schemas
        }

    def _register_all(self, content: bytes) -> None:
        for opcode, start, end in records(content, 0):
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                body = content[start + RECORD_HEAD.size:end]
                self._register(opcode, body, is_sure=True)

    def _register(self, opcode: int, body: bytes, *, is_sure: bool) -> None:
        """Note a definition; one that no checksum has told to be right only where none is."""
        summary = self.summary
        kind, known = (
            (Schema, summary.schemas) if opcode == Opcode.SCHEMA else (Channel, summary.channels)
        )
        record = kind.read(stream_of(body))
        if is_sure or record.id not in known:
            summary.register(record)

    def _note(self, opcode: int, body: bytes, start: int, length: int) -> None:
        """Note an attachment or metadata at a place of the file that is made."""
        if opcode == Opcode.METADATA:
            name = Metadata.read(stream_of(body)).name
            self.summary.note_metadata(name, start, length)
        else:
            self.summary.note_attachment(Attachment.read(stream_of(body)), start, length)

    # Writing.

    def _write_again(self, tail: RecordStream, start: int, end: int) -> None:
        """Write a record of the file behind its new end, as far as readers understand it."""
        data = self._data
        found = chunk_at(data, start)
        if found is not None:
            indexes = index_messages(found.content)
            first, last = span(indexes)
            chunk = replace(found.chunk, message_start_time=first, message_end_time=last)
            self._add_chunk(tail, IndexedChunk(chunk, indexes), found.content)
            return
        opcode, body = data[start], data[start + RECORD_HEAD.size:end]
        if opcode == Opcode.MESSAGE:
            channel, _, time, _ = MESSAGE_HEAD.unpack_from(body)
            if channel not in self._known():
                self.dropped += end - start
                return
            self.summary.count(channel, 1, time, time)
        else:
            self._note(opcode, body, tail.position, end - start)
        tail.write(data[start:end])

    def _add_chunk(self, tail: RecordStream, indexed: IndexedChunk, content: bytes) -> None:
        """Write a chunk of these records, the messages of unknown channels left out."""
        known = self._known()
        if not indexed.indexes.keys() <= known:
            content = b''.join(_of_channels(content, known))
            indexes = index_messages(content)
            if not indexes:
                return
            indexed = indexed_chunk(content, indexes)
        tail.add_chunk(indexed)


def _is_end(data: mmap.mmap | bytes, position: int) -> bool:
    return len(data) - position == len(MAGIC) and data[position:] == MAGIC


def _of_channels(content: bytes, channels: set[int]) -> Iterator[bytes]:
    """Yield the records of a chunk but the messages of other channels."""
    for opcode, start, end in all_records(content):
        if opcode == Opcode.MESSAGE:
            channel, *_ = MESSAGE_HEAD.unpack_from(content, start + RECORD_HEAD.size)
            if channel not in channels:
                continue
        yield content[start:end]
