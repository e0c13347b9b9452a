# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Damaged logs: one line from every command, and recovery keeps every complete chunk."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from io import BytesIO
from pathlib import Path
import struct
import time

from damage import damaged
import lz4.frame
from masmc_ros.cli.main import main
from masmc_ros.log.mcap import chunks, codec
from masmc_ros.log.mcap.codec import decompressed, RECORD_HEAD
from masmc_ros.log.read.scan import scan
from masmc_ros.log.recover.recover import recover
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, ChunkIndex, Message
from mcap.stream_reader import breakup_chunk, StreamReader
from mcap.writer import CompressionType, Writer
import pytest
from whole_log import read
import zstandard

ROOT = Path(__file__).resolve().parents[2]
FILES, LIMIT = 400, 80.0
"""Damaged files, and the time in s for them."""


@pytest.fixture(scope='module')
def logs(tmp_path_factory: pytest.TempPathFactory) -> list[bytes]:
    """Return a computed run of several chunks, with each compression."""
    folder = tmp_path_factory.mktemp('whole')
    path = folder / 'run.mcap'
    arguments = ['--set', 'duration=0.6', '--output', str(path)]
    assert main(['simulate', str(ROOT / 'config' / 'paper.yaml'), *arguments]) == 0
    return [written_again(path, folder / f'{each.name}.mcap', each) for each in CompressionType]


def written_again(path: Path, other: Path, compression: CompressionType) -> bytes:
    """Write a log again in small chunks; return its bytes."""
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
        for each in reader.iter_attachments():
            writer.add_attachment(0, 0, each.name, each.media_type, each.data)
        for each in reader.iter_metadata():
            writer.add_metadata(each.name, each.metadata)
        writer.finish()
    return other.read_bytes()


