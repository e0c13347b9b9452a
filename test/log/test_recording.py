# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Recordings in parts, on full disks and with full queues."""

from __future__ import annotations

from dataclasses import replace
import json
from pathlib import Path
import subprocess
import sys
import textwrap
import time

from masmc_ros.errors import InputError
from masmc_ros.log.bag import part_names, Qos
from masmc_ros.log.read.reader import read_run
from masmc_ros.log.read.scan import scan
from masmc_ros.log.recover import recover
from masmc_ros.log.write.recording import LOST, Options, Recording
from masmc_ros.log.write.writer import LogWriter
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.message import string_message
from masmc_ros.messages.parameter_record import ParameterRecord
from mcap.reader import make_reader
import pytest
from rosbags.highlevel import AnyReader

TICKS = 3000
LATCHED = Qos(depth=1, durability='transient_local')


def states() -> list[bytes]:
    """Return joint states at intervals of 1 ms."""
    state, messages = JointStateCdr(), []
    for tick in range(TICKS):
        state.set_stamp(tick * 10**6)
        state.position[:] = tick
        messages.append(state.to_bytes())
    return messages


def record(path: Path, options: Options) -> Recording:
    """Record the states, and parameters that apply from the start."""
    recording = Recording(path, options)
    parameters = recording.channel(
        '/controller/parameters', 'std_msgs/msg/String', Qos(), holds=True
    )
    channel = recording.channel('/joint_states', 'sensor_msgs/msg/JointState', Qos())
    parameter_record = ParameterRecord('/controller', 0, 0, {'law': 'smc'}, ())
    assert recording.write(parameters, 0, string_message(parameter_record.to_text()))
    for tick, state in enumerate(states()):
        assert recording.write(channel, tick * 10**6, state)
    recording.close()
    return recording


def counts(path: Path) -> dict[str, int]:
    """Return the number of messages of every topic from the statistics of a file."""
    with path.open('rb') as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    return {
        summary.channels[number].topic: count
        for number, count in summary.statistics.channel_message_counts.items()
    }


@pytest.mark.parametrize(
    'options',
    [Options(max_duration=10**9), Options(max_size=40_000, compression='none')],
    ids=['duration', 'size'],
)
def test_recording_parts_are_complete_and_form_one_run(options: Options, tmp_path: Path) -> None:
    recording = record(tmp_path / 'run.mcap', options)
    assert recording.path == tmp_path / 'run'
    parts = sorted(recording.path.glob('*.mcap'), key=lambda part: int(part.stem[4:]))
    assert len(parts) > 2
    assert [part.name for part in parts] == [f'run_{n}.mcap' for n in range(len(parts))]
    for part in parts:
        # Every part contains the current parameters.
        assert counts(part)['/controller/parameters'] == 1
        assert read_run(part).parameters == {'controller': {'law': 'smc'}}
    assert sum(counts(part)['/joint_states'] for part in parts) == TICKS

    run = read_run(recording.path)
    assert run.position[:, 0].tolist() == list(range(TICKS))
    assert run.parameters == {'controller': {'law': 'smc'}}
    assert run.topics == {'/joint_states': TICKS, '/controller/parameters': 1}
    # ROS 2 reads the parts listed in metadata.yaml.
    with AnyReader([recording.path]) as bag:
        assert bag.message_count == TICKS + len(parts)
        stamps = [time for c, time, _ in bag.messages() if c.topic == '/joint_states']
    assert stamps == [tick * 10**6 for tick in range(TICKS)]


def test_recording_oldest_parts_are_deleted(tmp_path: Path) -> None:
    options = Options(max_size=40_000, max_parts=2, compression='none')
    recording = record(tmp_path / 'run.mcap', options)
    names = part_names(recording.path)
    assert len(names) == 2 == len(list(recording.path.glob('*.mcap')))
    # The last parts of the same run without a limit.
    (tmp_path / 'all').mkdir()
    whole = record(tmp_path / 'all' / 'run.mcap', replace(options, max_parts=0))
    assert names == part_names(whole.path)[-2:]
    run = read_run(recording.path)
    first = int(run.position[0, 0])
    assert first > 0
    assert run.position[:, 0].tolist() == list(range(first, TICKS))
    assert run.parameters == {'controller': {'law': 'smc'}}
    with AnyReader([recording.path]) as bag:
        assert bag.message_count == TICKS - first + 2


