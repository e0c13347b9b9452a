# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Late-joining subscribers get the latest messages; early subscribers miss nothing."""

from __future__ import annotations

from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from helpers.processes import (
    child_environment,
    domain_variables,
    PAPER,
    Peer,
    peer,
    processes,
    ros_arguments,
)
from masmc_ros.messages.message import text_of
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.messages.topics import JOINTS, TELEMETRY, telemetry_topic
from masmc_ros.nodes.middleware.ros_topics import Latched, publisher_qos
from nav_msgs.msg import Path as PathMessage
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool

LATCHED: dict[str, Any] = {
    'controller/state': String,
    'controller/parameters': String,
    'plant/parameters': String,
    'trajectory/parameters': String,
    'robot_description': String,
    'path/desired': PathMessage,
    'path/actual': PathMessage,
}


def spin(tester: Peer, seconds: float) -> None:
    end = time.monotonic() + seconds
    tester.until(lambda: time.monotonic() > end)


def test_late_joining_subscriber_gets_only_latest_messages(tmp_path: Path) -> None:
    with processes(tmp_path) as started:
        with peer(started.domain) as tester:
            stamps = tester.watch_time()
            settings = {'plant__wait_for': '[controller, trajectory, peer]'}
            started.start('composed', *ros_arguments(PAPER, duration=0.0, **settings))
            early = {
                topic: tester.collect(kind, topic, raw=True) for topic, kind in LATCHED.items()
            }
            early['/clock'] = tester.collect(Clock, '/clock', raw=True, past=False)
            for on in (False, True, False, True):
                answer = tester.call(SetBool, '/controller/enable', SetBool.Request(data=on))
                assert answer.success
            tester.until(lambda: stamps[-1] >= 1_200_000_000, '1.2 s')
            paused = tester.call(SetBool, '/plant/pause', SetBool.Request(data=True))
            assert paused.success
            spin(tester, 1.0)
            # The early subscriber has missed nothing.
            states = [text_of(raw) for raw in early['controller/state']]
            assert states[-4:] == ['inactive: disabled', 'active', 'inactive: disabled', 'active']
            times = [header_stamp(raw) for raw in early['/clock']]
            assert times == [10_000_000 * k for k in range(len(times))]
            # The clock does not wait for acknowledgements.
            assert times[-1] > stamps[-1] - 10_000_000
            with peer(started.domain, 'late') as late:
                received = {
                    topic: late.collect(kind, topic, raw=True) for topic, kind in LATCHED.items()
                }
                health = late.collect(DiagnosticArray, '/diagnostics')
                late.until(
                    lambda: all(received.values()) and health, f'the latest messages: {received}'
                )
                spin(late, 1.0)
                for topic, messages in received.items():
                    assert messages == early[topic][-1:], topic
                offered = {
                    info.qos_profile.durability
                    for label in TELEMETRY
                    for info in late.node.get_publishers_info_by_topic(
                        f'/{telemetry_topic(label)}'
                    )
                }
                assert offered == {DurabilityPolicy.VOLATILE}
                past = late.collect(Float64MultiArray, telemetry_topic('raw_torque'), past=False)
                spin(late, 1.0)
                assert past == []
        started.signal(signal.SIGINT)
        assert started.wait() == {'composed': 0}, started.output()


def test_latched_publisher_burst_no_message_lost(tmp_path: Path) -> None:
    sent = [str(number) for number in range(50)]
    with (
        processes(tmp_path) as started,
        peer(started.domain) as tester,
        peer(started.domain, 'listener') as listener,
    ):
        publisher = tester.node.create_publisher(String, 'texts', publisher_qos(1))
        messages = listener.collect(String, 'texts')
        tester.wait_for_subscribers(publisher)
        latched = Latched(publisher)
        for text in sent:
            latched.publish(String(data=text))

        def all_received() -> bool:
            latched.send_waiting()
            return len(messages) >= len(sent)

        listener.until(all_received, 'every message')
        assert [message.data for message in messages] == sent
        late = listener.collect(String, 'texts')
        listener.until(lambda: late, 'the last message')
        spin(listener, 0.5)
        assert [message.data for message in late] == sent[-1:]


_HUNG = """
import rclpy, sys, time
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node('hung')
qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
node.create_subscription(String, 'texts', lambda message: None, qos)
time.sleep(600)
"""


def test_latched_publisher_stopped_subscriber_delays_once(tmp_path: Path) -> None:
    with (
        processes(tmp_path) as started,
        peer(started.domain) as tester,
        peer(started.domain, 'listener') as listener,
    ):
        publisher = tester.node.create_publisher(String, 'texts', publisher_qos(1))
        latched = Latched(publisher)
        messages = listener.collect(String, 'texts')
        hung = subprocess.Popen(
            [sys.executable, '-c', _HUNG],
            env={**child_environment(), **domain_variables(started.domain)},
        )
        try:
            tester.wait_for_subscribers(publisher, 2)
            hung.send_signal(signal.SIGSTOP)
            start = time.monotonic()
            for number in range(30):
                latched.publish(String(data=str(number)))

            def all_received() -> bool:
                latched.send_waiting()
                return bool(messages) and messages[-1].data == '29'

            listener.until(all_received, 'the last message')
            assert time.monotonic() - start < 60.0
        finally:
            hung.kill()
            hung.wait()


def test_controller_best_effort_states_answered(tmp_path: Path) -> None:
    """A driver may publish with the profile of sensor data; each state is answered once."""
    profile = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    with processes(tmp_path) as started, peer(started.domain) as tester:
        answers = tester.collect(Float64MultiArray, 'effort_commands', raw=True)
        references = tester.publisher(Float64MultiArray, 'reference', latched=True)
        references.publish(Float64MultiArray(data=[0.3, 0.5, 0.0, 0.1]))
        started.start('controller', *ros_arguments(PAPER, pacing='realtime', duration=0.0))
        for durability in (DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL):
            profile.durability = durability
            states = tester.node.create_publisher(JointState, 'joint_states', profile)
            message = JointState(name=JOINTS, position=[0.1] * 7, velocity=[0.0] * 7)
            before = len(answers)

            def is_answered(
                message: JointState = message, states: Any = states, before: int = before
            ) -> bool:
                message.header.stamp = tester.node.get_clock().now().to_msg()
                states.publish(message)
                return len(answers) > before + 10

            tester.until(is_answered, 'ten answers')
            tester.node.destroy_publisher(states)
        assert len(answers) == len(set(answers))


def test_controller_without_states_diagnostics_warn(tmp_path: Path) -> None:
    """In lock-step no timeout ends the law; the report must not be that all is well."""
    with processes(tmp_path) as started, peer(started.domain) as tester:
        reports: list[tuple[str, str]] = []

        def on_report(message: DiagnosticArray) -> None:
            (status,) = message.status
            silence = next(v.value for v in status.values if v.key == 'last state (s ago)')
            reports.append((status.message, silence))

        tester.subscribe(DiagnosticArray, '/diagnostics', on_report)
        started.start('controller', *ros_arguments(PAPER, duration=0.0))
        tester.until(lambda: ('no usable joint_states so far', 'none') in reports, 'a warning')
        states = tester.publisher(JointState, 'joint_states')
        message = JointState(name=JOINTS, position=[0.1] * 7, velocity=[0.0] * 7)
        message.header.stamp.nanosec = 1_000_000

        tester.wait_for_subscribers(states)
        states.publish(message)
        tester.until(
            lambda: reports[-1][0].startswith('no usable joint_states for'), 'the duration'
        )
