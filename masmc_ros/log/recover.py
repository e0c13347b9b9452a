# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Recovery of logs that were truncated or damaged.

Their complete chunks and readable records go into a new file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
import fcntl
import mmap
import os
from pathlib import Path
import stat
import struct
from typing import IO, NamedTuple
import zlib

from masmc_ros.errors import InputError
from masmc_ros.files import replacing
from masmc_ros.log import codec
from mcap import records as mcap
from mcap.opcode import Opcode
from mcap.reader import make_reader, NonSeekingReader
from mcap.records import Footer, Statistics

_FOOTER_SIZE = codec.RECORD_HEAD.size + 20
"""Bytes of the record at the end of a file; the checksum of the summary is its last four."""


class Recovered(NamedTuple):
    """
    Content of a log that was completed.

    Attributes
    ----------
    messages
        number of messages.
    start
        log time of the first message in ns.
    end
        log time of the last message in ns.
    dropped
        bytes of the file that could not be read.
    damaged
        first and last log time in ns of each damaged chunk that was skipped.

    """

    messages: int
    start: int
    end: int
    dropped: int
    damaged: tuple[tuple[int, int], ...] = ()


def is_complete(path: Path) -> bool:
    """Return True if a log has its end; OSError if it cannot be read."""
    with path.open('rb') as stream:
        stream.seek(max(len(codec.MAGIC), stream.seek(0, os.SEEK_END) - len(codec.MAGIC)))
        return stream.read() == codec.MAGIC


def is_ours(path: Path) -> bool:
    """Return True if this package wrote the start of the file; OSError if it cannot be read."""
    with path.open('rb') as stream:
        return b'masmc_ros' in stream.read(256)


def recover_all(folder: Path) -> Iterator[tuple[Path, Recovered]]:
    """
    Complete the truncated logs of this package in a folder, and in recordings in it.

    Logs that are being recorded, that are complete, that another program wrote or that cannot
    be written are unchanged. Yields each completed log.
    """
    for path in sorted((*folder.glob('*.mcap'), *folder.glob('*/*.mcap'))):
        recovered = None
        with suppress(OSError, InputError):
            if is_ours(path) and not is_complete(path):
                recovered = recover(path)
        if recovered is not None:
            yield path, recovered


def recover(path: Path) -> Recovered | None:
    """
    Complete a log.

    The complete chunks are written into a new file next to the log, which then replaces it
    atomically. Damaged and truncated chunks are skipped. The log is unchanged if the recovery
    is interrupted or the disk is full.

    Parameters
    ----------
    path
        a log that its recorder did not complete, or that was damaged.

    Returns
    -------
        The content of the new file; None if the log is complete: it has its end, and every
        checksum, index and count is right.

    Raises
    ------
    InputError
        if the file is missing, no MCAP file, being recorded, or if it cannot be replaced.

    """
    if not path.is_file():
        fault = 'is not a file' if path.exists() else 'does not exist'
        raise InputError(f'{path}: {fault}; name a .mcap file that a recorder left')
    try:
        with path.open('r+b') as stream:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return _recover(path, stream)
    except BlockingIOError as error:
        raise InputError(
            f'{path}: is being recorded; recover it when its recorder has ended'
        ) from error
    except OSError as error:
        raise InputError(f'{path}: cannot be recovered: {error.strerror or error}') from error


def _recover(path: Path, stream: IO[bytes]) -> Recovered | None:
    size = stream.seek(0, os.SEEK_END)
    stream.seek(0)
    codec.check_magic(path, stream.read(len(codec.MAGIC)))
    # An empty file cannot be mapped.
    data = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) if size else b''
    try:
        salvage = Salvage(data)
    except codec.LargeChunkError as error:
        raise InputError(f'{path}: is left as it is: {error}') from None
    if salvage.is_unchanged() if is_ours(path) else _is_readable(stream, data, salvage):
        return None
    statistics = _replace(path, salvage, os.fstat(stream.fileno()))
    return Recovered(
        statistics.message_count,
        statistics.message_start_time,
        statistics.message_end_time,
        salvage.dropped,
        tuple(salvage.damaged),
    )


