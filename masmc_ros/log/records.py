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

"""The records of an MCAP file as they stand there, whole or not."""

from __future__ import annotations

from collections.abc import Iterator
import heapq
from io import BytesIO
import mmap
from pathlib import Path
import re
import struct
from typing import Any, NamedTuple
import zlib

import lz4.frame
from masmc_ros.errors import InputError
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, McapRecord, Metadata, Schema
import zstandard

Data = mmap.mmap | bytes
"""A file, or the records of a chunk."""

MAGIC = b'\x89MCAP0\r\n'

RECORD_HEAD = struct.Struct('<BQ')
"""Opcode and length of what follows."""

PRIVATE = 0x80
"""Opcodes from here on are anybody's own; readers leave them out."""

MESSAGE_HEAD = struct.Struct('<HIQQ')
"""Channel, sequence number, log time and publish time at the beginning of a message."""

_CHUNK_HEAD = struct.Struct('<QQQII')
"""First and last log time, size and checksum of the records, length of the compression's name."""

_LENGTH = struct.Struct('<Q')

LARGEST_CHUNK = 2**28
"""Bytes that a compressed chunk may unpack to; a larger one is written without compression."""

LARGEST_RATIO = 500
"""Times its own size that a log of more than one such chunk may unpack to: runs reach some 50."""

_FRAME_HEAD = 64
"""Bytes of compressed data that are enough for the head of a frame."""

_COMPRESSIONS = (b'', b'zstd', b'lz4')

_WRITTEN_AGAIN = (
    Opcode.SCHEMA,
    Opcode.CHANNEL,
    Opcode.MESSAGE,
    Opcode.ATTACHMENT,
    Opcode.METADATA,
)
"""Records beside chunks that hold something of their own; all others can be made of these."""

_KINDS: dict[int, Any] = {
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.ATTACHMENT: Attachment,
    Opcode.METADATA: Metadata,
}

_HEADS = re.compile(
    b'(?s)(?=[' + re.escape(bytes((*_WRITTEN_AGAIN, Opcode.CHUNK))) + b'].{5}\0\0\0)'
)
"""Where a record of these kinds may begin that is shorter than 2**40 bytes."""


def check_magic(path: Path, start: bytes) -> None:
    """Raise InputError where a file, by its first bytes, was never going to be a log."""
    if not MAGIC.startswith(start[: len(MAGIC)]):
        raise InputError(f'{path}: is not an MCAP file; name a log such as run.mcap')


def cut_off(path: Path) -> str:
    """Return what to say of a log without its end."""
    return (
        f'{path}: the log ends before its end, its recorder was cut off;'
        f' `masmc recover {path}` makes a complete one of it'
    )


def records(data: Data, position: int = len(MAGIC)) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, start and end of the records that are there as a whole."""
    while position + RECORD_HEAD.size <= len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, position)
        end = position + RECORD_HEAD.size + length
        if end > len(data) or not opcode:
            return
        yield opcode, position, end
        position = end


def all_records(content: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield the records of a chunk; ValueError where it does not end with the last one."""
    end = 0
    for opcode, start, end in records(content, 0):
        yield opcode, start, end
    if end != len(content):
        raise ValueError(f'a record at byte {end} of a chunk goes beyond its end')


def unpacked_size(data: Data, start: int) -> int:
    """Return how many bytes the chunk at a place says that its records are."""
    place = start + RECORD_HEAD.size
    if place + _CHUNK_HEAD.size > len(data):
        return 0
    _, _, size, _, name_size = _CHUNK_HEAD.unpack_from(data, place)
    return int(size) if name_size else 0


