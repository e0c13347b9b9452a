# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Readable records of a log that was truncated or damaged, and their copy into a new file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
import re
import struct
from typing import NamedTuple

from masmc_ros.log.mcap.chunks import (
    INDEX_HEAD,
    index_messages,
    indexed_chunk,
    IndexedChunk,
    Indexes,
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
    parsed,
    RECORD_HEAD,
    records,
)
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    Channel,
    Chunk,
    DataEnd,
    Header,
    McapRecord,
    Message,
    Metadata,
    Schema,
    Statistics,
)

_HEADS = re.compile(rb'(?s)(?=[\x06\x09\x0c].{5}\0\0\0|\x0f\x04\0{7})')
"""Possible starts of a chunk, attachment or metadata below 2**40 bytes, or of the data end."""


_PRIVATE = 0x80
"""First opcode of private records, which readers skip."""

_TIMES = struct.Struct('<QQ')
"""First and last log time in ns at the start of a chunk."""

_Definitions = dict[tuple[type, int], Schema | Channel]
"""Schemas and channels by kind and number."""


class _SoundRecord(NamedTuple):
    """
    A record without damage.

    Attributes
    ----------
    end
        place in the file at which it ends.
    record
        its content; None for an index of messages, and for a private record.
    definitions
        the record if it is a schema or a channel, or those in a chunk.
    content
        unpacked records of a chunk.
    indexes
        indexes of the messages of a chunk.

    """

    end: int
    record: McapRecord | None = None
    definitions: Sequence[Schema | Channel] = ()
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
    has_damage
        whether a part of the file is not a sound record.
    header
        of the file; None if it cannot be read.

    """

    def __init__(self, data: Data) -> None:
        """
        Read a file.

        Parameters
        ----------
        data
            content of the file.

        Raises
        ------
        LargeChunkError
            if a chunk without damage is too large to be unpacked.

        """
        self.dropped = 0
        self.damaged: list[tuple[int, int]] = []
        self.has_damage = False
        self.header: Header | None = None
        self._data = data
        self._copied: list[int] = []
        in_chunks: _Definitions = {}
        outside: _Definitions = {}
        in_summary: _Definitions = {}
        is_over = False
        for start, end, sound in _parts(data):
            if sound is None or data[start] >= _PRIVATE:
                self.dropped += end - start
            if sound is None:
                self._note_damage(start)
                continue
            record = sound.record
            if isinstance(record, Header):
                self.header = record
            elif isinstance(record, DataEnd):
                is_over = True
            elif isinstance(record, (Chunk, Message, Attachment, Metadata)):
                self._copied.append(start)
            known = in_chunks if isinstance(record, Chunk) else in_summary if is_over else outside
            known.update({(type(each), each.id): each for each in sound.definitions})
        # Those in a chunk have a checksum; those of the summary stand in for lost ones.
        self._definitions = in_summary | outside | in_chunks
        self._starts_with_definitions = bool(self.dropped or outside)

    def _note_damage(self, start: int) -> None:
        """Note a damaged part, and the times of a damaged chunk."""
        self.has_damage = True
        opcode, _, end = next(records(self._data, start), (0, 0, 0))
        if opcode == Opcode.CHUNK and end - start >= RECORD_HEAD.size + _TIMES.size:
            first, last = _TIMES.unpack_from(self._data, start + RECORD_HEAD.size)
            if first <= last:
                self.damaged.append((first, last))

    def is_unchanged(self) -> bool:
        """Return True if `write` writes the bytes of the file."""
        if self.has_damage or self._data[-len(MAGIC):] != MAGIC:
            return False
        comparison = _Comparison(self._data)
        self.write(comparison)
        return comparison.is_equal and comparison.size == len(self._data)

    def write(self, stream: Stream) -> Statistics:
        """Write the readable records into a new file; return its statistics."""
        output, definitions = RecordStream(stream), self._definitions.values()
        for definition in definitions:
            output.register(definition)
        summary = output.summary
        known = {
            number
            for number, channel in summary.channels.items()
            if not channel.schema_id or channel.schema_id in summary.schemas
        }
        output.start(self.header)
        if self._starts_with_definitions:
            for outer in (*summary.schemas.values(), *summary.channels.values()):
                output.write(packed(outer))
        for start in self._copied:
            sound = _record_at(self._data, start)
            assert sound is not None
            record = sound.record
            if isinstance(record, Chunk):
                _add_chunk(output, sound, known)
            elif isinstance(record, Message) and record.channel_id in known:
                output.count(record.channel_id, 1, record.log_time, record.log_time)
                output.write(packed(record))
            elif isinstance(record, Attachment):
                output.add_attachment(record)
            elif isinstance(record, Metadata):
                output.add_metadata(record)
        output.finish()
        return output.statistics


def _parts(data: Data) -> Iterator[tuple[int, int, _SoundRecord | None]]:
    """Yield start, end and record of each part of a file; None stands for a damaged part."""
    position = len(MAGIC)
    size = len(data) - (len(MAGIC) if data[-len(MAGIC):] == MAGIC else 0)
    while position < size:
        sound = _record_at(data, position)
        end = sound.end if sound else _next_record(data, position + 1)
        yield position, end, sound
        position = end


def _record_at(data: Data, start: int) -> _SoundRecord | None:
    """Return the record at a place of a file; None if it is not sound."""
    opcode, _, end = next(records(data, start), (0, 0, 0))
    if opcode >= _PRIVATE:
        return _SoundRecord(end)
    raw = data[start:end]
    if opcode == Opcode.MESSAGE_INDEX:
        size = int.from_bytes(raw[INDEX_HEAD - 4:INDEX_HEAD], 'little')
        return _SoundRecord(end) if len(raw) == INDEX_HEAD + size else None
    try:
        record = parsed(raw)
        copy = packed(record)
        if raw not in (copy, copy[:-4] + bytes(4)):  # an attachment may have no checksum
            return None
        if isinstance(record, (Schema, Channel)):
            return _SoundRecord(end, record, [record])
        if not isinstance(record, Chunk):
            return _SoundRecord(end, record)
        content = decompressed(record)
        indexes, raw_definitions = index_messages(content)
        definitions = [
            each for each in map(parsed, raw_definitions) if isinstance(each, (Schema, Channel))
        ]
        return _SoundRecord(end, record, definitions, content, indexes)
    except LargeChunkError as error:
        raise LargeChunkError(
            f'the chunk at byte {start} is {error}: write the log again with smaller chunks'
        ) from None
    except Exception:  # mcap and the compressors raise many kinds for damaged bytes
        return None


def _next_record(data: Data, position: int) -> int:
    """Return the next place with a sound record that carries data, or the end of the file."""
    for match in _HEADS.finditer(data, position):
        if _record_at(data, match.start()) is not None:
            return match.start()
    return len(data)


def _add_chunk(output: RecordStream, sound: _SoundRecord, channels: set[int]) -> None:
    """Write a chunk without the messages of other channels, which cannot be read."""
    chunk, content, indexes = sound.record, sound.content, sound.indexes or {}
    assert isinstance(chunk, Chunk)
    if indexes.keys() <= channels:
        first, last = span(indexes)
        chunk = replace(chunk, message_start_time=first, message_end_time=last)
        output.add_chunk(IndexedChunk(chunk, indexes))
        return
    content = b''.join(
        content[start:end]
        for opcode, start, end in all_records(content)
        if opcode != Opcode.MESSAGE
        or MESSAGE_HEAD.unpack_from(content, start + RECORD_HEAD.size)[0] in channels
    )
    output.add_chunk(indexed_chunk(content, index_messages(content)[0]))


class _Comparison:
    """
    A stream that compares what is written with a file.

    Attributes
    ----------
    size
        bytes that were written.
    is_equal
        whether the file starts with these bytes.

    """

    def __init__(self, data: Data) -> None:
        """Initialise the comparison with the content of a file."""
        self._data = data
        self.size = 0
        self.is_equal = True

    def write(self, data: bytes) -> None:
        """Compare bytes with those of the file at the same place."""
        end = self.size + len(data)
        self.is_equal = self.is_equal and self._data[self.size:end] == data
        self.size = end
