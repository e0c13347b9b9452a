# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Random messages of third-party publishers: no node exits, and the log has all messages."""

from __future__ import annotations

import json
from pathlib import Path
import random
import signal
import time
from typing import Any

from helpers.checked_reader import read
from helpers.foreign_publishers import NESTED, random_message, record, TEXTS, TYPES, valid_message
from helpers.processes import BOUNDED, NODES, Peer, peer, processes, ros_arguments
from masmc_ros.errors import InputError
from masmc_ros.log.read.reader import read_run
from masmc_ros.log.recover import recover
from masmc_ros.log.write.recording import NOT_UNDERSTOOD
from masmc_ros.messages.cdr_layout import END_OF_TIME
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.message import string_message
from masmc_ros.messages.parameter_record import read_record, record_of
from masmc_ros.messages.stamps import stamp_reader
from masmc_ros.messages.telemetry import TelemetryCdr
from masmc_ros.messages.topics import DRIVEN_JOINTS
from masmc_ros.messages.transforms import TransformsCdr
from masmc_ros.nodes.middleware.ros_topics import raw_class
from masmc_ros.nodes.plant.command_input import base_sources, torque_sources
from masmc_ros.robot.mechanisms import DEFAULT
from mcap.reader import make_reader
import numpy as np
import pytest

ROUNDS, LIMIT = 40, 400.0
"""Number of batches of messages, and maximum time in s for them."""

BATCH = 8
"""Number of messages per topic in a batch."""


def test_stamp_reader_random_message_valid_or_error() -> None:
    draw = random.Random(1)
    for topic, type_name in TYPES.items():
        reader = stamp_reader(topic, type_name)
        for _ in range(400):
            raw = random_message(draw, topic)
            try:
                stamp = reader(raw)
            except InputError:
                continue
            assert stamp is None or 0 <= stamp < END_OF_TIME


def test_command_sources_random_message_valid_or_error() -> None:
    draw = random.Random(2)
    rates = [
        part
        for is_stamped in (False, True)
        for part in base_sources(
            DRIVEN_JOINTS, DEFAULT.twist, '', is_stamped=is_stamped, is_hybrid=False
        )
    ]
    for part in (*torque_sources(DRIVEN_JOINTS), *rates):
        for _ in range(400):
            raw = random_message(draw, part.topic)
            try:
                command = part.read(raw)
            except InputError:
                continue
            assert np.isfinite(command.numbers).all()
            assert command.stamp is None or 0 <= command.stamp < END_OF_TIME


def test_read_record_random_text_valid_or_error() -> None:
    for text in TEXTS:
        try:
            parsed = read_record(text)
        except InputError as error:
            assert 'no record of parameters' in str(error)
            continue
        json.dumps(parsed._asdict()).encode()
        assert parsed.tick >= 0
        for value in parsed.parameters.values():
            assert not isinstance(value, dict)
            entries = value if isinstance(value, list) else []
            assert not any(isinstance(entry, list) for entry in entries)
    assert read_record(record()).parameters['pacing'] == 'realtime'


def parameters(text: str) -> bytes:
    return string_message(text)


def telemetry(seconds: float) -> bytes:
    message = TelemetryCdr('tracking_error', 4)
    raw = bytearray(message.to_bytes())
    raw[-48:-40] = np.array([seconds]).tobytes()
    return bytes(raw)


def transforms(seconds: int) -> bytes:
    return TransformsCdr().fill(seconds * 10**9, np.zeros((6, 7)))


UNREADABLE = {
    'controller/tracking_error': [telemetry(time) for time in (np.nan, np.inf, -1.0, 1e300)],
    '/tf': [transforms(-1), transforms(-(2**31))],
    'plant/parameters': [
        parameters(NESTED % ('[' * 500 + ']' * 500)),
        parameters(NESTED % '1' + ' x'),
        parameters('[' * 100_000),
        parameters(record(tick=float('inf'))),
        parameters(record(stamp=float('-inf'))),
    ],
}
"""Messages that the recorder cannot decode."""


class Sender:
    """Publisher of raw messages that waits until they are in a recorder's file."""

    def __init__(self, tester: Peer, log: Path, topics: list[str]) -> None:
        self._tester = tester
        self._log = log
        self.publishers = {}
        for topic in topics:
            kind = raw_class(TYPES[topic])
            latched = topic == 'recorder/progress'
            self.publishers[topic] = tester.publisher(kind, topic, latched=latched)
        self.sent: dict[str, list[bytes]] = {topic: [] for topic in topics}

    def publish(self, topic: str, raw: bytes) -> None:
        self.publishers[topic].publish(raw)
        self.sent[topic].append(raw)

    def wait_until_recorded(self) -> None:
        """Wait until the last message of each topic is in the uncompressed file."""
        for topic, sent in self.sent.items():
            if sent and topic != 'recorder/progress':
                self._tester.until(
                    lambda raw=sent[-1]: raw in self._log.read_bytes(), f'{topic} in the file'
                )


def send_states(sender: Sender, first: int, count: int) -> None:
    state = JointStateCdr()
    for tick in range(first, first + count):
        state.set_stamp(tick * 10**6)
        sender.publish('joint_states', state.to_bytes())


