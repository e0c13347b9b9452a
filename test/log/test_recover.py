# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Recovery of truncated logs, with all their complete chunks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
import errno
import fcntl
import os
from pathlib import Path
import random
import stat

from helpers.checked_reader import Messages, read
from helpers.logged_runs import ARRAY, numbers, STATE, write_run
from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.log.bag import Qos
from masmc_ros.log.codec import ChannelRows, COMPRESSIONS, RECORD_HEAD
from masmc_ros.log.read.reader import read_run
from masmc_ros.log.recover import is_complete, recover, recover_all
from masmc_ros.log.write.writer import LogWriter
from masmc_ros.messages.commands import EFFORT
from mcap.reader import make_reader
from mcap.records import ChunkIndex
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory
import pytest
from rosbags.highlevel import AnyReader

TICKS = 160
COMMIT = 20
"""Number of ticks that a recorder commits together, one chunk each."""


@dataclass(frozen=True)
class Whole:
    """A complete log: its bytes, its messages in the order of the file, its chunks."""

    data: bytes
    messages: Messages
    chunks: list[ChunkIndex]
    counts: list[int]
    """Numbers of messages per chunk."""

    def whole_chunks(self, size: int) -> int:
        """Return the number of complete chunks in the first `size` bytes."""
        return sum(c.chunk_start_offset + c.chunk_length <= size for c in self.chunks)


def record(path: Path, compression: str) -> None:
    """Record a short run as a recorder does: a start, one chunk per commit, an end."""
    run = numbers(TICKS)
    with LogWriter(path, compression, live=True) as log:
        log.metadata('origin', {'law': 'smc'})
        log.attach('paper.yaml', 'application/yaml', b'plant: {}')
        states = log.channel('/joint_states', STATE, Qos())
        commands = log.channel('/effort_commands', ARRAY, Qos())
        rows = run.states()
        (torques,) = EFFORT.messages(run.stamps, run.torque)
        for first in range(0, TICKS, COMMIT):
            part = slice(first, first + COMMIT)
            sources = [ChannelRows(states, run.stamps[part], rows[part])]
            sources.append(ChannelRows(commands, run.stamps[part], torques.messages[part]))
            log.write_rows(sources)
            log.commit()
        log.metadata('parameters', {'plant': '{}'})


def whole(path: Path) -> Whole:
    """Return the contents of a complete log."""
    messages, chunks = read(path)
    with path.open('rb') as stream:
        reader = make_reader(stream)
        counts = [0] * len(chunks)
        for _, _, message in reader.iter_messages(log_time_order=False):
            for index, chunk in enumerate(chunks):
                if chunk.message_start_time <= message.log_time <= chunk.message_end_time:
                    counts[index] += 1
                    break
    assert sum(counts) == len(messages)
    return Whole(path.read_bytes(), messages, chunks, counts)


