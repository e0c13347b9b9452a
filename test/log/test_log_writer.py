# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Logs as read by the tools of ROS 2 and by common viewers."""

from array import array
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
import tracemalloc

from helpers.logged_runs import ARRAY, Numbers, numbers, STATE, write_numbers, write_run
from hypothesis import given, HealthCheck, settings
from hypothesis import strategies as st
from masmc_ros import __version__
from masmc_ros.errors import InputError
from masmc_ros.log.bag import Qos
from masmc_ros.log.codec import (
    arrived_records,
    ChannelRows,
    COMPRESSIONS,
    packed_chunk,
    RecordStream,
)
from masmc_ros.log.read.reader import read_run
from masmc_ros.log.write.writer import CHUNK_SIZE, LogWriter
from masmc_ros.messages.cdr_layout import definition
from masmc_ros.messages.topics import JOINTS
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Chunk, ChunkIndex, MessageIndex
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from mcap_ros2.decoder import DecoderFactory
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosHistory, QosReliability
import yaml

TICKS = 2000
LATCHED = Qos(depth=1, durability='transient_local')
PER_TICK = 6
TOPICS = {
    '/joint_states': STATE,
    '/effort_commands': ARRAY,
    '/reference': ARRAY,
    '/controller/tracking_error': ARRAY,
    '/controller/sliding_surface': ARRAY,
    '/controller/parameter_estimate': ARRAY,
    '/controller/raw_torque': ARRAY,
}


@pytest.fixture(scope='module')
def run() -> Numbers:
    """Return a run of several seconds, which has several chunks."""
    return numbers(TICKS, period_ns=7_000_000)


