# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Live node: display of a run in viewers, and changes of parameters by viewers."""

from __future__ import annotations

from collections.abc import Iterator
import os
from pathlib import Path
import re
import signal
import socket
import subprocess
import sys
import time
from typing import Any

from helpers.child_environment import child_environment, domain_variables
from helpers.foxglove_client import Viewer, viewer
from helpers.processes import (
    BOUNDED,
    NodeProcess,
    PAPER,
    PATIENCE,
    Peer,
    peer,
    Processes,
    processes,
    ros_arguments,
    shortened,
)
from masmc_ros.loop.simulation import Simulation
from masmc_ros.messages.definitions import definition
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.stamps import header_stamp, transforms_stamp
from masmc_ros.messages.string_message import text_of
from masmc_ros.messages.topics import SYSTEM_TOPICS, TOPICS
from masmc_ros.nodes.live.node import SAMPLED
from masmc_ros.nodes.middleware.qos import publisher_qos
from masmc_ros.scenario.scenario import load_scenario
from nav_msgs.msg import Path as Path_
import numpy as np
import pytest
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import parameter_value_to_python
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import String

NODES = ('trajectory', 'controller', 'plant')
PERIOD = 1_000_000
RATE = 10.0


def listening(tester: Peer, node: NodeProcess) -> int:
    """Return the port in a live node's log."""
    address = tester.until(lambda: re.search(r'ws://127\.0\.0\.1:(\d+)', '\n'.join(node.stderr())))
    return int(address[1])


class Run:
    """Run in real time with a live node, and a node of the test."""

    def __init__(self, started: Processes, tester: Peer, live: NodeProcess) -> None:
        self.tester = tester
        self.live = live
        self.port = listening(tester, live)
        self.processes = started

    def value(self, name: str) -> Any:
        """Return a parameter of the controller, requested from the controller."""
        request = GetParameters.Request(names=[name])
        response = self.tester.call(GetParameters, '/controller/get_parameters', request)
        value = parameter_value_to_python(response.values[0])
        return value if isinstance(value, float | str) else list(value)


@pytest.fixture(scope='module')
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """Yield an endless run in real time that the live node displays ten times per second."""
    with processes(tmp_path_factory.mktemp('run')) as started, peer(started.domain) as tester:
        live = started.start('live', '--ros-args', '-p', 'port:=0', '-p', f'rate:={RATE}')
        started.start_all(
            *ros_arguments(
                PAPER,
                duration=0.0,
                plant__pacing='realtime',
                # The display needs a controller at work, however late its torques are.
                controller__runaway_detection=False,
                **BOUNDED,
            ),
            nodes=NODES,
        )
        run = Run(started, tester, live)
        with viewer(run.port) as first:
            # The node may discover the controller's topics before its services.
            first.until(
                lambda: first.set_parameter('/controller.k_s2', 100.0) == 100.0,
                'a parameter that can be set',
            )
        yield run


@pytest.fixture
def shown(run: Run) -> Iterator[Viewer]:
    """Yield a viewer that has received the controller's parameters."""
    with viewer(run.port) as client:
        client.until(lambda: '/controller.k_s1' in client.parameters(), 'parameters')
        yield client


def test_live_all_topics_advertised_with_definition(shown: Viewer) -> None:
    every = (topic for topic in (*TOPICS, *SYSTEM_TOPICS) if not topic.turns_up)
    topics = {f'/{topic.name.lstrip("/")}': topic for topic in every}
    shown.until(lambda: len(shown.channels) >= len(topics), 'all channels')
    assert set(shown.channels) == set(topics)
    for name, channel in shown.channels.items():
        assert channel['encoding'] == 'cdr'
        assert channel['schemaName'] == topics[name].type_name
        assert channel['schemaEncoding'] == 'ros2msg'
        assert channel['schema'] == definition(topics[name].type_name).text