@pytest.mark.parametrize(
    'options',
    [
        Options(max_duration=70 * 10**6, flush_period=1e9),
        Options(max_size=40_000, compression='none', flush_period=1e9),
        Options(max_size=1, flush_period=1e9),
    ],
    ids=['duration', 'size', 'one message'],
)
def test_recording_bulk_messages_go_into_same_parts(options: Options, tmp_path: Path) -> None:
    stamps = [3, 50, 1, 60, 150, 2, 72, 70] * 6
    messages = [(1 + (n == 4), 10**6 * ms, bytes([n]) * 30_000) for n, ms in enumerate(stamps)]
    contents = []
    for batch in (1, 7, len(messages)):
        (tmp_path / f'{batch}').mkdir()
        recording = Recording(tmp_path / f'{batch}' / 'run.mcap', options)
        recording.channel('/state', 'sensor_msgs/msg/JointState', Qos())
        recording.channel('/holds', 'sensor_msgs/msg/JointState', Qos(), holds=True)
        for first in range(0, len(messages), batch):
            recording.write_all(messages[first:first + batch])
        recording.close()
        contents.append({p.name: p.read_bytes() for p in recording.path.iterdir()})
    assert len(contents[0]) > 2
    assert contents[0] == contents[1] == contents[2]


def test_recording_parts_keep_equal_messages(tmp_path: Path) -> None:
    recording = Recording(tmp_path / 'run.mcap', Options(max_duration=100))
    held = recording.channel('/held', 'std_msgs/msg/String', LATCHED, holds=True)
    channels = [
        recording.channel(f'/{n}', 'geometry_msgs/msg/Twist', qos)
        for n, qos in enumerate((Qos(), LATCHED))
    ]
    recording.write(held, 0, b'held')
    for time_ns in range(500):
        for channel in channels:
            recording.write(channel, time_ns, b'constant')
    recording.close()
    assert len(list(recording.path.glob('*.mcap'))) == 5
    topics = scan(recording.path).topics
    assert {name: len(topic.messages) for name, topic in topics.items()} == {
        '/held': 1,
        '/0': 500,
        '/1': 500,
    }


def test_recording_parts_without_record_read(tmp_path: Path) -> None:
    """Parts of older versions do not list their repeated messages."""
    for part in range(3):
        with LogWriter(tmp_path / f'run_{part}.mcap') as log:
            channels = [
                log.channel(name, 'std_msgs/msg/String', qos)
                for name, qos in (('/a', LATCHED), ('/b', LATCHED), ('/c', Qos()), ('/d', LATCHED))
            ]
            for channel in channels:
                log.write(channel, part, b'constant')
    topics = scan(tmp_path).topics
    assert {name: len(topic.messages) for name, topic in topics.items()} == {
        '/a': 1,
        '/b': 1,
        '/c': 3,
        '/d': 3,
    }


@pytest.mark.parametrize(
    ('robot_time', 'other_time'), [(0, 1_750_000_000 * 10**9), (1_750_000_000 * 10**9, 0)]
)
def test_recording_duration_ignores_other_clocks(
    robot_time: int, other_time: int, tmp_path: Path
) -> None:
    recording = Recording(tmp_path / 'run.mcap', Options(max_duration=100))
    other = recording.channel('/camera', 'std_msgs/msg/String', has_robot_time=False)
    state = recording.channel('/joint_states', 'sensor_msgs/msg/JointState')
    for n in range(250):
        recording.write(other, other_time + n, b'image')
        recording.write(state, robot_time + n, b'state')
    recording.close()
    parts = [counts(recording.path / f'run_{n}.mcap') for n in range(3)]
    assert len(list(recording.path.glob('*.mcap'))) == 3
    assert [part['/joint_states'] for part in parts] == [100, 100, 50]


def test_recording_without_limits_is_one_file(tmp_path: Path) -> None:
    recording = record(tmp_path / 'run.mcap', Options())
    assert list(tmp_path.iterdir()) == [recording.path]
    assert counts(recording.path) == {'/joint_states': TICKS, '/controller/parameters': 1}


def test_recording_queue_full_counts_lost_messages(tmp_path: Path) -> None:
    state = states()[0]
    recording = Recording(tmp_path / 'run.mcap', Options(queue_size=20 * len(state)))
    channel = recording.channel('/joint_states', 'sensor_msgs/msg/JointState', Qos())
    accepted = sum(recording.write(channel, 0, state) for _ in range(5000))
    recording.close()
    lost = 5000 - accepted
    assert lost > 0
    assert recording.lost == {'/joint_states': lost}
    assert counts(recording.path) == {'/joint_states': accepted}
    with recording.path.open('rb') as stream:
        records = list(make_reader(stream).iter_metadata())
    (lost_record,) = [record.metadata for record in records if record.name == LOST]
    assert lost_record == {'/joint_states': str(lost)}


def test_recording_invalid_path_raises(tmp_path: Path) -> None:
    for path, options in (
        (tmp_path / 'none' / 'run.mcap', Options()),
        (tmp_path / 'none' / 'run.mcap', Options(max_size=1)),
        (tmp_path, Options()),
    ):
        with pytest.raises(InputError):
            Recording(path, options)
    assert list(tmp_path.iterdir()) == []


