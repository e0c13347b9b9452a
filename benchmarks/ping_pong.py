# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Ping-pong of JointState and Float64MultiArray between two nodes: limit of the transport."""

from __future__ import annotations

import argparse
import signal
import subprocess
import sys
import time
from typing import Any, NamedTuple

from masmc_ros.nodes.middleware.rcl_setup import prepare_transport
import rclpy
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

_QOS = QoSProfile(depth=1)


class Sizes(NamedTuple):
    """Message sizes of a robot."""

    joints: tuple[str, ...] = (
        'base_x_joint',
        'base_y_joint',
        'base_yaw_joint',
        'wheel_right_joint',
        'wheel_left_joint',
        'arm_joint_1',
        'arm_joint_2',
    )
    """Names in the state; the last ones are those of the driven joints."""
    driven: int = 4


PAPER = Sizes()


def _state(sizes: Sizes) -> Any:
    zeros = [0.0] * len(sizes.joints)
    return JointState(
        name=list(sizes.joints), position=zeros, velocity=zeros, effort=zeros
    )


def _command(sizes: Sizes) -> Any:
    count = sizes.driven
    command = Float64MultiArray(data=[0.0] * count)
    dimension = MultiArrayDimension(label='effort@1.000000000', size=count, stride=count)
    command.layout.dim = [dimension]
    return command


class Pong:
    """Node that responds to every state with a command."""

    def __init__(self, context: rclpy.Context, sizes: Sizes, *, raw: bool) -> None:
        """Initialise the node."""
        self.node = rclpy.create_node('pong', context=context)
        self._sizes = sizes
        self._response = serialize_message(_command(sizes)) if raw else None
        self._publisher = self.node.create_publisher(Float64MultiArray, 'pong', _QOS)
        self.node.create_subscription(JointState, 'ping', self._reply, _QOS, raw=raw)

    def _reply(self, state: Any) -> None:
        self._publisher.publish(self._response or self._command_like(state))

    def _command_like(self, state: Any) -> Any:
        command = _command(self._sizes)
        command.data = state.position[:self._sizes.driven]
        return command


class Ping:
    """Node that sends the next state after every command."""

    def __init__(self, context: rclpy.Context, sizes: Sizes, *, raw: bool) -> None:
        """Initialise the node."""
        self.count = 0
        self.node = rclpy.create_node('ping', context=context)
        self._sizes = sizes
        self._raw = serialize_message(_state(sizes)) if raw else None
        self.publisher = self.node.create_publisher(JointState, 'ping', _QOS)
        self.node.create_subscription(Float64MultiArray, 'pong', self._next, _QOS, raw=raw)

    def send(self) -> None:
        """Publish a state."""
        self.publisher.publish(self._raw or _state(self._sizes))

    def _next(self, _: Any) -> None:
        self.count += 1
        self.send()


def round_trips_per_second(
    *, raw: bool, composed: bool, seconds: float = 3.0, sizes: Sizes = PAPER
) -> float:
    """Return the round trips per second, with both nodes in this process or in two processes."""
    prepare_transport()
    context = rclpy.Context()
    rclpy.init(context=context)
    executor = EventsExecutor(context=context)
    ping = Ping(context, sizes, raw=raw)
    executor.add_node(ping.node)
    peer = None
    if composed:
        pong = Pong(context, sizes, raw=raw)
        executor.add_node(pong.node)
    else:
        command = [sys.executable, '-m', 'benchmarks.ping_pong', '--pong', str(sizes.driven)]
        peer = subprocess.Popen([*command, '--raw'] if raw else command)
    try:
        limit = time.monotonic() + 20.0
        while ping.publisher.get_subscription_count() == 0 and time.monotonic() < limit:
            executor.spin_once(timeout_sec=0.05)
        while ping.count == 0 and time.monotonic() < limit:
            ping.send()
            executor.spin_once(timeout_sec=0.2)
        start, first = time.monotonic(), ping.count
        while time.monotonic() - start < seconds:
            executor.spin_once(timeout_sec=0.1)
        return (ping.count - first) / (time.monotonic() - start)
    finally:
        if peer is not None:
            peer.terminate()
            peer.wait(10.0)
        context.try_shutdown()


def _serve(sizes: Sizes, *, raw: bool) -> None:
    """Respond to states until SIGTERM."""
    stopped: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: stopped.append(number))
    prepare_transport()
    context = rclpy.Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    executor = EventsExecutor(context=context)
    executor.add_node(Pong(context, sizes, raw=raw).node)
    while not stopped:
        executor.spin_once(timeout_sec=0.1)
    context.try_shutdown()


if __name__ == '__main__':
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--pong', type=int, metavar='DRIVEN')
    parser.add_argument('--raw', action='store_true')
    arguments = parser.parse_args()
    if arguments.pong:
        _serve(Sizes(driven=arguments.pong), raw=arguments.raw)
    else:
        for raw in (False, True):
            for composed in (False, True):
                rate = round_trips_per_second(raw=raw, composed=composed)
                print(f'raw {raw} composed {composed}: {rate:.0f} /s')