@pytest.fixture(scope='module')
def log(run: Numbers, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the log of the run."""
    path = tmp_path_factory.mktemp('log') / 'run.mcap'
    write_run(path, run)
    return path


def test_log_header_and_channels_are_complete(log: Path) -> None:
    with log.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        header = reader.get_header()
        summary = reader.get_summary()
    assert header.profile == 'ros2'
    assert header.library == f'masmc_ros {__version__}'
    assert summary is not None
    assert {channel.topic for channel in summary.channels.values()} == set(TOPICS)
    for channel in summary.channels.values():
        type_name = TOPICS[channel.topic]
        schema = summary.schemas[channel.schema_id]
        assert channel.message_encoding == 'cdr'
        assert (schema.name, schema.encoding) == (type_name, 'ros2msg')
        assert schema.data.decode() == definition(type_name).text
        assert channel.metadata['topic_type_hash'] == definition(type_name).type_hash
        assert set(channel.metadata) == {'topic_type_hash', 'offered_qos_profiles'}
    assert len(summary.schemas) == 2


def test_log_statistics_and_indexes_are_complete(log: Path) -> None:
    with log.open('rb') as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        stream.seek(0)
        records = list(StreamReader(stream, emit_chunks=True).records)
    assert summary is not None
    statistics = summary.statistics
    assert statistics is not None
    windows = TICKS // 50
    assert statistics.message_count == PER_TICK * TICKS + windows
    assert sorted(statistics.channel_message_counts.values()) == [windows] + [TICKS] * PER_TICK
    assert (statistics.message_start_time, statistics.message_end_time) == (
        0,
        (TICKS - 1) * 7_000_000,
    )
    assert (statistics.metadata_count, statistics.attachment_count) == (1, 1)
    chunks = [record for record in records if isinstance(record, Chunk)]
    assert len(chunks) == len(summary.chunk_indexes) == statistics.chunk_count > 3
    assert {chunk.compression for chunk in chunks} == {'zstd'}
    assert all(chunk.uncompressed_size < CHUNK_SIZE + 10_000 for chunk in chunks)
    assert any(isinstance(record, MessageIndex) for record in records)
    assert all(
        isinstance(index, ChunkIndex) and index.message_index_offsets
        for index in summary.chunk_indexes
    )
    assert len(summary.metadata_indexes) == len(summary.attachment_indexes) == 1


def test_record_stream_many_chunks_need_little_memory() -> None:
    """A recording of one day has half a million chunks with 20 topics each."""
    indexes = {channel: array('Q', (channel, 10 * channel)) for channel in range(1, 21)}
    chunk = packed_chunk(b'records', indexes)
    output = RecordStream(len)
    output.add_chunk(chunk, indexes)
    tracemalloc.start()
    try:
        for _ in range(2000):
            output.add_chunk(chunk, indexes)
        memory, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert memory < 2000 * 500


def test_log_messages_are_ordered_by_time(log: Path) -> None:
    with log.open('rb') as stream:
        read = make_reader(stream).iter_messages(
            topics=[topic for topic in TOPICS if topic != '/reference'], log_time_order=False
        )
        messages = [(channel.topic, message) for _, channel, message in read]
    times = [message.log_time for _, message in messages]
    assert times == sorted(times)
    assert [message.publish_time for _, message in messages] == times
    # Messages of one tick have the order of their sources.
    assert [topic for topic, _ in messages[-PER_TICK:]] == [
        topic for topic in TOPICS if topic != '/reference'
    ]


def test_log_decoded_by_mcap_equals_run(log: Path, run: Numbers) -> None:
    with log.open('rb') as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        messages = list(reader.iter_decoded_messages(topics=['/joint_states']))
        commands = list(reader.iter_decoded_messages(topics=['/effort_commands']))
        estimates = list(reader.iter_decoded_messages(topics=['/controller/parameter_estimate']))
    assert [tuple(state.decoded_message.name) for state in messages] == [JOINTS] * TICKS
    for field in ('position', 'velocity', 'effort'):
        values = [list(getattr(state.decoded_message, field)) for state in messages]
        assert np.array_equal(values, getattr(run, field))
    for index, command in enumerate(commands):
        stamp = int(run.stamps[index])
        dimension = command.decoded_message.layout.dim[0]
        assert dimension.label == f'effort@{stamp // 10**9}.{stamp % 10**9:09d}'
        assert command.message.log_time == stamp
        assert list(command.decoded_message.data) == run.torque[index].tolist()
    assert [list(estimate.decoded_message.data)[2:] for estimate in estimates] == run.telemetry[
        'parameter_estimate'
    ].tolist()


def test_log_opened_by_rosbags_equals_run(log: Path, run: Numbers) -> None:
    with AnyReader([log]) as reader:
        assert {c.topic: c.msgtype for c in reader.connections} == TOPICS
        assert reader.message_count == PER_TICK * TICKS + TICKS // 50
        [states] = [c for c in reader.connections if c.topic == '/joint_states']
        [profile] = states.ext.offered_qos_profiles
        assert profile.history is QosHistory.KEEP_LAST
        assert profile.reliability is QosReliability.RELIABLE
        assert profile.durability is QosDurability.TRANSIENT_LOCAL
        positions = [
            reader.deserialize(raw, connection.msgtype).position
            for connection, _, raw in reader.messages([states])
        ]
    assert np.array_equal(positions, run.position)


def test_log_qos_is_written_as_in_rosbag2(tmp_path: Path) -> None:
    path = tmp_path / 'log.mcap'
    with LogWriter(path) as log:
        log.channel('/robot_description', 'std_msgs/msg/String', LATCHED, Qos(depth=5))
    with path.open('rb') as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    text = summary.channels[1].metadata['offered_qos_profiles']
    assert text.startswith('- history: keep_last\n  depth: 1\n  reliability: reliable\n')
    infinite = {'sec': 9223372036, 'nsec': 854775807}
    latched = {
        'history': 'keep_last',
        'depth': 1,
        'reliability': 'reliable',
        'durability': 'transient_local',
        'deadline': infinite,
        'lifespan': infinite,
        'liveliness': 'automatic',
        'liveliness_lease_duration': infinite,
        'avoid_ros_namespace_conventions': False,
    }
    assert yaml.safe_load(text) == [latched, latched | {'depth': 5, 'durability': 'volatile'}]


@pytest.mark.parametrize('compression', COMPRESSIONS)
def test_log_any_compression_restores_run(tmp_path: Path, compression: str) -> None:
    path = tmp_path / 'log.mcap'
    run = numbers(300)
    with LogWriter(path, compression) as log:
        write_numbers(log, run, window=50, everything=True)
    assert np.array_equal(read_run(path).position, run.position)


def test_log_writer_unknown_compression_leaves_no_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="compression 'zstdd' is unknown: did you mean zstd"):
        LogWriter(tmp_path / 'log.mcap', 'zstdd')
    assert not list(tmp_path.iterdir())


def test_log_writer_unknown_type_leaves_no_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='JointStat'), LogWriter(tmp_path / 'log.mcap') as log:
        log.channel('/joint_states', 'sensor_msgs/msg/JointStat')
    assert not list(tmp_path.iterdir())


def test_log_writer_computed_run_appears_when_complete(tmp_path: Path) -> None:
    path = tmp_path / 'log.mcap'
    path.write_bytes(b'an older one')
    with LogWriter(path) as log:
        write_numbers(log, numbers(10), window=5, everything=True)
        log.commit()
        assert path.read_bytes() == b'an older one'
    assert len(read_run(path).times) == 10
    assert [entry.name for entry in tmp_path.iterdir()] == ['log.mcap']


def write_and_fail(path: Path, *, live: bool) -> None:
    """Write a log and raise an exception before its end."""
    with LogWriter(path, live=live) as log:
        assert path.exists()
        write_numbers(log, numbers(10), window=5, everything=True)
        raise ZeroDivisionError


def test_log_writer_computed_run_fails_keeps_old_file(tmp_path: Path) -> None:
    path = tmp_path / 'log.mcap'
    path.write_bytes(b'an older one')
    with pytest.raises(ZeroDivisionError):
        write_and_fail(path, live=False)
    assert path.read_bytes() == b'an older one'
    assert [entry.name for entry in tmp_path.iterdir()] == ['log.mcap']


def test_log_writer_live_recording_fails_keeps_messages(tmp_path: Path) -> None:
    path = tmp_path / 'log.mcap'
    with pytest.raises(ZeroDivisionError):
        write_and_fail(path, live=True)
    assert len(read_run(path).times) == 10


def test_log_writer_closed_twice_is_unchanged(tmp_path: Path) -> None:
    path = tmp_path / 'log.mcap'
    log = LogWriter(path)
    write_numbers(log, numbers(10), window=5, everything=True)
    log.close()
    before = path.read_bytes()
    log.close()
    assert path.read_bytes() == before


def written_by_the_library(path: Path, compression: str, sources: list[ChannelRows]) -> None:
    """Write a log message by message with the library of the format."""
    kinds = {'zstd': CompressionType.ZSTD, 'lz4': CompressionType.LZ4}
    text, type_hash = definition(STATE)
    with path.open('wb') as stream:
        writer = Writer(
            stream,
            chunk_size=CHUNK_SIZE,
            compression=kinds.get(compression, CompressionType.NONE),
        )
        writer.start('ros2', f'masmc_ros {__version__}')
        schema = writer.register_schema(STATE, 'ros2msg', text.encode())
        for topic in ('/one', '/other'):
            metadata = {'offered_qos_profiles': Qos().to_yaml(), 'topic_type_hash': type_hash}
            writer.register_channel(topic, 'cdr', schema, metadata)
        writer.add_metadata('origin', {'law': 'smc'})
        writer.add_message(2, 7, b'first', 7)
        messages = [
            (int(stamp), place, index)
            for place, source in enumerate(sources)
            for index, stamp in enumerate(source.times)
        ]
        for stamp, place, index in sorted(messages):
            source = sources[place]
            writer.add_message(source.channel, stamp, source.rows[index].tobytes(), stamp)
        writer.flush()
        writer.add_attachment(3, 3, 'robot.urdf', 'application/xml', b'<robot/>')
        writer.add_message(1, 8, b'last', 8)
        writer.finish()


@pytest.mark.parametrize('compression', COMPRESSIONS)
@given(data=st.data())
@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
def test_log_writer_bytes_equal_mcap_library(
    tmp_path: Path, compression: str, data: st.DataObject
) -> None:
    """The messages are written singly or in bulk; some are larger than a chunk."""
    random = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    sizes = data.draw(st.lists(st.sampled_from([0, 1, 60, 5_000, 300_000]), max_size=5))
    sources = []
    for size in sizes:
        count = int(random.integers(0, 300_000 // (size + 100) + 3))
        times = np.sort(random.integers(0, 1000, count))
        rows = random.integers(0, 3, (count, size), dtype=np.uint8)
        sources.append(ChannelRows(int(random.integers(1, 3)), times, rows))
    theirs, ours = tmp_path / 'theirs.mcap', tmp_path / 'ours.mcap'
    written_by_the_library(theirs, compression, sources)
    with LogWriter(ours, compression) as log:
        one, other = (log.channel(topic, STATE, Qos()) for topic in ('/one', '/other'))
        log.metadata('origin', {'law': 'smc'})
        log.write(other, 7, b'first')
        log.write_rows(sources)
        log.commit()
        log.attach('robot.urdf', 'application/xml', b'<robot/>', 3)
        log.write(one, 8, b'last')
    assert ours.read_bytes() == theirs.read_bytes()


@given(sizes=st.lists(st.sampled_from([0, 1, 60, 5_000, 300_000]), min_size=1, max_size=20))
@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
def test_log_writer_bulk_records_equal_single_writes(
    tmp_path: Path, sizes: list[int]
) -> None:
    messages = [(1 + place % 2, 5 - place % 3, bytes(size)) for place, size in enumerate(sizes)]
    paths = [tmp_path / 'singly.mcap', tmp_path / 'at_once.mcap']
    for path in paths:
        with LogWriter(path, 'none') as log:
            for topic in ('/one', '/other'):
                log.channel(topic, STATE, Qos())
            if path is paths[0]:
                for channel, stamp, data in messages:
                    log.write(channel, stamp, data)
                continue
            records, first = arrived_records(messages), 0
            while first < len(messages):
                first = log.write_records(records, first, len(messages))
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_log_writer_no_rows_writes_empty_log(tmp_path: Path) -> None:
    path = tmp_path / 'log.mcap'
    with LogWriter(path) as log:
        log.write_rows([])
    with path.open('rb') as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == 0


def test_log_writer_killed_keeps_flushed_messages(tmp_path: Path) -> None:
    path = tmp_path / 'log.mcap'
    script = (
        'import sys, time\n'
        'from masmc_ros.log.write.writer import LogWriter\n'
        'log = LogWriter(sys.argv[1], live=True)\n'
        'channel = log.channel("/text", "std_msgs/msg/String")\n'
        'for number in range(100):\n'
        '    log.write(channel, number, b"message")\n'
        'log.commit()\n'
        'print("flushed", flush=True)\n'
        'time.sleep(60)\n'
    )
    process = subprocess.Popen(
        [sys.executable, '-c', script, path],
        stdout=subprocess.PIPE,
        cwd=Path(__file__).parents[2],
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == b'flushed\n'
        process.send_signal(signal.SIGKILL)
        process.wait(10)
    finally:
        process.kill()
        process.wait()
    with path.open('rb') as stream:
        chunks = (
            record
            for record in StreamReader(stream, emit_chunks=True).records
            if isinstance(record, Chunk)
        )
        chunk = next(chunks)
        with pytest.raises(EndOfFile):
            next(chunks)
    assert (chunk.message_start_time, chunk.message_end_time) == (0, 99)
    with pytest.raises(InputError, match='truncated'):
        read_run(path)


def test_log_writer_invalid_path_raises(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('')
    os.mkfifo(tmp_path / 'pipe')
    for path, expected in [
        (tmp_path, 'is a folder; name the file to write'),
        (tmp_path / 'pipe', 'is not a file'),
        (tmp_path / 'none' / 'log.mcap', r'folder .*none does not exist; create it'),
        (tmp_path / 'file' / 'log.mcap', r'folder .*file is not a folder'),
        (tmp_path / ('n' * 300), 'cannot be written'),
    ]:
        for live in (False, True):
            with pytest.raises(InputError, match=expected):
                LogWriter(path, live=live)
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ['file', 'pipe']


@pytest.mark.skipif(os.geteuid() == 0, reason='root may write everywhere')
def test_log_writer_folder_without_permission_raises(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(InputError, match='cannot be written; name a file'):
            LogWriter(tmp_path / 'log.mcap')
    finally:
        tmp_path.chmod(0o700)


def test_log_writer_20_s_at_1_khz_take_less_than_2_s(tmp_path: Path) -> None:
    run = numbers(20_001)
    start = time.process_time()
    write_run(tmp_path / 'log.mcap', run)
    assert time.process_time() - start < 2.0
