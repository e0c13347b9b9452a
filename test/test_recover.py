# SPDX-License-Identifier: Apache-2.0
"""Logs that were cut off at any byte are completed with everything that was whole."""

from __future__ import annotations

import fcntl
from pathlib import Path
import random

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import pytest
from rosbags.highlevel import AnyReader

from masmc_ros.cli.main import main
from masmc_ros.log.cdr import JointStateCdr
from masmc_ros.log.qos import Qos
from masmc_ros.log.reader import read_run
from masmc_ros.log.recover import recover
from masmc_ros.log.writer import LogWriter

COMPRESSIONS = ('zstd', 'lz4', 'none')
MESSAGES = 6000


def messages_of(path: Path) -> list[tuple[int, bytes]]:
    """Return log times and bytes of a complete log, whose checksums and counts are right."""
    with path.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        found = [(m.log_time, m.data) for _, _, m in reader.iter_messages(log_time_order=False)]
        assert summary.statistics.message_count == len(found)
        assert sum(summary.statistics.channel_message_counts.values()) == len(found)
        assert len(summary.chunk_indexes) == summary.statistics.chunk_count
        if found:
            # A viewer looks up the time that it is sent to.
            middle = found[len(found) // 2][0]
            later = reader.iter_messages(start_time=middle)
            assert next(iter(later))[2].log_time == middle
    return found


@pytest.fixture(scope='module', params=COMPRESSIONS)
def log(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a complete log of several chunks, with a file and a record at its start."""
    path = tmp_path_factory.mktemp(request.param) / 'whole.mcap'
    state = JointStateCdr()
    rng = random.Random(1)
    with LogWriter(path, request.param, live=True) as writer:
        writer.attach('robot.yaml', 'application/yaml', b'robot: {}')
        writer.metadata('versions', {'masmc_ros': 'this'})
        channel = writer.channel('/joint_states', 'sensor_msgs/msg/JointState', Qos())
        for tick in range(MESSAGES):
            state.set_stamp(tick * 10**6)
            state.position[:] = [rng.random() for _ in range(7)]
            writer.write(channel, tick * 10**6, tick * 10**6, state.to_bytes())
            if tick % 1000 == 999:
                writer.commit()
    return path


def chunk_ends(path: Path) -> list[tuple[int, int]]:
    """Return where each chunk ends in the file, and how many messages there are up to it."""
    times = [time for time, _ in messages_of(path)]
    with path.open('rb') as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    ends, count = [], 0
    for index in summary.chunk_indexes:
        count += sum(index.message_start_time <= t <= index.message_end_time for t in times)
        ends.append((index.chunk_start_offset + index.chunk_length, count))
    return ends


def test_everything_before_the_last_whole_chunk_is_back(log: Path, tmp_path: Path) -> None:
    whole, ends = log.read_bytes(), chunk_ends(log)
    expected = messages_of(log)
    assert len(expected) == MESSAGES
    assert len(ends) > 3
    rng = random.Random(2)
    cuts = [*range(12), *(rng.randrange(len(whole)) for _ in range(200))]
    cuts += range(len(whole) - 20, len(whole))
    cut = tmp_path / 'cut.mcap'
    partly = 0
    for size in cuts:
        cut.write_bytes(whole[:size])
        told = recover(cut)
        assert told is not None
        found = messages_of(cut)
        assert found == expected[: len(found)], size
        least = max((count for end, count in ends if end <= size), default=0)
        assert len(found) >= least, size
        partly += len(found) > least
        assert told.messages == len(found)
        bytes_now = cut.read_bytes()
        assert recover(cut) is None
        assert cut.read_bytes() == bytes_now
    # Of a chunk without compression, whole messages are there whatever the cut.
    assert partly > 50 or 'none' not in str(log)


def test_every_reader_opens_it(log: Path, tmp_path: Path) -> None:
    whole = log.read_bytes()
    cut = tmp_path / 'cut.mcap'
    cut.write_bytes(whole[: len(whole) * 2 // 3])
    told = recover(cut)
    assert told is not None
    with cut.open('rb') as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        decoded = [message for *_, message in reader.iter_decoded_messages()]
        assert [a.data for a in reader.iter_attachments()] == [b'robot: {}']
        assert [m.metadata for m in reader.iter_metadata()] == [{'masmc_ros': 'this'}]
    with AnyReader([cut]) as bag:
        stamps = [time for _, time, _ in bag.messages()]
    assert len(decoded) == len(stamps) == told.messages > MESSAGES / 2
    run = read_run(cut)
    assert run.position[-1].tolist() == list(decoded[-1].position)


def test_damage_keeps_what_is_before_it(log: Path, tmp_path: Path) -> None:
    whole, ends = bytearray(log.read_bytes()), chunk_ends(log)
    (_, kept), (second_end, _) = ends[0], ends[1]
    damaged = tmp_path / 'damaged.mcap'
    for index in range(second_end - 40, second_end):
        whole[index] ^= 0x55
    damaged.write_bytes(whole[: second_end + 100])
    told = recover(damaged)
    assert told is not None
    assert told.messages >= kept
    messages_of(damaged)


def test_what_it_leaves_alone(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = log.read_bytes()
    assert main(['recover', str(log)]) == 0
    assert capsys.readouterr().out == f'{log}: is complete\n'
    assert log.read_bytes() == before

    text = tmp_path / 'text.mcap'
    text.write_text('not a log')
    recorded = tmp_path / 'recorded.mcap'
    recorded.write_bytes(before[:5000])
    for path, word in (
        (text, 'is not an MCAP file'),
        (tmp_path / 'none.mcap', 'does not exist'),
        (recorded, 'is being recorded'),
    ):
        with recorded.open('rb') as stream:
            fcntl.flock(stream, fcntl.LOCK_EX)
            assert main(['recover', str(path)]) == 2
        error = capsys.readouterr().err
        assert word in error
        assert error.count('\n') == 1
    assert text.read_text() == 'not a log'
    assert recorded.read_bytes() == before[:5000]