def check_file(log: Path, sender: Sender, *, also: str = '') -> dict[str, int]:
    """Check that a log is complete; return the number of undecoded messages by topic."""
    messages, _ = read(log)
    assert recover(log) is None
    recorded: dict[str, list[bytes]] = {}
    for topic, _, raw in messages:
        recorded.setdefault(topic.lstrip('/'), []).append(raw)
    for topic, sent in sender.sent.items():
        if topic == 'recorder/progress':
            continue
        mine = set(sent)
        assert [raw for raw in recorded[topic.lstrip('/')] if raw in mine] == sent, topic
    with log.open('rb') as stream:
        metadata = {entry.name: entry.metadata for entry in make_reader(stream).iter_metadata()}
    return {topic: int(count) for topic, count in metadata.get(NOT_UNDERSTOOD, {}).items()}


def test_recorder_undecodable_messages_recorded_and_counted(tmp_path: Path) -> None:
    log = tmp_path / 'run.mcap'
    with processes(tmp_path) as started, peer(started.domain) as tester:
        arguments = ros_arguments(None, recorder__output=log, recorder__compression='none')
        recorder = started.start('recorder', *arguments)
        sender = Sender(tester, log, ['joint_states', *UNREADABLE])
        for publisher in sender.publishers.values():
            tester.wait_for_subscribers(publisher)
        send_states(sender, 1, 1)
        sender.wait_until_recorded()
        for topic, bad in UNREADABLE.items():
            for raw in bad:
                sender.publish(topic, raw)
        sender.wait_until_recorded()
        send_states(sender, 2, 1)
        sender.wait_until_recorded()
        recorder.signal(signal.SIGTERM)
        assert started.wait() == {'recorder': 0}, started.output()
        assert 'Traceback' not in started.output()
        for topic in UNREADABLE:
            assert recorder.logged('ERROR', f'{topic} is recorded as it came')
    counts = check_file(log, sender)
    assert counts == {f'/{t.lstrip("/")}': len(bad) for t, bad in UNREADABLE.items()}
    # The log time of each message is the stamp of the latest state. Other messages, such as the
    # recorder's own diagnostics, may have any log time.
    times = [time for topic, time, _ in read(log)[0] if topic in counts]
    assert len(times) == sum(counts.values())
    assert set(times) == {10**6}
    assert read_run(log).times.tolist() == [0.001, 0.002]


@pytest.mark.slow
def test_recorder_random_messages_all_recorded(tmp_path: Path) -> None:
    log, draw = tmp_path / 'run.mcap', random.Random(3)
    with processes(tmp_path) as started, peer(started.domain) as tester:
        arguments = ros_arguments(None, recorder__output=log, recorder__compression='none')
        recorder = started.start('recorder', *arguments)
        # The recorder subscribes to these topics only if a plant requires them.
        topics = [topic for topic in TYPES if topic not in ('cmd_vel', 'recorder/progress')]
        sender = Sender(tester, log, topics)
        for publisher in sender.publishers.values():
            tester.wait_for_subscribers(publisher)
        limit = time.monotonic() + LIMIT
        for number in range(ROUNDS):
            if time.monotonic() > limit:
                break
            for topic in topics:
                for _ in range(BATCH):
                    sender.publish(topic, random_message(draw, topic))
            send_states(sender, 10 * number, 3)
            sender.wait_until_recorded()
            assert recorder.process.poll() is None, started.output()
        recorder.signal(signal.SIGTERM)
        assert started.wait() == {'recorder': 0}, started.output()
        assert 'Traceback' not in started.output()
    counts = check_file(log, sender)
    assert counts['/controller/tracking_error'] > 0
    assert counts['/tf'] > 0
    assert counts['/plant/parameters'] > 0


@pytest.mark.slow
def test_nodes_random_messages_during_run_no_node_exits(tmp_path: Path) -> None:
    """Send random messages on every topic of the nodes during a run in real time."""
    log, draw = tmp_path / 'run.mcap', random.Random(4)
    settings: dict[str, Any] = {
        'recorder__output': log,
        'pacing': 'realtime',
        'control_period': 0.01,
        'duration': 0.0,
        'controller__pose_source': 'odom',
        'trajectory__start_time': -1.0,
        **BOUNDED,
    }
    with processes(tmp_path) as started, peer(started.domain) as tester:
        nodes = started.start_all(*ros_arguments(**settings), nodes=NODES)
        sender = Sender(tester, log, list(TYPES))
        listened = [t for t in TYPES if t not in ('cmd_vel', 'arm_velocity_commands')]
        for topic in listened:
            tester.wait_for_subscribers(sender.publishers[topic])
        limit = time.monotonic() + LIMIT
        for _ in range(ROUNDS):
            if time.monotonic() > limit:
                break
            for topic in TYPES:
                for _ in range(BATCH):
                    sender.publish(topic, random_message(draw, topic))
            end = time.monotonic() + 0.3
            tester.until(lambda end=end: time.monotonic() > end)
            for name, node in nodes.items():
                assert node.process.poll() is None, f'{name}\n{started.output()}'
        for node in nodes.values():
            node.signal(signal.SIGINT)
        assert set(started.wait().values()) == {0}, started.output()
        assert 'Traceback' not in started.output()
    read(log)
    assert recover(log) is None
    error = read_run_or_error(log)
    assert error is None or '\n' not in error


def read_run_or_error(log: Path) -> str | None:
    try:
        read_run(log)
    except InputError as error:
        return str(error)
    return None


def test_stamp_reader_valid_message_of_every_topic_read() -> None:
    for topic, type_name in TYPES.items():
        if topic in ('/parameter_events', 'recorder/progress'):
            continue
        stamp_reader(topic, type_name)(valid_message(topic))
    assert record_of(valid_message('plant/parameters')).node == '/plant'
