# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Damaged logs: one-line errors of all commands, and recovery of all complete chunks."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from io import BytesIO
from pathlib import Path
import struct
import time

from helpers.checked_reader import read
from helpers.log_damage import damaged
import lz4.frame
from masmc_ros.cli.main import main
from masmc_ros.log import codec
from masmc_ros.log.codec import decompressed, RECORD_HEAD
from masmc_ros.log.read.scan import scan
from masmc_ros.log.recover import recover
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, ChunkIndex, Message
from mcap.stream_reader import breakup_chunk, StreamReader
from mcap.writer import CompressionType, Writer
import pytest
import zstandard

ROOT = Path(__file__).resolve().parents[2]
FILES, LIMIT = 400, 40.0
"""Number of damaged files, and the time limit in s for all of them."""


@pytest.fixture(scope='module')
def logs(tmp_path_factory: pytest.TempPathFactory) -> list[bytes]:
    """Return a computed run of several chunks, with every compression."""
    folder = tmp_path_factory.mktemp('whole')
    path = folder / 'run.mcap'
    arguments = ['--set', 'duration=0.6', '--output', str(path)]
    assert main(['simulate', str(ROOT / 'config' / 'paper.yaml'), *arguments]) == 0
    return [
        written_again(path, folder / f'{compression.name}.mcap', compression)
        for compression in CompressionType
    ]


def written_again(path: Path, other: Path, compression: CompressionType) -> bytes:
    """Copy a log with small chunks and return its bytes."""
    with path.open('rb') as source, other.open('wb') as stream:
        reader = make_reader(source)
        writer = Writer(stream, chunk_size=50_000, compression=compression)
        writer.start(profile='ros2', library='masmc_ros')
        channels = {}
        summary = reader.get_summary()
        assert summary is not None
        for number, channel in summary.channels.items():
            schema = summary.schemas[channel.schema_id]
            channels[number] = writer.register_channel(
                channel.topic,
                channel.message_encoding,
                writer.register_schema(schema.name, schema.encoding, schema.data),
                channel.metadata,
            )
        for _, channel, message in reader.iter_messages(log_time_order=False):
            writer.add_message(
                channels[channel.id], message.log_time, message.data, message.publish_time
            )
        for attachment in reader.iter_attachments():
            writer.add_attachment(
                0, 0, attachment.name, attachment.media_type, attachment.data
            )
        for metadata in reader.iter_metadata():
            writer.add_metadata(metadata.name, metadata.metadata)
        writer.finish()
    return other.read_bytes()


