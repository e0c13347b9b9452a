# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Message exchange of nodes of one process, with each other and with other processes."""

from __future__ import annotations

from pathlib import Path
import signal

from diagnostic_msgs.msg import DiagnosticArray
from helpers.log_contents import read_log
from helpers.processes import PAPER, peer, processes, ros_arguments
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.nodes.middleware.ros_topics import DEEP
import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, Trigger

STEPS = 20

TOPICS = {
    'joint_states': JointState,
    'effort_commands': Float64MultiArray,
    'controller/tracking_error': Float64MultiArray,
}


@pytest.mark.slow
@pytest.mark.parametrize('transport', [None, 'UDPv4'])
def test_composed_nodes_run_no_message_lost(
    transport: str | None, tmp_path: Path
) -> None:
    """A subscription of another process and the recorder get the same messages."""
    log = tmp_path / 'run.mcap'
    arguments = ros_arguments(
        PAPER,
        duration=0.5,
        plant__wait_for='[controller, trajectory, recorder, listener]',
        recorder__output=log,
    )
    environment = {'FASTDDS_BUILTIN_TRANSPORTS': transport} if transport else None
    with processes(tmp_path) as started, peer(started.domain) as tester:
        received = {
            topic: tester.collect(kind, topic, raw=True, past=topic != 'controller/tracking_error')
            for topic, kind in TOPICS.items()
        }
        started.start('composed', '--record', *arguments, environment=environment)
        for topic in TOPICS:
            tester.until(
                lambda topic=topic: tester.node.count_publishers(topic), f'a sender of {topic}'
            )
        # The plant waits for a node of this name; it indicates that all subscriptions exist.
        listener = Node('listener', context=tester.node.context)
        tester.until(lambda: all(len(rows) > 500 for rows in received.values()), 'the last tick')
        assert started.wait() == {'composed': 0}, started.output()
        listener.destroy_node()
    recorded = read_log(log).messages
    for topic, messages in received.items():
        assert messages == recorded[topic], topic
    assert {len(messages) for messages in received.values()} == {501}
    # rcl itself publishes log messages; the recorder gets each of them once.
    assert len([raw for raw in recorded['rosout'] if b'ticks/s' in raw]) == 1


def test_composed_nodes_messages_of_other_process_received(tmp_path: Path) -> None:
    log = tmp_path / 'run.mcap'
    arguments = ros_arguments(PAPER, duration=0.0, recorder__output=log)
    with processes(tmp_path) as started, peer(started.domain) as tester:
        run = started.start('composed', '--record', *arguments)
        commands = tester.publisher(Float64MultiArray, 'effort_commands')
        # The plant and the recorder.
        tester.wait_for_subscribers(commands, 2)
        wrong = EffortCdr()
        wrong.data[1] = float('inf')
        commands.publish(wrong.to_bytes())
        tester.until(lambda: run.logged('ERROR', 'effort_commands rejected'), 'a rejection')
        gain = Parameter('observer_gain', Parameter.Type.DOUBLE, 0.25).to_parameter_msg()
        request = SetParameters.Request(parameters=[gain])
        tester.call(SetParameters, 'controller/set_parameters', request, again=False)
        started.signal(signal.SIGINT)
        assert started.wait() == {'composed': 0}, started.output()
    recorded = read_log(log).messages
    assert wrong.to_bytes() in recorded['effort_commands']
    # Messages that rclpy publishes itself reach the recorder of this process once.
    assert len([raw for raw in recorded['parameter_events'] if b'observer_gain' in raw]) == 1


def is_of_plant(report: DiagnosticArray) -> bool:
    """Return True if a report is the plant's."""
    return any(status.name == '/plant' for status in report.status)


@pytest.mark.parametrize('past', [True, False])
def test_composed_nodes_past_sent_only_on_request(past: bool, tmp_path: Path) -> None:
    arguments = ros_arguments(PAPER, duration=0.0)
    with processes(tmp_path) as started, peer(started.domain) as tester:
        times = tester.watch_time()
        reports = tester.collect(DiagnosticArray, '/diagnostics', past=False)
        started.start('composed', *arguments)
        tester.until(lambda: times[-1] > 3 * 10**9, 'more messages than the publisher keeps')
        paused = tester.call(SetBool, '/plant/pause', SetBool.Request(data=True))
        reports.clear()
        pause_tick = round(float(paused.message.split()[-2]) * 1000)
        tester.until(lambda: sum(map(is_of_plant, reports)) > 2, 'reports of standstill')
        received = tester.collect(JointState, 'joint_states', raw=True, past=past)
        tester.until(lambda: tester.node.count_publishers('joint_states'), 'the plant')
        if past:
            tester.until(lambda: len(received) >= DEEP, 'the past')
        for _ in range(STEPS):
            assert tester.call(Trigger, '/plant/step', Trigger.Request(), again=False).success
        tester.until(
            lambda: received and header_stamp(received[-1]) == (pause_tick + STEPS) * 10**6,
            'the last state',
        )
        started.signal(signal.SIGINT)
        assert started.wait() == {'composed': 0}, started.output()
    ticks = [header_stamp(raw) // 10**6 for raw in received]
    # The subscription receives each message once, in the order of sending.
    assert ticks == list(range(ticks[0], pause_tick + STEPS + 1))
    assert len(ticks) == DEEP + STEPS if past else len(ticks) <= STEPS
