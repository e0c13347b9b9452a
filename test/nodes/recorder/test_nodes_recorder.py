# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Contents of the recorder's file: every message once, readable by all readers."""

from __future__ import annotations

import json
import os
from pathlib import Path
import signal
import subprocess
import sys
import textwrap
import time
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Twist
from helpers.child_environment import child_environment, domain_variables
from helpers.log_contents import LogContents, read_log
from helpers.processes import (
    BOUNDED,
    NODES,
    PATIENCE,
    Peer,
    peer,
    Processes,
    processes,
    ros_arguments,
    shortened,
)
from masmc_ros.log.read.reader import read_run
from masmc_ros.log.recover import is_complete
from masmc_ros.messages.message import text_of
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.messages.topics import TELEMETRY
from masmc_ros.scenario.scenario import load_scenario
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rclpy.duration import Duration
from rclpy.qos import (
    DurabilityPolicy,
    qos_profile_sensor_data,
    QoSProfile,
    ReliabilityPolicy,
)
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header

LAST = 700
"""Last tick of the recorded runs; not a multiple of any decimation."""


@pytest.fixture(scope='module')
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('file')
    return shortened(folder, LAST * 1e-3, wait_for='[controller, trajectory, recorder]')


@pytest.fixture(scope='module')
def recorded(file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the log of a run of four processes with telemetry decimated by 3."""
    folder = tmp_path_factory.mktemp('recorded')
    log = folder / 'run.mcap'
    with processes(folder) as started:
        started.start_all(
            *ros_arguments(
                file,
                recorder__output=log,
                controller__telemetry_decimation=3,
                plant__odom_decimation=11,
                plant__clock_decimation=13,
                trajectory__window=0.2,
                trajectory__horizon=0.3,
            )
        )
        assert started.wait() == dict.fromkeys(NODES, 0), started.output()
    return log


@pytest.fixture(scope='module')
def contents(recorded: Path) -> LogContents:
    return read_log(recorded)


def test_recorder_log_has_every_message_once(contents: LogContents) -> None:
    ticks = np.arange(LAST + 1)

    def decimated(by: int) -> list[int]:
        return ticks[(ticks % by == 0) | (ticks == LAST)].tolist()

    assert contents.stamps('joint_states') == [tick * 10**6 for tick in ticks.tolist()]
    assert contents.stamps('effort_commands') == [tick * 10**6 for tick in ticks.tolist()]
    assert contents.stamps('odom') == [tick * 10**6 for tick in decimated(11)]
    assert contents.stamps('clock') == [tick * 10**6 for tick in decimated(13)]
    assert len(contents.messages['base_twist']) == len(decimated(11))
    for label in TELEMETRY:
        expected = ticks[ticks % 3 == 0].tolist()
        assert contents.stamps(f'controller/{label}') == [tick * 10**6 for tick in expected]
    assert len(contents.messages['reference']) == 4
    for node in ('plant', 'trajectory', 'controller'):
        assert len(contents.messages[f'{node}/parameters']) == 1
    assert contents.stamps('path/actual') == [0, 500_000_000, LAST * 10**6]
    assert contents.stamps('path/desired') == [0]
    assert len(contents.messages['robot_description']) == 1


def test_recorder_log_times_equal_stamps(contents: LogContents) -> None:
    for topic in (
        'joint_states',
        'effort_commands',
        'odom',
        'controller/tracking_error',
        'path/desired',
        'path/actual',
    ):
        assert contents.log_times[topic] == contents.stamps(topic), topic
    everything = [time for times in contents.log_times.values() for time in times]
    assert min(everything) == 0
    assert max(everything) == LAST * 10**6


def test_recorder_log_statistics_indexes_channels_complete(contents: LogContents) -> None:
    summary = contents.summary
    assert summary.statistics is not None
    total = sum(len(messages) for messages in contents.messages.values())
    assert summary.statistics.message_count == total
    assert summary.chunk_indexes
    for channel in summary.channels.values():
        assert channel.message_encoding == 'cdr'
        assert channel.metadata['offered_qos_profiles'], channel.topic
        assert channel.metadata['topic_type_hash'].startswith('RIHS01_'), channel.topic


def test_recorder_log_has_active_parameters_and_file(
    contents: LogContents, file: Path
) -> None:
    settings = ['controller.telemetry_decimation=3', 'plant.odom_decimation=11']
    settings += ['plant.clock_decimation=13', 'trajectory.window=0.2', 'trajectory.horizon=0.3']
    expected = load_scenario(str(file), settings)
    (record,) = contents.metadata['parameters']
    assert set(record) == {'plant', 'trajectory', 'controller'}
    for node, text in record.items():
        assert json.loads(text) == json.loads(json.dumps(expected[node])), node
    (description,) = contents.messages['robot_description']
    assert contents.attachments == {
        file.name: file.read_bytes(),
        'robot.urdf': text_of(description).encode(),
    }
    assert contents.metadata['versions'][0].keys() >= {'masmc_ros', 'git', 'python', 'numpy'}
    assert 'parameter_changes' not in contents.metadata


def test_recorder_log_decoded_by_third_party_readers(
    recorded: Path, contents: LogContents
) -> None:
    with recorded.open('rb') as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        states = [
            message
            for _, channel, _, message in reader.iter_decoded_messages()
            if channel.topic == '/joint_states'
        ]
    assert [s.header.stamp.sec * 10**9 + s.header.stamp.nanosec for s in states] == (
        contents.stamps('joint_states')
    )
    run = read_run(recorded)
    assert [list(state.position) for state in states] == run.position.tolist()
    counts: dict[str, int] = {}
    # rosbags uses the definitions in the file.
    with AnyReader([recorded]) as bag:
        for connection, _, raw in bag.messages():
            bag.deserialize(raw, connection.msgtype)
            topic = connection.topic.lstrip('/')
            counts[topic] = counts.get(topic, 0) + 1
    assert counts == {topic: len(rows) for topic, rows in contents.messages.items() if rows}


def test_recorder_volatile_publisher_no_duplicates(file: Path, tmp_path: Path) -> None:
    """The recorder needs a second, volatile subscription, which must not duplicate messages."""
    log = tmp_path / 'run.mcap'
    with processes(tmp_path) as started, peer(started.domain) as tester:
        sender = tester.publisher(Float64MultiArray, 'controller/tracking_error')
        arguments = ros_arguments(file, recorder__output=log)
        started.start('recorder', *arguments)
        tester.wait_for_subscribers(sender)
        started.start_all(*arguments, nodes=('trajectory', 'controller', 'plant'))
        sender.publish(Float64MultiArray(data=[1.0, 2.0]))
        assert set(started.wait().values()) == {0}, started.output()
    messages = read_log(log).messages['controller/tracking_error']
    assert len(messages) == LAST + 1 + 1
    assert len(set(messages)) == LAST + 1 + 1


def run_until(tester: Peer, stamp_ns: int) -> None:
    """Wait until the robot's time has reached a stamp."""
    raw = tester.collect(Odometry, 'odom', raw=True)
    tester.until(lambda: raw and header_stamp(raw[-1]) >= stamp_ns, f'{stamp_ns} ns on odom')


def realtime(started: Processes, log: Path) -> dict[str, Any]:
    """Start four endless nodes in real time."""
    wait_for = '[controller, trajectory, recorder, peer]'
    settings = {'plant__pacing': 'realtime', 'plant__wait_for': wait_for, **BOUNDED}
    return started.start_all(*ros_arguments(recorder__output=log, duration=0.0, **settings))


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_nodes_end_by_signal_log_complete(
    tmp_path: Path, number: signal.Signals
) -> None:
    log = tmp_path / 'run.mcap'
    with processes(tmp_path) as started:
        with peer(started.domain) as tester:
            nodes = realtime(started, log)
            run_until(tester, 500_000_000)
        for node in nodes.values():
            node.signal(number)
        assert started.wait() == dict.fromkeys(NODES, 0), started.output()
        assert 'Traceback' not in started.output()
    contents = read_log(log)
    assert contents.summary.statistics is not None
    stamps = contents.stamps('joint_states')
    # The plant repeats its first state until the first command arrives.
    repeated = stamps.count(0) - 1
    assert len(set(contents.messages['joint_states'][: repeated + 1])) == 1
    del stamps[:repeated]
    assert stamps == [tick * 10**6 for tick in range(len(stamps))]
    assert len(stamps) > 500
    assert contents.stamps('odom') == stamps[::20]
    assert set(contents.metadata['parameters'][0]) == {'plant', 'trajectory', 'controller'}
    # read_run raises an error for an incomplete log.
    assert len(read_run(log).times) == len(stamps)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_recorder_waiting_for_nodes_ends_by_signal(
    tmp_path: Path, number: signal.Signals
) -> None:
    """The signal comes after the recorder has created its file, and without other nodes."""
    log = tmp_path / 'run.mcap'
    with processes(tmp_path) as started:
        recorder = started.start('recorder', *ros_arguments(recorder__output=log))
        with peer(started.domain) as tester:
            tester.until(lambda: recorder.logged('INFO', 'recording into'), 'the recorder')
        recorder.signal(number)
        assert started.wait() == {'recorder': 0}, started.output()
    assert read_log(log).messages['joint_states'] == []


def test_recorder_threads_have_lower_priority(tmp_path: Path) -> None:
    arguments = ros_arguments(recorder__output=tmp_path / 'run.mcap')
    with processes(tmp_path) as started:
        recorder = started.start('recorder', *arguments)
        with peer(started.domain) as tester:
            tester.until(lambda: recorder.logged('INFO', 'recording into'), 'the recorder')
        threads = Path(f'/proc/{recorder.process.pid}/task').iterdir()
        priorities = {os.getpriority(os.PRIO_PROCESS, int(thread.name)) for thread in threads}
    assert priorities == {os.getpriority(os.PRIO_PROCESS, 0) + 5}


def test_recorder_extra_topics_of_any_qos_recorded(tmp_path: Path) -> None:
    log = tmp_path / 'run.mcap'
    names = {
        f'{reliability.name}_{durability.name}'.lower(): QoSProfile(
            depth=10, reliability=reliability, durability=durability
        )
        for reliability in (ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT)
        for durability in (DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL)
    }
    with processes(tmp_path) as started, peer(started.domain) as tester:
        senders = {
            name: tester.node.create_publisher(Odometry, name, qos) for name, qos in names.items()
        }
        extra = f'[{", ".join(names)}]'
        settings = {'output': log, 'extra_topics': extra, 'compression': 'none'}
        recorder = started.start('recorder', *ros_arguments(None, **settings))
        for sender in senders.values():
            tester.wait_for_subscribers(sender)

        def are_recorded() -> bool:
            """Send again, because best effort loses messages; return True if all are written."""
            for name, sender in senders.items():
                sender.publish(Odometry(header=Header(frame_id=f'sent as {name}')))
            data = log.read_bytes()
            return all(f'sent as {name}'.encode() in data for name in names)

        tester.until(are_recorded, 'every topic in the file')
        recorder.signal(signal.SIGTERM)
        assert started.wait() == {'recorder': 0}, started.output()
    contents = read_log(log)
    channels = {channel.topic: channel for channel in contents.summary.channels.values()}
    for name, qos in names.items():
        assert contents.messages[name]
        offered = channels[f'/{name}'].metadata['offered_qos_profiles']
        assert f'reliability: {qos.reliability.name.lower()}' in offered
        assert f'durability: {qos.durability.name.lower()}' in offered


def test_recorder_best_effort_states_recorded_once(tmp_path: Path) -> None:
    """States of a driver with the profile of sensor data; another sender is reliable."""
    log = tmp_path / 'run.mcap'
    with processes(tmp_path) as started, peer(started.domain) as tester:
        driver = tester.node.create_publisher(JointState, 'joint_states', qos_profile_sensor_data)
        reliable = tester.publisher(JointState, 'joint_states')
        recorder = started.start('recorder', *ros_arguments(None, output=log, compression='none'))
        tester.wait_for_subscribers(driver)
        tester.wait_for_subscribers(reliable, 2)

        def are_recorded() -> bool:
            for frame, sender in (('driver', driver), ('reliable', reliable)):
                message = JointState(header=Header(frame_id=frame), name=['joint'])
                message.header.stamp = tester.node.get_clock().now().to_msg()
                sender.publish(message)
            return all(frame in log.read_bytes() for frame in (b'driver', b'reliable'))

        tester.until(are_recorded, 'the states of both')
        recorder.signal(signal.SIGTERM)
        assert started.wait() == {'recorder': 0}, started.output()
    states = read_log(log).messages['joint_states']
    assert len(states) == len(set(states))


@pytest.mark.slow
def test_recorder_composed_run_diverges_log_complete(tmp_path: Path) -> None:
    """The failure of the plant must not prevent the recorder from completing its file."""
    log = tmp_path / 'run.mcap'
    with processes(tmp_path) as started:
        started.start(
            'composed',
            '--record',
            *ros_arguments(
                plant__wait_for='[controller, trajectory, recorder]',
                # In real time, or without the duration of the file, it would be a fault.
                controller__switching='implicit',
                controller__observer_gain=1.0,
                controller__model_scale=9.0,
                recorder__output=log,
            ),
        )
        assert started.wait() == {'composed': 2}, started.output()
        assert 'the closed loop diverged at t = ' in started.output()
    contents = read_log(log)
    assert contents.summary.statistics is not None
    assert len(contents.messages['effort_commands']) > 1


def test_recorder_suite_topics_in_extra_topics_recorded_once(tmp_path: Path) -> None:
    log = tmp_path / 'run.mcap'
    with processes(tmp_path) as started, peer(started.domain) as tester:
        senders = {
            tester.publisher(Odometry, 'odom'): Odometry(),
            tester.publisher(Twist, 'cmd_vel'): Twist(),
        }
        extra = '[/odom, odom, joint_states, /cmd_vel, cmd_vel]'
        settings = {'output': log, 'extra_topics': extra}
        recorder = started.start('recorder', *ros_arguments(None, **settings))
        for sender in senders:
            tester.wait_for_subscribers(sender)
        # Several checks of the extra topics.
        time.sleep(0.3)
        for sender, message in senders.items():
            sender.publish(message)
            assert sender.wait_for_all_acked(Duration(seconds=PATIENCE))
        recorder.signal(signal.SIGTERM)
        assert started.wait() == {'recorder': 0}, started.output()
    contents = read_log(log)
    topics = [channel.topic for channel in contents.summary.channels.values()]
    assert len(topics) == len(set(topics))
    assert len(contents.messages['odom']) == len(contents.messages['cmd_vel']) == 1


def test_recorder_stamps_of_other_clock_start_no_part(tmp_path: Path) -> None:
    with processes(tmp_path) as started, peer(started.domain) as tester:
        states = tester.publisher(JointState, 'joint_states')
        odometry = tester.publisher(Odometry, 'odom')
        settings = {'output': tmp_path / 'run.mcap', 'max_duration': 10.0}
        recorder = started.start('recorder', *ros_arguments(None, **settings))
        for sender in (states, odometry):
            tester.wait_for_subscribers(sender)
        for second in range(5):
            states.publish(JointState(header=Header(stamp=Time(sec=second))))
            odometry.publish(Odometry(header=Header(stamp=Time(sec=1_750_000_000 * (second % 2)))))
        for sender in (states, odometry):
            assert sender.wait_for_all_acked(Duration(seconds=PATIENCE))
        recorder.signal(signal.SIGTERM)
        assert started.wait() == {'recorder': 0}, started.output()
    (log,) = (tmp_path / 'run').glob('*.mcap')
    contents = read_log(log)
    assert len(contents.messages['joint_states']) == len(contents.messages['odom']) == 5


@pytest.mark.parametrize(
    ('name', 'fault'),
    [
        ('foo bar', 'topic name must not contain characters other than'),
        ('1x', 'topic name token must not start with a number'),
        ('{robot}/odom', 'unknown substitution: {robot}'),
    ],
)
def test_recorder_invalid_extra_topic_exits_with_one_line(
    name: str, fault: str, tmp_path: Path
) -> None:
    with processes(tmp_path) as started:
        extra = f"['{name}']"
        settings = {'output': tmp_path / 'run.mcap', 'extra_topics': extra}
        recorder = started.start('recorder', *ros_arguments(None, **settings))
        assert started.wait() == {'recorder': 2}, started.output()
        (line,) = recorder.stderr()
    assert line.startswith(f'extra_topics = {name}: {fault}')
    assert line.endswith('; expected names such as scan or /camera/image_raw')
    assert not (tmp_path / 'run.mcap').exists()


RAISES = """
    import sys
    from masmc_ros.nodes.process.runtime import run
    from masmc_ros.nodes.recorder.node import RecorderNode
    from rclpy.node import Node

    class Broken:
        finished = follows = False

        def __init__(self, *, context, command_line):
            self.node = Node('broken', context=context)

        def connect(self):
            self.node.create_timer(0.05, self.fault)

        def fault(self):
            raise RuntimeError('fault of the test')

        def close(self, spin):
            spin()

    sys.exit(run([Broken, RecorderNode]))
"""
"""A recorder in one process with a node whose timer raises, also while both nodes are closed."""


def test_recorder_callback_raises_log_complete(tmp_path: Path) -> None:
    log = tmp_path / 'run.mcap'
    with processes(tmp_path) as started:
        done = subprocess.run(
            [sys.executable, '-c', textwrap.dedent(RAISES), '--ros-args', '-p', f'output:={log}'],
            env={**child_environment(), **domain_variables(started.domain)},
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )
    assert done.returncode == 1
    assert 'RuntimeError: fault of the test' in done.stderr
    assert is_complete(log)