def run_command(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> int:
    """Run a command in this process; assert that invalid input yields one line and status 2."""
    capsys.readouterr()
    status = main(arguments)
    _, err = capsys.readouterr()
    assert status in (0, 2), arguments
    if status == 2:
        assert len(err.splitlines()) == 1, err
        assert err.startswith(f'masmc {arguments[0]}: '), err
    return status


def check(
    data: bytes, folder: Path, whole: list[bytes], capsys: pytest.CaptureFixture[str]
) -> str:
    """Pass a damaged log to every command; return the result of `recover`."""
    path = folder / 'run.mcap'
    path.write_bytes(data)
    run_command(['export', str(path), '--output', str(folder / 'export'), '--overwrite'], capsys)
    run_command(['simulate', str(path)], capsys)
    run_command(['report', str(path), '--output', str(folder / 'report')], capsys)
    assert path.read_bytes() == data
    if run_command(['recover', str(path)], capsys):
        assert path.read_bytes() == data
        return 'rejected'
    recovered = path.read_bytes()
    messages, _ = read(path)
    scan(path)  # the project's reader
    assert recover(path) is None
    assert not list(folder.glob('*.part'))
    for original in whole:
        recovered_messages = set(messages)
        for chunk in chunks_in(data, original):
            assert set(chunk) <= recovered_messages
    return 'complete' if recovered == data else 'recovered'


def chunks_in(data: bytes, whole: bytes) -> Iterator[list[tuple[str, int, bytes]]]:
    """
    Yield the messages of the chunks of a log that are contained byte for byte.

    The chunks that follow a wrong length are lost. The first chunk and the summary contain the
    definitions: without both no chunk is readable.
    """
    indexes, places = summaries(whole), list(starts(data))

    def is_contained(part: bytes) -> bool:
        return any(data.startswith(part, place) for place in places)

    first = whole[indexes[0].chunk_start_offset:][: indexes[0].chunk_length]
    end = whole[indexes[-1].chunk_start_offset + indexes[-1].chunk_length:]
    if not (is_contained(first) or is_contained(end)):
        return
    for index, messages in zip(indexes, contents(whole), strict=True):
        if is_contained(whole[index.chunk_start_offset:][: index.chunk_length]):
            yield messages


def starts(data: bytes) -> Iterator[int]:
    """Yield the places of records up to one of a wrong length or of the invalid opcode 0."""
    place = 8
    while place + 9 <= len(data) and data[place]:
        yield place
        place += 9 + int.from_bytes(data[place + 1:place + 9], 'little')


_known: dict[bytes, tuple[list[ChunkIndex], list[list[tuple[str, int, bytes]]]]] = {}


def summaries(whole: bytes) -> list[ChunkIndex]:
    return _read(whole)[0]


def contents(whole: bytes) -> list[list[tuple[str, int, bytes]]]:
    return _read(whole)[1]


def _read(whole: bytes) -> tuple[list[ChunkIndex], list[list[tuple[str, int, bytes]]]]:
    if whole not in _known:
        summary = make_reader(BytesIO(whole)).get_summary()
        assert summary is not None
        topics: dict[int, str] = {}
        chunk_messages = []
        for record in StreamReader(BytesIO(whole), emit_chunks=True).records:
            if not isinstance(record, Chunk):
                continue
            parts = breakup_chunk(record, validate_crc=True)
            topics.update({part.id: part.topic for part in parts if isinstance(part, Channel)})
            chunk_messages.append(
                [
                    (topics[part.channel_id], part.log_time, part.data)
                    for part in parts
                    if isinstance(part, Message)
                ]
            )
        _known[whole] = (summary.chunk_indexes, chunk_messages)
    return _known[whole]


@pytest.mark.slow
def test_damaged_logs_of_every_kind_are_handled(
    logs: list[bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One file of every kind of damage."""
    for number in range(12):
        data, done = damaged(number, logs)
        try:
            check(data, tmp_path, logs, capsys)
        except BaseException as error:
            raise AssertionError(f'{number}: {done}') from error


@pytest.mark.slow
def test_damaged_logs_at_random_are_handled(
    logs: list[bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    results: dict[str, int] = {}
    limit = time.monotonic() + LIMIT
    for number in range(FILES):
        if time.monotonic() > limit:
            break
        data, done = damaged(number, logs)
        try:
            result = check(data, tmp_path, logs, capsys)
        except BaseException as error:
            raise AssertionError(f'{number}: {done}') from error
        results[result] = results.get(result, 0) + 1
    with capsys.disabled():
        print(results)
    assert results.get('recovered', 0) > sum(results.values()) // 4


def test_recover_chunks_after_damaged_one_keep_order(
    logs: list[bytes], tmp_path: Path
) -> None:
    for whole in logs:
        indexes, messages = summaries(whole), contents(whole)
        for broken in (0, 1, len(indexes) - 1):
            data = bytearray(whole)
            data[indexes[broken].chunk_start_offset + indexes[broken].chunk_length - 30] ^= 1
            path = tmp_path / 'run.mcap'
            path.write_bytes(data)
            result = recover(path)
            assert result is not None
            expected = [m for n, chunk in enumerate(messages) if n != broken for m in chunk]
            assert read(path)[0] == expected
            assert result.messages == len(expected)
            assert result.dropped >= indexes[broken].chunk_length


@pytest.mark.parametrize('step', [701, pytest.param(509, marks=pytest.mark.slow)])
def test_recover_damaged_summary_is_rewritten(
    step: int, logs: list[bytes], tmp_path: Path
) -> None:
    """Every bit of indexes, summary and footer is checked."""
    whole = logs[0]
    last = summaries(whole)[-1]
    path = tmp_path / 'run.mcap'
    for place in range(last.chunk_start_offset + last.chunk_length, len(whole), step):
        data = bytearray(whole)
        data[place] ^= 4
        path.write_bytes(data)
        assert recover(path) is not None, place
        read(path)


@cache
def zeros(*, has_size: bool) -> bytes:
    """Return a compressed gigabyte of zeros; the frame contains its size if `has_size`."""
    size, block = 2**30, bytes(2**20)
    compressor = zstandard.ZstdCompressor(write_content_size=has_size)
    frame = compressor.compressobj(size=size if has_size else -1)
    return b''.join([*(frame.compress(block) for _ in range(size // len(block))), frame.flush()])


@pytest.mark.parametrize('size', [2**30, 2**62])
@pytest.mark.parametrize('has_size', [True, False])
def test_log_zstd_bomb_is_rejected_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], size: int, *, has_size: bool
) -> None:
    """Either the chunk or only its compressed frame contains the size."""
    content = zeros(has_size=has_size)
    body = struct.pack('<QQQI', 0, 0, size if has_size else 1000, 0)
    body += struct.pack('<I', 4) + b'zstd' + struct.pack('<Q', len(content)) + content
    path = tmp_path / 'bomb.mcap'
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start()
        stream.write(RECORD_HEAD.pack(6, len(body)) + body)
        writer.finish()
    start = time.process_time()
    for command in ('report', 'export', 'simulate'):
        capsys.readouterr()
        output = [] if command == 'simulate' else ['--output', str(tmp_path / command)]
        assert main([command, str(path), *output]) == 2
        _, err = capsys.readouterr()
        assert len(err.splitlines()) == 1
        if has_size:
            assert str(size) in err
    assert main(['recover', str(path)]) == 0
    assert time.process_time() - start < 10.0
    assert read(path)[0] == []


def lz4_bomb(path: Path, crc: int) -> bytes:
    """Write a log with one chunk of 2 MiB of LZ4 data that unpack to 512 MiB of zeros."""
    size, block = 2**29, bytes(2**20)
    with lz4.frame.LZ4FrameCompressor() as frame:
        parts = [frame.begin(source_size=size)]
        parts += [frame.compress(block) for _ in range(size // len(block))]
        content = b''.join((*parts, frame.flush()))
    assert size < 500 * len(content)
    body = struct.pack('<QQQI', 0, 0, size, crc)
    body += struct.pack('<I', 3) + b'lz4' + struct.pack('<Q', len(content)) + content
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start()
        stream.write(RECORD_HEAD.pack(6, len(body)) + body)
        writer.finish()
    return path.read_bytes()


def test_log_lz4_bomb_is_rejected(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / 'bomb.mcap'
    lz4_bomb(path, 0)
    for command in ('report', 'export', 'simulate'):
        output = [] if command == 'simulate' else ['--output', str(tmp_path / command)]
        assert main([command, str(path), *output]) == 2
        _, err = capsys.readouterr()
        assert len(err.splitlines()) == 1
        assert f'unpacks to {2**29} bytes; expected at most {2**28}' in err
    assert main(['recover', str(path)]) == 0
    assert read(path)[0] == []


def test_recover_large_sound_chunk_is_left_unchanged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two sizes and a checksum agree: recovery must not remove anything from a sound log."""
    path = tmp_path / 'large.mcap'
    content = lz4_bomb(path, 1)
    assert main(['recover', str(path)]) == 2
    _, err = capsys.readouterr()
    assert 'is left as it is: the chunk at byte' in err
    assert f'expected at most {2**28}' in err
    assert path.read_bytes() == content


def test_indexed_chunk_beyond_limit_is_uncompressed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(codec, 'LARGEST_CHUNK', 100)
    for size, compression in ((100, 'lz4'), (101, '')):
        made = codec.packed_chunk(bytes(size), {}, 'lz4')
        assert made.compression == compression
        assert decompressed(made) == bytes(size)