def _is_readable(stream: IO[bytes], data: codec.Data, salvage: Salvage) -> bool:
    """Return True if mcap reads the whole file, and its checksums and count are right."""
    if salvage.has_damage:
        return False
    stream.seek(0)
    try:
        summary = make_reader(stream).get_summary()
        stream.seek(0)
        reader = NonSeekingReader(stream, validate_crcs=True)
        count = sum(1 for _ in reader.iter_messages(log_time_order=False))
        footer = codec.parsed(data[-_FOOTER_SIZE - len(codec.MAGIC):-len(codec.MAGIC)])
    except Exception:  # mcap raises many kinds for damaged bytes
        return False
    assert isinstance(footer, Footer)
    start = footer.summary_start or len(data) - _FOOTER_SIZE - len(codec.MAGIC)
    statistics = None if summary is None else summary.statistics
    return footer.summary_crc in (0, zlib.crc32(data[start:-len(codec.MAGIC) - 4])) and (
        statistics is None or statistics.message_count == count
    )


def _replace(path: Path, salvage: Salvage, status: os.stat_result) -> Statistics:
    """Write the new file and let it replace the old one, with its owner and mode."""
    # The file that a symbolic link names is replaced, not the link.
    with replacing(path.resolve()) as stream:
        statistics = salvage.write(stream.write)
        stream.flush()
        with suppress(OSError):
            os.fchown(stream.fileno(), status.st_uid, status.st_gid)
        os.fchmod(stream.fileno(), stat.S_IMODE(status.st_mode))
        os.fsync(stream.fileno())
    return statistics


_PRIVATE = 0x80
"""First opcode of private records, which readers skip."""

_TIMES = struct.Struct('<QQ')
"""First and last log time in ns at the start of a chunk."""

_Definitions = dict[tuple[type, int], mcap.Schema | mcap.Channel]
"""Schemas and channels by kind and number."""


