# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Logs out of order, with clocks that differ, and with compression by rosbag2."""

from collections.abc import Callable
from pathlib import Path
import random
from typing import Any

from helpers.logged_runs import numbers, write_run
from masmc_ros.errors import InputError
from masmc_ros.log.read.reader import read_run, Run
from masmc_ros.log.read.timeline import last_pass_in_order, PassStart, resets
from mcap.reader import make_reader
from mcap.writer import Writer
import numpy as np
import pytest
from rosbags.typesys import get_typestore, Stores
import zstandard

MS = 1_000_000
WALL = 1_700_000_000 * 10**9
STORE = get_typestore(Stores.ROS2_JAZZY)


def copy(
    source: Path,
    target: Path,
    time: Callable[[int], int] = lambda log_time: log_time,
    *,
    late_ns: int = 1,
    content: Callable[[str, bytes], bytes] = lambda _, data: data,
) -> None:
    """Copy a log with other log times, its messages up to `late_ns` late in the file."""
    with source.open('rb') as stream:
        messages = list(make_reader(stream).iter_messages())
    delay = random.Random(1)
    messages.sort(key=lambda entry: entry[2].log_time + delay.randrange(late_ns))
    with target.open('wb') as stream:
        writer = Writer(stream)
        writer.start('ros2', 'other recorder')
        channels: dict[str, int] = {}
        for schema, channel, message in messages:
            assert schema is not None
            name = channel.topic
            if name not in channels:
                kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[name] = writer.register_channel(name, 'cdr', kind, channel.metadata)
            log_time = time(message.log_time)
            data = content(name, message.data)
            writer.add_message(channels[name], log_time, data, log_time)
        writer.finish()


def unlabelled(topic: str, data: bytes) -> bytes:
    """Remove the label of commands, as controllers of other packages send them."""
    if topic != '/effort_commands':
        return data
    kind = 'std_msgs/msg/Float64MultiArray'
    message: Any = STORE.deserialize_cdr(data, kind)
    message.layout.dim = []
    return bytes(STORE.serialize_cdr(message, kind))


def same(run: Run, other: Run) -> bool:
    """Return True if the numbers of two runs are equal."""
    pairs: list[tuple[Any, Any]] = [
        (run.times, other.times), (run.position, other.position),
        (run.torque.stamps, other.torque.stamps), (run.torque.values, other.torque.values),
        (run.reference, other.reference),
        *((run.telemetry[name].values, other.telemetry[name].values) for name in run.telemetry),
    ]
    return all(np.array_equal(mine, theirs, equal_nan=True) for mine, theirs in pairs)


@pytest.fixture(name='log')
def written_log(tmp_path: Path) -> Path:
    """Write a log of 1 s in order, whose log times are the stamps."""
    path = tmp_path / 'run.mcap'
    write_run(path, numbers(1000))
    return path


@pytest.mark.parametrize('offset', [0, 2 * MS, WALL])
def test_read_run_out_of_order_is_complete(tmp_path: Path, log: Path, offset: int) -> None:
    path = tmp_path / 'late.mcap'
    copy(log, path, lambda time: time + offset, late_ns=30 * MS)
    run = read_run(path)
    assert len(run.times) == 1000
    assert same(run, read_run(log))
    assert not any('messages.' in note for note in run.notes)


@pytest.mark.parametrize('offset', [2 * MS, 300 * MS, WALL, -300 * MS + WALL])
def test_read_run_other_clock_aligns_commands(tmp_path: Path, log: Path, offset: int) -> None:
    path = tmp_path / 'bag.mcap'
    copy(log, path, lambda time: time + offset, content=unlabelled)
    run = read_run(path)
    assert same(run, read_run(log))
    seconds = f'{offset / 1e9:.3f} s after the stamps'
    assert any(seconds in note for note in run.notes) == (offset > 2 * MS)


def test_read_run_log_time_beyond_64_bits_is_read(tmp_path: Path, log: Path) -> None:
    """Log times are unsigned; a damaged file can have any."""
    path = tmp_path / 'damaged.mcap'
    copy(log, path, lambda time: 2**64 - 1 if time == 500 * MS else time, late_ns=30 * MS)
    states = read_run(path)
    assert len(states.times) == 1000
    assert (np.diff(states.times) > 0.0).all()


