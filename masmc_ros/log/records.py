# SPDX-License-Identifier: Apache-2.0
"""The records of an MCAP file as they stand there, whole or not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
import mmap
from pathlib import Path
import struct
import zlib

import lz4.frame
from mcap.opcode import Opcode
from mcap.records import Chunk, MessageIndex
import zstandard

from masmc_ros.errors import InputError

MAGIC = b'\x89MCAP0\r\n'

RECORD_HEAD = struct.Struct('<BQ')
"""Opcode and length of what follows."""

MESSAGE_HEAD = struct.Struct('<HIQ')
"""Channel, sequence number and log time at the beginning of a message."""

_CHUNK_HEAD = struct.Struct('<BQQQQII')


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


def records(
    data: mmap.mmap | bytes, position: int = len(MAGIC)
) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, start and end of the records that are there as a whole."""
    while position + RECORD_HEAD.size <= len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, position)
        end = position + RECORD_HEAD.size + length
        if end > len(data) or not opcode:
            return
        yield opcode, position, end
        position = end


def decompressed(chunk: Chunk) -> bytes:
    """Return the records of a chunk; raises where they are damaged."""
    if chunk.compression == 'zstd':
        content = zstandard.decompress(chunk.data, max_output_size=chunk.uncompressed_size)
    elif chunk.compression == 'lz4':
        content = lz4.frame.decompress(chunk.data)
    else:
        content = chunk.data
    if chunk.uncompressed_crc and zlib.crc32(content) != chunk.uncompressed_crc:
        raise ValueError('checksum')
    return content


def cut_off_chunk(rest: bytes) -> tuple[Chunk, bytes] | None:
    """Return a chunk of the messages that can be had of one that was cut off."""
    if len(rest) < _CHUNK_HEAD.size or rest[0] != Opcode.CHUNK:
        return None
    _, _, _, _, _, _, name_size = _CHUNK_HEAD.unpack_from(rest)
    start = _CHUNK_HEAD.size + name_size
    compression = rest[_CHUNK_HEAD.size : start].decode('ascii', errors='replace')
    data = rest[start + 8 :]
    try:
        if compression == 'zstd':
            content = zstandard.ZstdDecompressor().decompressobj().decompress(data)
        elif compression == 'lz4':
            content = lz4.frame.LZ4FrameDecompressor().decompress(data)
        else:
            content = data
    except (zstandard.ZstdError, RuntimeError):
        return None
    whole = 0
    for opcode, _, end in records(content, 0):
        if opcode not in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
            break
        whole = end
    content = content[:whole]
    indexes, counts = index_messages(content)
    if not counts:
        return None
    times = [time for index in indexes for time, _ in index.records]
    chunk = Chunk(
        compression='zstd',
        data=zstandard.compress(content),
        message_start_time=min(times),
        message_end_time=max(times),
        uncompressed_crc=zlib.crc32(content),
        uncompressed_size=len(content),
    )
    return chunk, content


def index_messages(content: bytes) -> tuple[list[MessageIndex], Counter[int]]:
    """Return the indexes of the messages of a chunk, and their number for each channel."""
    indexes: dict[int, MessageIndex] = {}
    for opcode, start, _ in records(content, 0):
        if opcode == Opcode.MESSAGE:
            channel, _, time = MESSAGE_HEAD.unpack_from(content, start + RECORD_HEAD.size)
            index = indexes.setdefault(channel, MessageIndex(channel, []))
            index.records.append((time, start))
    counts = Counter({channel: len(index.records) for channel, index in indexes.items()})
    return list(indexes.values()), counts