@pytest.fixture(scope='module', params=list(COMPRESSIONS))
def log(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Whole:
    path = tmp_path_factory.mktemp('whole') / 'run.mcap'
    record(path, request.param)
    contents = whole(path)
    assert len(contents.chunks) == TICKS // COMMIT
    assert contents.counts == [2 * COMMIT] * len(contents.chunks)
    return contents


def cuts(size: int) -> Iterator[int]:
    """Yield positions: all near the ends and 200 others."""
    yield from range(64)
    yield from range(size - 64, size)
    draw = random.Random(size)
    yield from (draw.randrange(size) for _ in range(200))


def test_recover_log_truncated_anywhere_is_completed(log: Whole, tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    for size in cuts(len(log.data)):
        path.write_bytes(log.data[:size])
        summary = recover(path)
        assert summary is not None, size
        completed = path.read_bytes()
        messages, _ = read(path)
        assert messages == log.messages[: len(messages)], size
        assert len(messages) == sum(log.counts[: log.whole_chunks(size)]), size
        times = [time for _, time, _ in messages] or [0]
        assert summary[:3] == (len(messages), min(times), max(times)), size
        assert is_complete(path), size
        assert recover(path) is None, size
        assert path.read_bytes() == completed, size


def test_recover_result_is_read_by_other_readers(log: Whole, tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    size = len(log.data)
    for cut in (size // 3, size // 2, 4 * size // 5, size - 1):
        path.write_bytes(log.data[:cut])
        recover(path)
        messages, _ = read(path)
        with path.open('rb') as stream:
            reader = make_reader(stream, decoder_factories=[DecoderFactory()])
            decoded = list(reader.iter_decoded_messages(log_time_order=False))
        assert [m.message.data for m in decoded] == [data for _, _, data in messages]
        stamps = [
            m.decoded_message.header.stamp.nanosec
            for m in decoded
            if m.channel.topic == '/joint_states'
        ]
        assert stamps == [time for topic, time, _ in messages if topic == '/joint_states']
        with AnyReader([path]) as bag:
            assert bag.message_count == len(messages)
            for connection, _, raw in bag.messages():
                bag.deserialize(raw, connection.msgtype)
        assert len(read_run(path).times) == len(stamps)


def test_recover_result_is_searchable_by_time(log: Whole, tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    path.write_bytes(log.data[: 3 * len(log.data) // 4])
    recover(path)
    messages, _ = read(path)
    last = max(time for _, time, _ in messages)
    start, end = last // 3, 2 * last // 3
    with path.open('rb') as stream:
        reader = make_reader(stream)
        part = [
            (channel.topic, message.log_time, message.data)
            for _, channel, message in reader.iter_messages(start_time=start, end_time=end)
        ]
        (topic,) = {
            channel.topic
            for _, channel, _ in reader.iter_messages(topics='/joint_states', start_time=start)
        }
    assert part
    assert sorted(part) == sorted(m for m in messages if start <= m[1] < end)
    assert topic == '/joint_states'


def test_recover_keeps_attachments_and_metadata(log: Whole, tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    path.write_bytes(log.data[: log.chunks[2].chunk_start_offset])
    recover(path)
    with path.open('rb') as stream:
        reader = make_reader(stream)
        (attachment,) = reader.iter_attachments()
        (metadata,) = reader.iter_metadata()
    assert (attachment.name, attachment.media_type) == ('paper.yaml', 'application/yaml')
    assert attachment.data == b'plant: {}'
    assert (metadata.name, metadata.metadata) == ('origin', {'law': 'smc'})
    # If only the end is missing, the closing record is kept.
    path.write_bytes(log.data[:-1])
    recover(path)
    with path.open('rb') as stream:
        names = [record.name for record in make_reader(stream).iter_metadata()]
    assert names == ['origin', 'parameters']


@pytest.mark.slow
def test_recover_damaged_bytes_keep_earlier_messages(
    log: Whole, tmp_path: Path
) -> None:
    path = tmp_path / 'run.mcap'
    first, last = log.chunks[0], log.chunks[-1]
    inside = range(first.chunk_start_offset, last.chunk_start_offset + last.chunk_length)
    draw = random.Random(2)
    for _ in range(700):
        place = draw.choice(inside)
        data = bytearray(log.data[: draw.choice([len(log.data) - 1, place + 1000])])
        data[place] ^= draw.randrange(1, 256)
        path.write_bytes(data)
        recover(path)
        messages, _ = read(path)
        before = sum(log.counts[: log.whole_chunks(place)])
        assert messages[:before] == log.messages[:before], place
        assert set(messages) <= set(log.messages), place
        assert recover(path) is None, place


@pytest.mark.parametrize('broken', [0, 4, TICKS // COMMIT - 1])
def test_recover_damaged_chunk_is_skipped_and_reported(
    log: Whole, broken: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Messages of a chunk with a wrong checksum must not appear valid."""
    path = tmp_path / 'run.mcap'
    chunk = log.chunks[broken]
    data = bytearray(log.data)
    data[chunk.chunk_start_offset + chunk.chunk_length - 20] ^= 1
    path.write_bytes(data)
    assert main(['recover', str(path)]) == 0
    first, last = sum(log.counts[:broken]), sum(log.counts[: broken + 1])
    assert read(path)[0] == log.messages[:first] + log.messages[last:]
    times = [time for _, time, _ in log.messages[first:last]]
    line = (
        f'{path}: a damaged chunk was skipped, with its messages from'
        f' {min(times) / 1e9:.3f} to {max(times) / 1e9:.3f} s\n'
    )
    assert line in capsys.readouterr().out
    assert recover(path) is None


@pytest.mark.parametrize('length', [0, 1, 2**31, 2**63])
def test_recover_wrong_chunk_length_loses_what_follows(
    log: Whole, length: int, tmp_path: Path
) -> None:
    path = tmp_path / 'run.mcap'
    data = bytearray(log.data)
    place = log.chunks[3].chunk_start_offset + 1
    data[place:place + 8] = length.to_bytes(8, 'little')
    path.write_bytes(data)
    result = recover(path)
    assert result is not None
    assert read(path)[0] == log.messages[: sum(log.counts[:3])]
    assert result.dropped > len(log.data) - place - len(log.data) // 8
    with path.open('rb') as stream:
        names = [record.name for record in make_reader(stream).iter_metadata()]
    assert names == ['origin']


@pytest.mark.parametrize('size', [1000, 100_000])
def test_recover_log_without_chunks_keeps_messages(size: int, tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    with path.open('wb') as stream:
        writer = Writer(stream, use_chunking=False)
        writer.start()
        schema = writer.register_schema('std_msgs/msg/String', 'ros2msg', b'string data')
        channel = writer.register_channel('/text', 'cdr', schema)
        expected = [('/text', time, bytes(size)) for time in range(10)]
        for _, time, message in expected:
            writer.add_message(channel, time, message, time)
        writer.finish()
    assert recover(path) is None
    data = path.read_bytes()
    path.write_bytes(data[: data.index(bytes(size)) + 5 * size])
    recover(path)
    messages, _ = read(path)
    assert messages == expected[: len(messages)]
    assert len(messages) >= 4


def foreign_log(path: Path, private: bytes = b'') -> bytes:
    """Write a complete log of another program with a private record, and return its bytes."""
    with path.open('wb') as stream:
        writer = Writer(stream, chunk_size=100, enable_data_crcs=not private)
        writer.start(library='another')
        stream.write(private)
        schema = writer.register_schema('std_msgs/msg/String', 'ros2msg', b'string data')
        channel = writer.register_channel('/text', 'cdr', schema)
        for time in range(10):
            writer.add_message(channel, time, bytes(60), time)
        writer.finish()
    return path.read_bytes()


def test_recover_complete_foreign_log_is_unchanged(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    for private in (b'', RECORD_HEAD.pack(0x80, 7) + b'private'):
        data = foreign_log(path, private)
        assert recover(path) is None
        assert path.read_bytes() == data


def test_recover_foreign_log_with_wrong_end_is_completed(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    whole = foreign_log(path)
    with path.open('rb') as stream:
        reader = make_reader(stream)
        messages = [message.data for _, _, message in reader.iter_messages()]
        summary = reader.get_summary()
    assert summary is not None
    last = summary.chunk_indexes[-1]
    start = last.chunk_start_offset + last.chunk_length + last.message_index_length
    for place in range(start, len(whole), 11):
        data = bytearray(whole)
        data[place] ^= 4
        path.write_bytes(data)
        assert recover(path) is not None, place
        assert [data for _, _, data in read(path)[0]] == messages, place


def test_recover_keeps_link_and_mode(torn: Path) -> None:
    torn.chmod(0o640)
    link = torn.with_name('link.mcap')
    link.symlink_to(torn.name)
    assert recover(link) is not None
    assert link.is_symlink()
    assert stat.S_IMODE(torn.stat().st_mode) == 0o640
    assert recover(torn) is None


def test_recover_on_full_disk_leaves_log_unchanged(
    torn: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, 'No space left on device')

    data = torn.read_bytes()
    monkeypatch.setattr(os, 'fsync', full)
    with pytest.raises(InputError, match='cannot be recovered: No space left on device'):
        recover(torn)
    assert torn.read_bytes() == data
    assert [entry.name for entry in torn.parent.iterdir()] == [torn.name]


def test_recover_truncated_long_run_keeps_chunks(tmp_path: Path) -> None:
    """Chunks have the usual size, with reference windows among the messages."""
    path = tmp_path / 'run.mcap'
    write_run(path, numbers(1500))
    log = whole_by_offset(path)
    assert len(log.chunks) > 3
    draw = random.Random(3)
    for _ in range(12):
        size = draw.randrange(len(log.data))
        path.write_bytes(log.data[:size])
        recover(path)
        messages, _ = read(path)
        assert messages == log.messages[: len(messages)]
        assert len(messages) >= sum(log.counts[: log.whole_chunks(size)])


def whole_by_offset(path: Path) -> Whole:
    """Return the contents of a log whose chunks share times."""
    messages, chunks = read(path)
    data = path.read_bytes()
    counts = []
    for chunk in chunks:
        cut = path.with_name('cut.mcap')
        cut.write_bytes(data[: chunk.chunk_start_offset + chunk.chunk_length])
        recover(cut)
        counts.append(len(read(cut)[0]) - sum(counts))
    assert sum(counts) == len(messages)
    return Whole(data, messages, chunks, counts)


def test_recover_complete_log_is_unchanged(log: Whole, tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    path.write_bytes(log.data)
    before = path.stat()
    assert recover(path) is None
    assert path.read_bytes() == log.data
    assert path.stat().st_mtime_ns == before.st_mtime_ns


@pytest.fixture
def torn(tmp_path: Path) -> Path:
    """Return a truncated log."""
    path = tmp_path / 'run.mcap'
    record(path, 'zstd')
    path.write_bytes(path.read_bytes()[:-1000])
    return path


def missing(path: Path) -> Path:
    return path.with_name('nothing.mcap')


def folder(path: Path) -> Path:
    return path.parent


def foreign(path: Path) -> Path:
    path.write_text('plant: {}\n' * 100)
    return path


@pytest.mark.parametrize(
    ('make', 'expected'),
    [
        (missing, 'does not exist; name a .mcap file'),
        (folder, 'is not a file; name a .mcap file'),
        (foreign, 'is not an MCAP file'),
    ],
)
def test_recover_invalid_path_raises(
    torn: Path, make: Callable[[Path], Path], expected: str
) -> None:
    path = make(torn)
    before = path.read_bytes() if path.is_file() else None
    with pytest.raises(InputError) as error:
        recover(path)
    assert str(error.value).startswith(f'{path}: {expected}')
    assert '\n' not in str(error.value)
    assert (path.read_bytes() if path.is_file() else None) == before


def test_recover_log_being_recorded_raises(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    with LogWriter(path, live=True) as writer:
        channel = writer.channel('/text', 'std_msgs/msg/String')
        writer.write(channel, 1, b'message')
        writer.commit()
        before = path.read_bytes()
        with pytest.raises(InputError, match='is being recorded; recover it when'):
            recover(path)
        assert list(recover_all(tmp_path)) == []
        assert path.read_bytes() == before
    assert recover(path) is None


def test_recover_all_completes_own_logs_of_folder(torn: Path) -> None:
    """Logs of recordings below the folder are included; foreign logs are not modified."""
    data = torn.read_bytes()
    below = torn.parent / 'run'
    below.mkdir()
    (below / 'run_1.mcap').write_bytes(data)
    foreign_log = torn.with_name('foreign.mcap')
    foreign_log.write_bytes(data.replace(b'masmc_ros', b'other_ros', 1))
    (torn.with_name('notes.mcap')).write_text('no log')
    held = torn.with_name('held.mcap')
    held.write_bytes(data)
    with held.open('r+b') as stream:
        fcntl.flock(stream, fcntl.LOCK_EX)
        names = {path.name for path, _ in recover_all(torn.parent)}
    assert names == {'run.mcap', 'run_1.mcap'}
    assert held.read_bytes() == data
    assert foreign_log.read_bytes() == data.replace(b'masmc_ros', b'other_ros', 1)
    assert list(recover_all(below)) == []


def test_recover_command_prints_one_line(torn: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['recover', str(torn)]) == 0
    out, err = capsys.readouterr()
    messages = len(read(torn)[0])
    assert out.startswith(f'{torn}: completed with {messages} messages over 0.1')
    assert (out.count('\n'), err) == (1, '')
    assert main(['recover', str(torn)]) == 0
    assert capsys.readouterr().out == f'{torn}: is complete\n'


def test_recover_command_one_log_fails_others_are_recovered(
    torn: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['recover', str(missing(torn)), str(torn)]) == 2
    out, err = capsys.readouterr()
    assert err.startswith(f'masmc recover: {missing(torn)}: does not exist')
    assert err.count('\n') == 1
    assert f'{torn}: completed' in out