class _SoundRecord(NamedTuple):
    """
    A record without damage.

    Attributes
    ----------
    record
        its content; None for an index of messages, and for a private record.
    definitions
        the record if it is a schema or a channel, or those in a chunk.
    content
        unpacked records of a chunk.
    indexes
        indexes of the messages of a chunk; None for other records.

    """

    record: mcap.McapRecord | None = None
    definitions: Sequence[mcap.Schema | mcap.Channel] = ()
    content: bytes = b''
    indexes: codec.Indexes | None = None


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
        header of the file; None if it cannot be read.

    """

    def __init__(self, data: codec.Data) -> None:
        """
        Read a file.

        Parameters
        ----------
        data
            content of the file.

        Raises
        ------
        codec.LargeChunkError
            if a chunk without damage is too large to be unpacked.

        """
        self.dropped = 0
        self.damaged: list[tuple[int, int]] = []
        self.has_damage = False
        self.header: mcap.Header | None = None
        self._data = data
        self._copied: list[tuple[int, int]] = []
        in_chunks: _Definitions = {}
        outside: _Definitions = {}
        in_summary: _Definitions = {}
        others, end = outside, len(codec.MAGIC)
        for opcode, start, end in codec.records(data):
            sound = _sound_record(data, start, end)
            if sound is None or opcode >= _PRIVATE:
                self.dropped += end - start
            if sound is None:
                self._note_damage(data[start:end])
                continue
            record = sound.record
            if isinstance(record, mcap.Header):
                self.header = record
            elif isinstance(record, mcap.DataEnd):
                others = in_summary
            elif isinstance(record, (mcap.Chunk, mcap.Message, mcap.Attachment, mcap.Metadata)):
                self._copied.append((start, end))
            known = in_chunks if isinstance(record, mcap.Chunk) else others
            known.update({(type(entry), entry.id): entry for entry in sound.definitions})
        # What follows a record of a wrong length cannot be read.
        unread = data[end:].removesuffix(codec.MAGIC)
        self.dropped += len(unread)
        self.has_damage |= bool(unread)
        # Those in a chunk have a checksum; those of the summary replace lost ones.
        self._definitions = in_summary | outside | in_chunks
        self._starts_with_definitions = bool(self.dropped or outside)

    def _note_damage(self, raw: bytes) -> None:
        """Note a damaged record, and the times of a damaged chunk."""
        self.has_damage = True
        if raw[0] == Opcode.CHUNK and len(raw) >= codec.RECORD_HEAD.size + _TIMES.size:
            first, last = _TIMES.unpack_from(raw, codec.RECORD_HEAD.size)
            if first <= last:
                self.damaged.append((first, last))

    def is_unchanged(self) -> bool:
        """Return True if `write` writes the bytes of the file."""
        is_equal = not self.has_damage and self._data[-len(codec.MAGIC):] == codec.MAGIC
        position = 0

        def compare(written: bytes) -> None:
            nonlocal position, is_equal
            start, position = position, position + len(written)
            is_equal = is_equal and self._data[start:position] == written

        if is_equal:
            self.write(compare)
        return is_equal and position == len(self._data)

    def write(self, write: Callable[[bytes], object]) -> mcap.Statistics:
        """Write the readable records of a new file; return its statistics."""
        output = codec.RecordStream(write)
        for definition in self._definitions.values():
            output.register(definition)
        schemas, channels = output.summary.schemas, output.summary.channels
        known = {
            number
            for number, channel in channels.items()
            if not channel.schema_id or channel.schema_id in schemas
        }
        output.start(self.header)
        if self._starts_with_definitions:
            output.write(b''.join(map(codec.packed, (*schemas.values(), *channels.values()))))
        for start, end in self._copied:
            sound = _sound_record(self._data, start, end)
            assert sound is not None
            record = sound.record
            if isinstance(record, mcap.Chunk):
                _add_chunk(output, record, sound, known)
            elif isinstance(record, mcap.Message) and record.channel_id in known:
                output.count(record.channel_id, 1, record.log_time, record.log_time)
                output.write(codec.packed(record))
            elif isinstance(record, mcap.Attachment):
                output.add_attachment(record)
            elif isinstance(record, mcap.Metadata):
                output.add_metadata(record)
        output.finish()
        return output.statistics


def _sound_record(data: codec.Data, start: int, end: int) -> _SoundRecord | None:
    """Return the record at a place of a file; None if it is damaged."""
    raw = data[start:end]
    if raw[0] >= _PRIVATE:
        return _SoundRecord()
    try:
        if raw[0] == Opcode.MESSAGE_INDEX:
            size = codec.INDEX_HEAD.unpack_from(raw)[-1]
            return _SoundRecord() if len(raw) == codec.INDEX_HEAD.size + size else None
        record = codec.parsed(raw)
        copy = codec.packed(record)
        if raw not in (copy, copy[:-4] + bytes(4)):  # an attachment may have no checksum
            return None
        if isinstance(record, (mcap.Schema, mcap.Channel)):
            return _SoundRecord(record, [record])
        if not isinstance(record, mcap.Chunk):
            return _SoundRecord(record)
        content = codec.decompressed(record)
        indexes, definitions = codec.index_messages(content)
        return _SoundRecord(record, definitions, content, indexes)
    except codec.LargeChunkError as error:
        raise codec.LargeChunkError(
            f'the chunk at byte {start} is {error}: write the log again with smaller chunks'
        ) from None
    except Exception:  # mcap and the compressors raise many kinds for damaged bytes
        return None


def _add_chunk(
    output: codec.RecordStream, chunk: mcap.Chunk, sound: _SoundRecord, channels: set[int]
) -> None:
    """Write a chunk without the messages of other channels, which cannot be read."""
    content, indexes = sound.content, sound.indexes or {}
    if indexes.keys() <= channels:
        first, last = codec.span(indexes)
        output.add_chunk(
            replace(chunk, message_start_time=first, message_end_time=last), indexes
        )
        return
    content = b''.join(
        content[start:end]
        for opcode, start, end in codec.all_records(content)
        if opcode != Opcode.MESSAGE
        or codec.MESSAGE_HEAD.unpack_from(content, start)[2] in channels
    )
    indexes, _ = codec.index_messages(content)
    output.add_chunk(codec.packed_chunk(content, indexes), indexes)