def test_live_messages_stamped_with_robot_time(shown: Viewer) -> None:
    expected = {f'/{topic.name.lstrip("/")}' for topic in TOPICS if not topic.turns_up}
    shown.until(lambda: set(shown.messages) >= expected, 'a message of every topic')
    shown.until(lambda: len(shown.messages['/joint_states']) > 5, 'motion')
    for stamp, raw in shown.messages['/joint_states']:
        assert stamp == header_stamp(raw)
        assert deserialize_message(raw, JointState).name[-1] == 'arm_joint_2'
    stamps = [stamp for stamp, _ in shown.messages['/joint_states']]
    assert stamps == sorted(set(stamps))
    shown.until(lambda: set(shown.times) >= set(stamps[2:]), 'the time of every state')
    frames = [stamp for stamp, _ in shown.messages['/tf']]
    for stamp, raw in shown.messages['/tf']:
        assert stamp == transforms_stamp(raw)
    # The two subscriptions start at different times; the frames of a state precede it.
    both = max(stamps[0], frames[0])
    assert {s for s in frames if both <= s <= stamps[-1]} == {s for s in stamps if s >= both}
    assert '<robot' in text_of(shown.last('/robot_description'))


def test_live_topics_of_every_tick_sent_at_display_rate(run: Run) -> None:
    """The display rate limits messages independently of the speed of robot time."""
    start = time.monotonic()
    with viewer(run.port) as shown:
        topics = SAMPLED & {'joint_states', 'effort_commands', 'controller/tracking_error'}
        for topic in topics:
            shown.until(
                lambda topic=topic: len(shown.messages.get(f'/{topic}', ())) > 20, f'{topic}'
            )
        for topic in topics:
            stamps = {stamp for stamp, _ in shown.messages[f'/{topic}']}
            # The latest earlier message, and ten messages per second.
            assert len(stamps) <= 2 + RATE * (time.monotonic() - start)
            assert max(stamps) - min(stamps) > 2 * PERIOD * len(stamps), 'all messages were sent'


def test_live_set_parameter_shows_active_value(run: Run, shown: Viewer) -> None:
    assert shown.set_parameter('/controller.k_s1', 150) == 150.0
    assert run.value('k_s1') == 150.0
    assert shown.set_parameter('/controller.sigma', [1, 2.5, 3, 4]) == [1.0, 2.5, 3.0, 4.0]
    assert run.value('sigma') == [1.0, 2.5, 3.0, 4.0]
    assert shown.set_parameter('/controller.law', 'smc') == 'smc'
    assert run.value('law') == 'smc'
    assert shown.parameters('/controller.k_s1', '/controller.law') == {
        '/controller.k_s1': 150.0,
        '/controller.law': 'smc',
    }
    assert shown.statuses() == []


@pytest.mark.parametrize(
    ('name', 'value', 'words'),
    [
        ('/controller.k_s1', -1, ('k_s1', '-1.0', '>= 0')),
        ('/controller.k_s1', [1.0, 2.0], ('4 numbers',)),
        ('/controller.k_s1', {'a': 1}, ('no value',)),
        ('/controller.k_s3', 1.0, ('k_s3',)),
        ('/controller.model_scale', 1.0, ('model_scale',)),
        ('/missing.k_s1', 1.0, ('/missing', '/controller')),
    ],
)
def test_live_set_parameter_invalid_reports_and_keeps_value(
    run: Run, shown: Viewer, name: str, value: Any, words: tuple[str, ...]
) -> None:
    previous = shown.parameters(name)
    error_count = len(run.live.logged('ERROR'))
    active = shown.set_parameter(name, value)
    assert active == previous.get(name)
    assert shown.parameters(name) == previous
    shown.until(shown.statuses, 'the reason')
    run.tester.until(lambda: len(run.live.logged('ERROR')) > error_count, 'a line in the log')
    for text in (shown.statuses()[-1], run.live.logged('ERROR')[-1]):
        for word in (name, *words):
            assert word in text

    def logged() -> bool:
        logs = [deserialize_message(raw, Log) for _, raw in shown.messages.get('/rosout', ())]
        return any(log.name == 'live' and name in log.msg for log in logs)

    shown.until(logged, 'the line on /rosout')


