# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Codec of single records of an MCAP file: heads, limits, packing and unpacking."""

from __future__ import annotations

from collections.abc import Iterator
from io import BytesIO
import mmap
from pathlib import Path
import struct
import zlib

import lz4.frame
from masmc_ros.errors import InputError
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk, McapRecord
from mcap.stream_reader import StreamReader
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