def decompressed(chunk: Chunk) -> bytes:
    """
    Return the records of a chunk; raises where they are damaged.

    It never takes more memory than the chunk says, nor more than LARGEST_CHUNK bytes.
    """
    size, packed = chunk.uncompressed_size, chunk.data
    if chunk.compression == '':
        content = packed
    elif size > LARGEST_CHUNK:
        raise ValueError(
            f'a chunk of {len(packed)} bytes that unpacks to {size} bytes; expected at most '
            f'{LARGEST_CHUNK}'
        )
    elif chunk.compression == 'zstd':
        told = zstandard.get_frame_parameters(packed).content_size
        if told not in (size, zstandard.CONTENTSIZE_UNKNOWN):
            raise ValueError(f'a chunk of {size} bytes that unpacks to {told} bytes')
        content = zstandard.decompress(packed, max_output_size=size)
    elif chunk.compression == 'lz4':
        frame = lz4.frame.LZ4FrameDecompressor()
        content = frame.decompress(packed, max_length=size + 1)
        if not frame.eof:
            raise ValueError(f'a chunk of {size} bytes that unpacks to others')
    else:
        raise ValueError(f"compression '{chunk.compression}' is unknown")
    if chunk.compression and len(content) != size:
        raise ValueError(f'a chunk of {size} bytes that unpacks to others')
    if chunk.uncompressed_crc and zlib.crc32(content) != chunk.uncompressed_crc:
        raise ValueError('checksum of a chunk')
    return content


def check_chunk_size(data: Data, start: int, end: int) -> None:
    """
    Raise InputError for a whole chunk that is larger than LARGEST_CHUNK.

    It says so twice, in its head and in its compressed data, and has a checksum: a chunk that is
    merely damaged hardly does.
    """
    place = start + RECORD_HEAD.size
    if place + _CHUNK_HEAD.size > len(data):
        return
    _, _, size, crc, name_size = _CHUNK_HEAD.unpack_from(data, place)
    if size <= LARGEST_CHUNK or not crc or name_size > max(map(len, _COMPRESSIONS)):
        return
    place += _CHUNK_HEAD.size
    name, content = bytes(data[place:place + name_size]), place + name_size + _LENGTH.size
    if name and size in _told_sizes(name, data[content:min(end, content + _FRAME_HEAD)]):
        raise InputError(
            f'the chunk at byte {start} unpacks to {size} bytes; expected at most {LARGEST_CHUNK}:'
            ' write the log again with smaller chunks'
        )


def _told_sizes(compression: bytes, frame: bytes) -> tuple[int, ...]:
    """Return the size that the head of a compressed frame tells, if it does."""
    try:
        if compression == b'zstd':
            return (zstandard.get_frame_parameters(frame).content_size,)
        return (lz4.frame.get_frame_info(frame)['content_size'],)
    except (zstandard.ZstdError, RuntimeError):
        return ()


class FoundChunk(NamedTuple):
    """A chunk that can be read: it, its records, and where it ends in the file."""

    chunk: Chunk
    content: bytes
    end: int


def chunk_at(data: Data, start: int) -> FoundChunk | None:
    """
    Return the chunk that begins at a place, None where there is none that can be read.

    Opcode and length before it need not be right: its own sizes and checksum tell.
    """
    place = start + RECORD_HEAD.size
    if place + _CHUNK_HEAD.size > len(data):
        return None
    first, last, size, crc, name_size = _CHUNK_HEAD.unpack_from(data, place)
    place += _CHUNK_HEAD.size
    if name_size > max(map(len, _COMPRESSIONS)) or place + name_size + 8 > len(data):
        return None
    name = bytes(data[place:place + name_size])
    place += name_size
    (length,) = _LENGTH.unpack_from(data, place)
    place += _LENGTH.size
    if name not in _COMPRESSIONS or place + length > len(data):
        return None
    end = place + length
    is_told = RECORD_HEAD.unpack_from(data, start) == (
        Opcode.CHUNK,
        end - start - RECORD_HEAD.size,
    )
    if not (crc or is_told):
        return None
    chunk = Chunk(name.decode(), data[place:end], last, first, crc, size)
    try:
        content = decompressed(chunk)
        for opcode, _, _ in all_records(content):
            if opcode not in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
                return None
    except Exception:  # whatever a library says of bytes that were never written so
        return None
    return FoundChunk(chunk, content, end) if content else None


def is_sound(data: Data, opcode: int, start: int, end: int) -> bool:
    """Tell whether a record other than a chunk, of a kind that is known, is what it says."""
    body = data[start + RECORD_HEAD.size:end]
    if opcode == Opcode.MESSAGE:
        return len(body) >= MESSAGE_HEAD.size
    kind = _KINDS.get(opcode)
    if kind is None:
        return False
    try:
        again = packed(kind.read(stream_of(body)))[RECORD_HEAD.size:]
    except Exception:  # as in `chunk_at`
        return False
    if opcode == Opcode.ATTACHMENT:
        crc = int.from_bytes(body[-4:], 'little')
        return again[:-4] == body[:-4] and crc in (0, zlib.crc32(body[:-4]))
    return again == body