def test_live_parameter_changed_by_other_node_shown(run: Run, shown: Viewer) -> None:
    shown.follow_parameters('/controller.k_s2', '/controller.boundary_layer')
    # The response to a request confirms that the subscription exists.
    shown.parameters()
    run.tester.change('/controller', k_s2=0.25, boundary_layer=0.25)
    for name in ('/controller.k_s2', '/controller.boundary_layer'):
        shown.until(lambda name=name: 0.25 in shown.changes(name), name)
    parameters = shown.parameters()
    assert parameters['/controller.k_s2'] == parameters['/controller.boundary_layer'] == 0.25
    assert parameters['/plant.robot.link_1_length'] == 0.514


def test_live_late_viewer_gets_latched_messages(run: Run, shown: Viewer) -> None:
    shown.set_parameter('/controller.observer_gain', 0.125)
    shown.until(
        lambda: any(
            b'0.125' in raw for _, raw in shown.messages.get('/controller/parameters', ())
        ),
        'the change',
    )
    with viewer(run.port) as late:

        def records() -> list[str]:
            return [text_of(raw) for _, raw in late.messages.get('/controller/parameters', ())]

        late.until(lambda: any('0.125' in text for text in records()), 'the change')
        assert '"k_s1"' in records()[0]
        for topic in ('/robot_description', '/path/desired', '/plant/parameters'):
            assert late.last(topic)


def test_live_viewers_connect_repeatedly_all_served(run: Run) -> None:
    for _ in range(3):
        with viewer(run.port) as passing:
            assert passing.last('/joint_states')