def answers(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> int:
    """Run a command in this process; bad input must end with one line and status 2."""
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
    """Give a damaged log to every command; return what `recover` made of it."""
    path = folder / 'run.mcap'
    path.write_bytes(data)
    answers(['export', str(path), '--output', str(folder / 'export'), '--overwrite'], capsys)
    answers(['simulate', str(path)], capsys)
    answers(['report', str(path), '--output', str(folder / 'report')], capsys)
    assert path.read_bytes() == data
    if answers(['recover', str(path)], capsys):
        assert path.read_bytes() == data
        return 'refused'
    recovered = path.read_bytes()
    messages, _ = read(path)
    scan(path)  # our own reader too
    assert recover(path) is None
    assert not list(folder.glob('*.part'))
    for each in whole:
        found = set(messages)
        for chunk in chunks_in(data, each):
            assert set(chunk) <= found
    return 'complete' if recovered == data else 'recovered'


def chunks_in(data: bytes, whole: bytes) -> Iterator[list[tuple[str, int, bytes]]]:
    """
    Yield the messages of the chunks of a log that are there byte for byte.

    Their definitions stand in the first chunk and in the summary: without both, of no chunk.
    """
    indexes = summaries(whole)
    first = whole[indexes[0].chunk_start_offset:][: indexes[0].chunk_length]
    end = whole[indexes[-1].chunk_start_offset + indexes[-1].chunk_length:]
    if not (first in data or end in data):
        return
    for index, messages in zip(indexes, contents(whole), strict=True):
        chunk = whole[index.chunk_start_offset:][: index.chunk_length]
        if chunk in data:
            yield messages


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
        found = []
        for record in StreamReader(BytesIO(whole), emit_chunks=True).records:
            if not isinstance(record, Chunk):
                continue
            parts = breakup_chunk(record, validate_crc=True)
            topics.update({each.id: each.topic for each in parts if isinstance(each, Channel)})
            found.append(
                [
                    (topics[each.channel_id], each.log_time, each.data)
                    for each in parts
                    if isinstance(each, Message)
                ]
            )
        _known[whole] = (summary.chunk_indexes, found)
    return _known[whole]


@pytest.mark.slow
def test_some_damaged_logs(
    logs: list[bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One of each kind of damage."""
    for number in range(12):
        data, done = damaged(number, logs)
        try:
            check(data, tmp_path, logs, capsys)
        except BaseException as error:
            raise AssertionError(f'{number}: {done}') from error


def test_a_chunk_that_came_to_stand_in_another_is_found(
    logs: list[bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of two chunks, one now stands in the middle of the other, whose length is as it was."""
    for whole in logs:
        one, two = summaries(whole)[3:5]
        begin, end = two.chunk_start_offset, two.chunk_start_offset + two.chunk_length
        middle = one.chunk_start_offset + one.chunk_length // 2
        data = whole[:middle] + whole[begin:end] + whole[middle:begin] + whole[end:]
        assert check(data, tmp_path, logs, capsys) == 'recovered'


@pytest.mark.slow
def test_many_damaged_logs(
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


def test_chunks_behind_a_damaged_one_are_kept_in_their_order(
    logs: list[bytes], tmp_path: Path
) -> None:
    for whole in logs:
        indexes, messages = summaries(whole), contents(whole)
        for broken in (0, 1, len(indexes) - 1):
            data = bytearray(whole)
            data[indexes[broken].chunk_start_offset + indexes[broken].chunk_length - 30] ^= 1
            path = tmp_path / 'run.mcap'
            path.write_bytes(data)
            found = recover(path)
            assert found is not None
            expected = [m for n, each in enumerate(messages) if n != broken for m in each]
            assert read(path)[0] == expected
            assert found.messages == len(expected)
            assert found.dropped >= indexes[broken].chunk_length


@pytest.mark.parametrize('step', [701, pytest.param(37, marks=pytest.mark.slow)])
def test_a_log_without_the_right_end_is_not_complete(
    step: int, logs: list[bytes], tmp_path: Path
) -> None:
    """Every bit of indexes, summary and footer is looked at."""
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
def zeros(*, told: bool) -> bytes:
    """Return a gigabyte of zeros as a frame that says so, or does not."""
    size, block = 2**30, bytes(2**20)
    compressor = zstandard.ZstdCompressor(write_content_size=told)
    frame = compressor.compressobj(size=size if told else -1)
    return b''.join([*(frame.compress(block) for _ in range(size // len(block))), frame.flush()])


@pytest.mark.parametrize('size', [2**30, 2**62])
@pytest.mark.parametrize('told', [True, False])
def test_a_log_that_unpacks_to_gigabytes_is_refused_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], size: int, *, told: bool
) -> None:
    """The chunk says its size, or its compressor alone does."""
    content = zeros(told=told)
    body = struct.pack('<QQQI', 0, 0, size if told else 1000, 0)
    body += struct.pack('<I', 4) + b'zstd' + struct.pack('<Q', len(content)) + content
    path = tmp_path / 'bomb.mcap'
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start()
        stream.write(RECORD_HEAD.pack(6, len(body)) + body)
        writer.finish()
    begun = time.process_time()
    for command in ('report', 'export', 'simulate'):
        capsys.readouterr()
        output = [] if command == 'simulate' else ['--output', str(tmp_path / command)]
        assert main([command, str(path), *output]) == 2
        _, err = capsys.readouterr()
        assert len(err.splitlines()) == 1
        if told:
            assert str(size) in err
    assert main(['recover', str(path)]) == 0
    assert time.process_time() - begun < 10.0
    assert read(path)[0] == []


def lz4_bomb(path: Path, crc: int) -> bytes:
    """Write a log whose only chunk has 2 MiB of LZ4 data that are half a gigabyte of zeros."""
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


def test_log_lz4_bomb_rejected(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
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


def test_recover_large_sound_chunk_left_as_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its size is told twice and it has a checksum: a log that is not damaged loses nothing."""
    path = tmp_path / 'large.mcap'
    content = lz4_bomb(path, 1)
    assert main(['recover', str(path)]) == 2
    _, err = capsys.readouterr()
    assert 'is left as it is: the chunk at byte' in err
    assert f'expected at most {2**28}' in err
    assert path.read_bytes() == content


def test_chunk_beyond_limit_written_uncompressed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(codec, 'LARGEST_CHUNK', 100)
    for size, compression in ((100, 'lz4'), (101, '')):
        made = chunks.packed_chunk(bytes(size), {}, 'lz4')
        assert made.compression == compression
        assert decompressed(made) == bytes(size)