FULL = """
    import json, os, random, resource, signal, sys, time
    from pathlib import Path
    from masmc_ros.log.bag import Qos
    from masmc_ros.log.write.recording import Options, Recording

    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    _, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, most))
    path = Path(sys.argv[1])
    recording = Recording(path, Options(compression='none', flush_period=0.05))
    channel = recording.channel('/x', 'std_msgs/msg/String', Qos())
    limit = time.monotonic() + 60.0
    written = 0
    while recording.trouble is None and time.monotonic() < limit:
        recording.write(channel, written, written.to_bytes(4, 'little') + bytes(400))
        written += 1
        time.sleep(0.001)
    trouble = recording.trouble
    size = path.stat().st_size
    for _ in range(100):
        recording.write(channel, written, written.to_bytes(4, 'little') + bytes(400))
        written += 1
    if sys.argv[2] == 'again':
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
        while recording.trouble is not None and time.monotonic() < limit:
            time.sleep(0.01)
    try:
        recording.close()
        said = None
    except Exception as error:
        said = str(error)
    print(json.dumps([trouble, size, written, said, recording.lost]))
"""
"""A process whose files are limited to 100 kB, and later unlimited if requested."""


FULL_AT_END_OF_PART = """
    import json, resource, signal, sys, time
    from pathlib import Path
    from masmc_ros.log.write import recording
    from masmc_ros.log.write.recording import Options, Recording

    recording._LAST_TRIES = 0.2
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    _, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, most))
    options = Options(max_size=50_000, compression='none', flush_period=0.05)
    run = Recording(
        Path(sys.argv[1]),
        options,
        closing=lambda log: log.attach('robot.urdf', 'application/xml', bytes(64_000)),
    )
    channel = run.channel('/x', 'std_msgs/msg/String')
    limit = time.monotonic() + 60.0
    written = 0
    while run.trouble is None and time.monotonic() < limit:
        run.write(channel, written, written.to_bytes(4, 'little') + bytes(400))
        written += 1
        time.sleep(0.001)
    trouble = run.trouble
    time.sleep(0.6)
    if sys.argv[2] == 'again':
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
        while run.trouble is not None and time.monotonic() < limit:
            time.sleep(0.01)
    try:
        run.close()
        said = None
    except Exception as error:
        said = str(error)
    print(json.dumps([trouble, written, said]))
"""
"""A process for whose first part the disk has space, but not for the end of this part."""


@pytest.mark.parametrize('then', ['again', 'never'])
def test_recording_disk_full_at_part_end_tried_again(then: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [
            sys.executable,
            '-c',
            textwrap.dedent(FULL_AT_END_OF_PART),
            str(tmp_path / 'run.mcap'),
            then,
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    trouble, written, error_text = json.loads(done.stdout)
    assert trouble == 'File too large'
    if then == 'again':
        assert error_text is None
        assert len(scan(tmp_path / 'run').topics['/x'].messages) == written
    else:
        assert 'run_0.mcap: File too large' in error_text
        assert [path.name for path in (tmp_path / 'run').iterdir()] == ['run_0.mcap']
        assert recover(tmp_path / 'run' / 'run_0.mcap') is not None
        assert 0 < len(scan(tmp_path / 'run').topics['/x'].messages) < written


def test_recording_metadata_file_blocked_tried_again(tmp_path: Path) -> None:
    recording = Recording(tmp_path / 'run.mcap', Options(max_size=1, flush_period=0.05))
    block = recording.path / 'metadata.yaml.part'
    block.mkdir()
    channel = recording.channel('/x', 'std_msgs/msg/String')
    for n in range(2):
        recording.write(channel, n, bytes([n]) * 8)
    limit = time.monotonic() + 60.0
    while recording.trouble is None and time.monotonic() < limit:
        time.sleep(0.01)
    assert 'metadata.yaml: cannot be written' in str(recording.trouble)
    block.rmdir()
    recording.close()
    assert recording.trouble is None
    assert scan(recording.path).topics['/x'].messages == [bytes([n]) * 8 for n in range(2)]


@pytest.mark.parametrize('then', ['again', 'never'])
def test_recording_disk_full_keeps_whole_records(then: str, tmp_path: Path) -> None:
    log = tmp_path / 'run.mcap'
    done = subprocess.run(
        [sys.executable, '-c', textwrap.dedent(FULL), str(log), then],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    trouble, size, written, error_text, lost = json.loads(done.stdout)
    assert trouble == 'File too large'
    assert 0 < size <= 100_000
    assert lost == {}
    if then == 'again':
        assert error_text is None
    else:
        assert 'File too large' in error_text
        assert f'masmc recover {log}' in error_text
        recovered = recover(log)
        assert recovered is not None
        # The file ended with a complete record.
        assert recovered.dropped == 0
    with log.open('rb') as stream:
        messages = make_reader(stream, validate_crcs=True).iter_messages()
        payloads = [message.data[:4] for _, _, message in messages]
    assert payloads == [n.to_bytes(4, 'little') for n in range(len(payloads))]
    assert len(payloads) == written if then == 'again' else 0 < len(payloads) < written
