# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
A controller in another process as a contender of a comparison, on the topics of the suite.

The process receives each state and its reference, as from plant and trajectory in lock-step, and
answers with torques. The simulated robot waits for the answer. docs/guides/benchmark.md describes
the topics.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import math
import sys
import time

from masmc_ros.aliases import Array
from masmc_ros.compare.contenders import Controller, MistakeOfControllerError, OPTION, TOPICS
from masmc_ros.errors import InputError
from masmc_ros.law.plug_in import TickInput
from masmc_ros.messages.cdr_layout import NANOSECONDS
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.messages.topics import COMMAND_TOPIC, REFERENCE_TOPIC, STATE_TOPIC
from masmc_ros.nodes.middleware.rcl_setup import client_node
from masmc_ros.nodes.middleware.ros_topics import publisher_qos, subscribe
from masmc_ros.nodes.plant.command_input import torque_sources
from masmc_ros.params.declaration import Values
from masmc_ros.robot.mechanisms import driven_joint_names, joint_names
import numpy as np
from rclpy.executors import Executor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

DISCOVERY = 60.0
"""Time in s within which the process must be discovered."""

PATIENCE = 10.0
"""Time in s within which it must answer a state."""

_SILENT = 1.0
"""Time in s of waiting for the process after which a line says so, or the start is repeated."""


class _Topics:
    """Publishers of states and references, and the subscription to torques."""

    def __init__(self, name: str, robot: Values, node: Node, executor: Executor) -> None:
        """Initialise the topics of a robot, given by checked parameters of the plant."""
        self._name, self._node, self._executor = name, node, executor
        self._stamp = 0
        self._answer: Array | None = None
        self._error = ''
        driven = driven_joint_names(robot)
        self._state = JointStateCdr(joint_names(robot))
        self._driven = slice(-len(driven), None)
        (self._source,) = torque_sources(driven)
        qos = publisher_qos(1)
        self._states = node.create_publisher(JointState, STATE_TOPIC, qos)
        self._references = node.create_publisher(Float64MultiArray, REFERENCE_TOPIC, qos)
        subscribe(node, Float64MultiArray, COMMAND_TOPIC, self._on_command, depth=10)

    def connect(self) -> None:
        """Wait until the process is discovered; MistakeOfControllerError after DISCOVERY."""
        topic = self._node.resolve_topic_name(COMMAND_TOPIC)
        start, is_said = time.monotonic(), False
        while not (self._states.get_subscription_count() and self._node.count_publishers(topic)):
            waited = time.monotonic() - start
            if waited > DISCOVERY:
                raise self._mistake(
                    f'no node answers {STATE_TOPIC} with {COMMAND_TOPIC}: none was discovered '
                    f'within {DISCOVERY:g} s (ROS_DOMAIN_ID '
                    f'{self._node.context.get_domain_id()})'
                )
            if waited > _SILENT and not is_said:
                is_said = True
                text = f'waiting for a node that answers {STATE_TOPIC} with {COMMAND_TOPIC}'
                print(f'{OPTION} {TOPICS}{self._name}: {text}', file=sys.stderr)
            self._executor.spin_once(timeout_sec=0.1)

    def torque(self, stamp_ns: int, tick: TickInput, reference: Array) -> Array:
        """
        Send a state with its reference and return the answer (joints) in N·m.

        Raises MistakeOfControllerError if there is none within PATIENCE, or a wrong one.
        """
        self._stamp, self._answer = stamp_ns, None
        window = ReferenceWindow(stamp_ns, tick.period, np.asarray(reference)[None])
        self._references.publish(window.to_bytes())
        self._state.position[:], self._state.velocity[:] = tick.position, tick.velocity
        self._state.effort[self._driven] = tick.commanded
        self._state.set_stamp(stamp_ns)
        sent = time.monotonic()
        limit, again = sent + PATIENCE, sent
        while self._answer is None:
            now = time.monotonic()
            if self._error:
                raise self._mistake(self._error)
            if now > limit:
                raise self._mistake(
                    f'no answer on {COMMAND_TOPIC} to the state of {stamp_ns / NANOSECONDS:g} s '
                    f'within {PATIENCE:g} s'
                )
            if now >= again:
                self._states.publish(self._state.to_bytes())
                # A node may answer before its publisher has discovered this process. The state
                # of the time 0 starts a run, so a second one does no harm.
                again = now + _SILENT if stamp_ns == 0 else math.inf
            self._executor.spin_once(timeout_sec=0.1)
        return self._answer

    def _mistake(self, text: str) -> MistakeOfControllerError:
        return MistakeOfControllerError(f'{OPTION} {TOPICS}{self._name}: {text}')

    def _on_command(self, raw: bytes) -> None:
        try:
            numbers, stamp = self._source.read(raw)
        except InputError as error:
            self._error = str(error)
            return
        # An answer without a label is one to the last state.
        if stamp not in (None, self._stamp) or self._answer is not None:
            return
        if numbers is None and self._stamp == 0:
            self._error = (
                'it answers the first state without a torque; expected an active controller'
            )
            return
        self._answer = np.zeros_like(self._state.effort[self._driven])
        if numbers is not None:
            self._answer[:] = numbers


@contextmanager
def topic_controller(name: str, robot: Values) -> Iterator[Controller]:
    """
    Yield a controller on the topics of this process's ROS domain, discovered at its first run.

    Parameters
    ----------
    name
        Name of its row.
    robot
        Checked parameters of the plant.

    """
    with client_node('compare') as (node, executor):
        topics = _Topics(name, robot, node, executor)

        class OnTopics:
            """Controller in another process, on ROS topics."""

            def __init__(self) -> None:
                """Start a run; its first state has the stamp 0."""
                self._ticks = 0
                topics.connect()

            def __call__(self, state: TickInput, reference: Array) -> Array:
                """Return the answer of the process to a state and its reference."""
                stamp = round(self._ticks * state.period * NANOSECONDS)
                self._ticks += 1
                return topics.torque(stamp, state, reference)

        yield OnTopics
