# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""States whose pose comes from odometry and a localisation: the age of each transform."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import time

from helpers.core_loop import node_values
from helpers.processes import Peer, peer, processes
from masmc_ros.messages.transforms import TransformsCdr
from masmc_ros.nodes.controller import inputs
from masmc_ros.nodes.controller.inputs import StateInput
from masmc_ros.nodes.middleware.ros_topics import raw_class
from masmc_ros.nodes.process.base import RejectedMessages
from masmc_ros.robot.mechanisms import driven_joint_names
from masmc_ros.robot.robot import robot_of
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

OLDEST = 0.05


def transform_to(child: str) -> bytes:
    """Return the message of a transform from `map` to a frame."""
    message = TransformsCdr('', (('map', child),))
    return bytes(message.fill(0, np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])))


class Input:
    """Input of states whose messages come from the test, without publishers."""

    def __init__(
        self, states: StateInput, received: list[int], names: list[str], tester: Peer
    ) -> None:
        self.tester = tester
        self.states, self._received, self._names = states, received, names
        self._stamp = 0

    def localise(self, child: str, *, is_static: bool = False) -> None:
        """Send the transform from `map` to a frame."""
        self.states._take_transforms(transform_to(child), expires=not is_static)

    def accepts_state(self) -> bool:
        """Send odometry and a state; return True if the state is complete."""
        self._stamp += 10_000_000
        odometry = Odometry()
        odometry.header.frame_id = 'odom'
        odometry.pose.pose.orientation.w = 1.0
        still = [0.0] * len(self._names)
        state = JointState(name=self._names, position=still, velocity=still)
        for message in (odometry, state):
            message.header.stamp.nanosec = self._stamp
        before = len(self._received)
        self.states._take_odometry(serialize_message(odometry))
        self.states._take(serialize_message(state))
        return len(self._received) > before


@pytest.fixture
def source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Input]:
    monkeypatch.setattr(inputs, '_OLDEST_TRANSFORM', OLDEST)
    values = node_values(controller={'pose_source': 'odom', 'pose_frame': 'map'})['controller']
    received: list[int] = []
    with processes(tmp_path) as started, peer(started.domain) as tester:
        states = StateInput(
            tester.node,
            values,
            robot_of(values),
            RejectedMessages(tester.node.get_logger()),
            lambda stamp, position, velocity: received.append(stamp),
            lambda: None,
            lambda senders: False,
        )
        yield Input(states, received, list(driven_joint_names(values)), tester)


def test_static_transform_does_not_expire_by_another(source: Input) -> None:
    source.localise('odom', is_static=True)
    assert source.accepts_state()
    source.localise('other')
    time.sleep(2.0 * OLDEST)
    assert source.accepts_state()


def test_old_transform_is_missing_while_another_continues(source: Input) -> None:
    source.localise('odom')
    assert source.accepts_state()
    time.sleep(2.0 * OLDEST)
    source.localise('other')
    assert not source.accepts_state()
    assert source.states.missing == '/tf (map to odom)'
    source.localise('odom')
    assert source.accepts_state()


@pytest.mark.parametrize('reliability', ['BEST_EFFORT', 'RELIABLE'])
def test_transform_of_either_reliability_received(source: Input, reliability: str) -> None:
    profile = QoSProfile(depth=10, reliability=ReliabilityPolicy[reliability])
    kind = raw_class('tf2_msgs/msg/TFMessage')
    sender = source.tester.node.create_publisher(kind, '/tf', profile)

    def is_localised() -> bool:
        sender.publish(transform_to('odom'))
        return source.accepts_state()

    assert not source.accepts_state()
    source.tester.until(is_localised, 'a transform')