def test_live_lockstep_run_unchanged_and_end_shown_later(tmp_path: Path) -> None:
    # Without an end: discovery of the plant may take long.
    file = shortened(tmp_path, 0.0)
    state = JointStateCdr()

    def positions(viewer: Viewer) -> dict[int, list[float]]:
        """Return all positions that a viewer has received, by tick."""
        by_tick = {}
        for _, raw in viewer.messages['/joint_states']:
            assert state.load(raw)
            by_tick[state.stamp_ns // PERIOD] = state.position.tolist()
        return by_tick

    with processes(tmp_path) as started, peer(started.domain) as tester:
        live = started.start('live', '--ros-args', '-p', 'port:=0')
        port = listening(tester, live)
        nodes = started.start_all(
            *ros_arguments(file, plant__wait_for='[controller,trajectory,live]'), nodes=NODES
        )
        with viewer(port) as client:
            client.until(lambda: len(client.messages.get('/joint_states', ())) > 10, 'motion')
            seen = positions(client)
        for node in nodes.values():
            node.signal(signal.SIGINT)
        for node in nodes.values():
            assert node.wait() == 0, started.output()
        assert live.process.poll() is None
        with viewer(port) as late:
            assert late.last('/joint_states')
            assert late.last('/tf')
            shown_late = positions(late)
        live.signal(signal.SIGINT)
        assert live.wait() == 0
    assert max(shown_late) >= max(seen) > 0
    seen |= shown_late
    settings = [f'duration={max(seen) * 1e-3:.3f}']
    blocks = Simulation(load_scenario(str(file), settings)).run()
    expected = np.concatenate([block.position for block in blocks])
    for tick, position in seen.items():
        assert position == expected[tick].tolist(), tick


def test_live_asset_only_meshes_of_robot_sent(tmp_path: Path) -> None:
    mesh = tmp_path / 'arm.stl'
    mesh.write_bytes(bytes(range(256)) * 1000)
    (tmp_path / 'other.stl').write_bytes(b'of another robot')
    geometry = f'<visual><geometry><mesh filename="file://{mesh}"/></geometry></visual>'
    urdf = f'<robot name="shown"><link name="base_link">{geometry}</link></robot>'
    with processes(tmp_path) as started, peer(started.domain) as tester:
        live = started.start('live', '--ros-args', '-p', 'port:=0')
        description = tester.node.create_publisher(String, 'robot_description', publisher_qos(1))
        description.publish(String(data=urdf))
        with viewer(listening(tester, live)) as client:
            assert text_of(client.last('/robot_description')) == urdf
            assert client.asset(f'file://{mesh}') == mesh.read_bytes()
            assert client.asset(f'file://{tmp_path}/other.stl') is None


@pytest.mark.slow
def test_live_too_many_viewers_first_ones_served(tmp_path: Path) -> None:
    """A viewer beyond the limit gets the reason, and all messages after another disconnects."""
    with processes(tmp_path) as started, peer(started.domain) as tester:
        live = started.start('live', '--ros-args', '-p', 'port:=0', '-p', 'max_viewers:=1')
        port = listening(tester, live)
        paths = tester.node.create_publisher(Path_, 'path/desired', publisher_qos(1))

        def publish(stamp: int) -> None:
            message = Path_()
            message.header.stamp.sec = stamp
            paths.publish(message)

        def shown(client: Viewer) -> list[int]:
            return [time // 10**9 for time, _ in client.messages.get('/path/desired', ())]

        publish(1)
        with viewer(port) as waiting, viewer(port) as third:
            with viewer(port) as first:
                # Each viewer has subscribed to all topics before the next one connects.
                first.until(lambda: 1 in shown(first), 'a message')
                for client in (waiting, third):
                    client.until(client.statuses, 'the reason')
                    assert 'max_viewers' in client.statuses()[-1]
                publish(2)
                first.until(lambda: 2 in shown(first), 'another message')
                third.parameters()
                assert shown(waiting) == shown(third) == []
            waiting.until(lambda: shown(waiting), 'earlier messages')
            publish(3)
            waiting.until(lambda: 3 in shown(waiting), 'a message')
            third.parameters()
            assert shown(waiting) == [2, 3]
            assert shown(third) == []
        assert 'get no messages; expected at most 1' in live.logged('WARN')[-1]
        live.signal(signal.SIGINT)
        assert live.wait() == 0


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_live_signal_with_connected_viewer_exits_cleanly(
    tmp_path: Path, number: signal.Signals
) -> None:
    with processes(tmp_path) as started, peer(started.domain) as tester:
        live = started.start('live', '--ros-args', '-p', 'port:=0')
        with viewer(listening(tester, live)) as client:
            client.until(lambda: len(client.channels) > 10, 'channels')
            live.signal(number)
            assert live.wait() == 0
        assert [line for line in live.stderr() if not line.startswith('[INFO]')] == []


def test_live_port_in_use_exits_with_one_line(tmp_path: Path) -> None:
    with socket.socket() as other, processes(tmp_path) as started:
        other.bind(('127.0.0.1', 0))
        other.listen()
        port = other.getsockname()[1]
        live = started.start('live', '--ros-args', '-p', f'port:={port}')
        assert live.wait() == 2
        assert len(live.stderr()) == 1
        assert str(port) in live.stderr()[0]


@pytest.mark.slow
def test_live_without_foxglove_sdk_names_remedy(tmp_path: Path) -> None:
    (tmp_path / 'foxglove.py').write_text("raise ImportError('not here')", encoding='utf-8')
    with processes(tmp_path) as started:
        environment = {
            **child_environment(),
            **domain_variables(started.domain),
            'PYTHONPATH': os.pathsep.join([str(tmp_path), child_environment()['PYTHONPATH']]),
        }
        result = subprocess.run(
            [sys.executable, '-m', 'masmc_ros.cli.main', 'run', 'live'],
            env=environment,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )
    assert result.returncode == 2
    assert result.stderr.count('\n') == 1
    assert 'pip install foxglove-sdk' in result.stderr