def next_sound(data: Data, position: int, *, has_chunks: bool) -> int | None:
    """
    Return where the next record begins that can be read; None where there is none.

    In a log that `has_chunks`, single messages are none: they may be those of a damaged one.
    """
    for start in _possible_heads(data, position):
        opcode, length = RECORD_HEAD.unpack_from(data, start)
        end = start + RECORD_HEAD.size + length
        if opcode in _WRITTEN_AGAIN:
            if end > len(data) or (has_chunks and opcode == Opcode.MESSAGE):
                continue
            if is_sound(data, opcode, start, end) and _goes_on(data, end):
                return start
        elif chunk_at(data, start) is not None:
            return start
    return None


def next_chunk(data: Data, position: int, end: int) -> int | None:
    """Return where the next chunk begins that can be read, before an end; None for none."""
    for start in _possible_heads(data, position):
        if start >= end:
            return None
        if data[start] not in _WRITTEN_AGAIN and chunk_at(data, start) is not None:
            return start
    return None


def _possible_heads(data: Data, position: int) -> Iterator[int]:
    """Yield where records may begin that hold data, from a place on."""
    return heapq.merge(
        (match.start() for match in _HEADS.finditer(data, position)),
        _named_chunks(data, position, b'zstd'),
        _named_chunks(data, position, b'lz4'),
    )


def _named_chunks(data: Data, position: int, name: bytes) -> Iterator[int]:
    """Yield where chunks of a compression may begin whose opcode and length may be wrong."""
    sign = len(name).to_bytes(4, 'little') + name
    before = RECORD_HEAD.size + _CHUNK_HEAD.size - 4
    found = data.find(sign, position + before)
    while found >= 0:
        yield found - before
        found = data.find(sign, found + 1)


def _goes_on(data: Data, position: int) -> bool:
    """Tell whether a known kind of record, or the end, may stand at a place."""
    if position + RECORD_HEAD.size > len(data):
        return position == len(data)
    opcode, length = RECORD_HEAD.unpack_from(data, position)
    return 0 < opcode <= Opcode.DATA_END and length <= len(data)


def packed(record: McapRecord) -> bytes:
    """Return a record as it is written."""
    builder = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()
    return data


def cut_off_records(rest: bytes) -> bytes:
    """Return the records that can be had of a chunk that was cut off."""
    head = RECORD_HEAD.size + _CHUNK_HEAD.size
    if len(rest) < head or rest[0] != Opcode.CHUNK:
        return b''
    _, _, _, _, name_size = _CHUNK_HEAD.unpack_from(rest, RECORD_HEAD.size)
    start = head + name_size
    compression = rest[head:start].decode('ascii', errors='replace')
    data = rest[start + 8:]
    try:
        if compression == 'zstd':
            with zstandard.ZstdDecompressor().stream_reader(data) as reader:
                content = _read_all(reader, LARGEST_CHUNK)
        elif compression == 'lz4':
            frame = lz4.frame.LZ4FrameDecompressor()
            content = frame.decompress(data, max_length=LARGEST_CHUNK)
        else:
            content = data
    except (zstandard.ZstdError, RuntimeError, EOFError):
        return b''
    whole = 0
    for opcode, start, end in records(content, 0):
        if opcode not in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
            break
        if opcode == Opcode.MESSAGE and end - start < RECORD_HEAD.size + MESSAGE_HEAD.size:
            break
        whole = end
    return content[:whole]


def _read_all(reader: zstandard.ZstdDecompressionReader, most: int) -> bytes:
    """Return what there is of a frame that was cut off, at most so many bytes."""
    parts, size = [], 0
    while size < most and (part := reader.read(2**20)):
        parts.append(part)
        size += len(part)
    return b''.join(parts)


def stream_of(data: bytes) -> ReadDataStream:
    """Return bytes as the library reads records from."""
    return ReadDataStream(BytesIO(data))