def test_read_run_slow_simulation_aligns_commands(tmp_path: Path, log: Path) -> None:
    path = tmp_path / 'bag.mcap'
    copy(log, path, lambda time: WALL + 7 * time, content=unlabelled)
    assert same(read_run(path), read_run(log))


def test_read_run_equal_log_times_are_counted(tmp_path: Path, log: Path) -> None:
    path = tmp_path / 'bag.mcap'
    copy(log, path, lambda _: WALL, content=unlabelled)
    run = read_run(path)
    assert len(run.times) == 1000
    assert len(run.torque) == 0
    assert '/effort_commands: 1000 that cannot be used, of 1000 messages.' in run.notes


def test_read_run_zero_stamps_prints_reason(tmp_path: Path, log: Path) -> None:
    path = tmp_path / 'bag.mcap'

    def without_stamp(topic: str, data: bytes) -> bytes:
        return data[:4] + bytes(8) + data[12:] if topic == '/joint_states' else data

    copy(log, path, content=without_stamp)
    with pytest.raises(InputError, match='stamps of all 1000 states are 0; expected'):
        read_run(path)


def test_read_run_reset_counts_earlier_states(tmp_path: Path) -> None:
    path = tmp_path / 'run.mcap'
    first, second = tmp_path / 'first.mcap', tmp_path / 'second.mcap'
    write_run(first, numbers(1000))
    write_run(second, numbers(400))
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start('ros2', 'other recorder')
        for log in (first, second):
            with log.open('rb') as source:
                for schema, channel, message in make_reader(source).iter_messages():
                    assert schema is not None
                    kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                    number = writer.register_channel(channel.topic, 'cdr', kind, {})
                    time = message.log_time
                    writer.add_message(number, time, message.data, time)
        writer.finish()
    run = read_run(path)
    assert same(run, read_run(second))
    assert '/joint_states: 1000 before a reset or repeated, of 1400 messages.' in run.notes


def test_read_run_file_compression_is_read(tmp_path: Path, log: Path) -> None:
    folder = tmp_path / 'bag'
    folder.mkdir()
    file = folder / 'bag_0.mcap.zstd'
    file.write_bytes(zstandard.compress(log.read_bytes()))
    expected = read_run(log)
    assert same(read_run(folder), expected)
    assert same(read_run(file), expected)
    file.write_bytes(file.read_bytes()[:-100])
    with pytest.raises(InputError, match='compressed data are damaged'):
        read_run(folder)


def test_read_run_message_compression_is_read(tmp_path: Path, log: Path) -> None:
    path = tmp_path / 'bag.mcap'
    copy(log, path, content=lambda _, data: zstandard.compress(data))
    assert same(read_run(path), read_run(log))
    copy(log, path, content=lambda _, data: zstandard.compress(data)[:-3])
    with pytest.raises(InputError, match='message 0: its compressed data are damaged'):
        read_run(path)


def test_resets_late_stamps_are_none() -> None:
    delay = random.Random(2)
    stamps = np.array(sorted(range(5000), key=lambda tick: tick + delay.randrange(40))) * MS
    assert resets(stamps) == []
    assert PassStart(np.arange(5000), stamps).is_over(0)
    assert (stamps[last_pass_in_order(stamps)] == np.arange(5000) * MS).all()


@pytest.mark.parametrize('shift', [0, MS // 3])
@pytest.mark.parametrize('to', [0, 150])
def test_resets_repeated_time_starts_pass(shift: int, to: int) -> None:
    delay = random.Random(3)
    passes = [range(300), range(to, 280)]
    late = [sorted(ticks, key=lambda tick: tick + delay.randrange(4)) for ticks in passes]
    stamps = np.array([*late[0], *late[1]]) * MS
    stamps[300:] += shift
    kept = last_pass_in_order(stamps)
    # A stamp before the new time stays valid.
    before = range(to + (shift > 0))
    expected = [tick * MS for tick in before] + [tick * MS + shift for tick in passes[1]]
    assert stamps[kept].tolist() == expected
