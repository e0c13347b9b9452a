# SPDX-License-Identifier: Apache-2.0
"""Faults brought into a run of real nodes: it goes on, and never applies a wild torque."""

from __future__ import annotations

from collections.abc import Callable
import math
from pathlib import Path
import signal
from typing import Any

import pytest

pytest.importorskip('rclpy')

from builtin_interfaces.msg import Time
from live_run import live_run, LiveRun
from log_contents import read_log
from nav_msgs.msg import Odometry
import numpy as np
from processes import NODES
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

from masmc_ros.log.cdr import EffortCdr, JointStateCdr, OdometryCdr, ReferenceWindow
from masmc_ros.log.names import JOINTS

GARBAGE = b'\x00\x01\x00\x00\xff\xff\xff\x7f\x01'


def joint_state(stamp: int, *, joint: str = '', **fields: Any) -> JointState:
    """Return a state at rest, with another name for the last joint if one is given."""
    message = JointState(name=[*JOINTS[:6], joint or JOINTS[6]])
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
    message.position = message.velocity = [0.0] * 7
    for name, value in fields.items():
        setattr(message, name, value)
    return message


def ours_with(number: float, stamp: int) -> bytes:
    """Return a state in the controller's own layout with one number that is not right."""
    state = JointStateCdr()
    state.velocity[5] = number
    state.set_stamp(stamp)
    return state.to_bytes()


def refused(run: LiveRun, node: str, publisher: Any, topic: str, bad: Callable[[], Any]) -> None:
    """Send something bad again and again until the node counts it as refused."""
    before = int(run.health.get(node, {}).get(f'{topic} refused', '0'))

    def is_counted() -> bool:
        publisher.publish(bad())
        run.spin(0.01)
        return int(run.health.get(node, {}).get(f'{topic} refused', '0')) > before

    run.tester.until(is_counted, f'{topic} refused by {node}: {run.health}')
    assert run.wrong == []


def test_bad_messages_on_every_input(tmp_path: Path) -> None:
    with live_run(tmp_path) as run:
        states = run.tester.publisher(JointState, 'joint_states')
        references = run.tester.publisher(Float64MultiArray, 'reference')
        commands = run.tester.publisher(Float64MultiArray, 'effort_commands')
        odometry = run.tester.publisher(Odometry, 'odom')
        progress = run.tester.publisher(Time, 'recorder/progress')
        records = run.tester.publisher(String, 'plant/parameters')
        run.goes_on()

        def soon() -> int:
            return run.stamp + 2_000_000

        for bad in (
            lambda: ours_with(math.nan, soon()),
            lambda: ours_with(math.inf, soon()),
            lambda: joint_state(soon(), position=[0.0] * 6),
            lambda: joint_state(soon(), velocity=[]),
            lambda: joint_state(soon(), joint='arm_joint_3'),
            lambda: joint_state(soon(), joint='arm_joint_1'),
            lambda: GARBAGE,
        ):
            refused(run, 'controller', states, 'joint_states', bad)
        for wrong in (
            Float64MultiArray(data=[0.0] * 5),
            Float64MultiArray(data=[math.nan] * 4),
            ReferenceWindow(0, 0.0, np.zeros((2, 3, 4))).to_bytes(),
            GARBAGE,
        ):
            refused(run, 'controller', references, 'reference', lambda wrong=wrong: wrong)
        command = EffortCdr()
        command.data[2] = math.nan
        for wrong in (
            Float64MultiArray(data=[0.0] * 3),
            Float64MultiArray(data=[0.0, 0.0, math.inf, 0.0]),
            GARBAGE,
        ):
            refused(run, 'plant', commands, 'effort_commands', lambda wrong=wrong: wrong)
        refused(run, 'controller', records, 'plant/parameters', lambda: String(data='{"a": 1}'))
        for publisher in (odometry, progress, records):
            publisher.publish(GARBAGE)
        run.goes_on()
        run.end()
    assert read_log(run.log).summary.statistics is not None


def test_states_in_any_order_and_clocks_that_jump(tmp_path: Path) -> None:
    """A second sender of states, in another order of joints, whose stamps are out of order."""
    with live_run(tmp_path) as run:
        states = run.tester.publisher(JointState, 'joint_states')
        odometry = run.tester.publisher(Odometry, 'odom')
        run.goes_on()
        latest = JointStateCdr()

        def note(raw: bytes) -> None:
            latest.load(raw)

        run.tester.subscribe(JointState, 'joint_states', note, raw=True)
        run.tester.until(lambda: latest.stamp_ns > 0, 'a state')
        order = [6, 3, 0, 5, 1, 4, 2]

        def send(shift: int) -> None:
            """Send the present state, in another order and with another stamp."""
            message = joint_state(
                max(0, latest.stamp_ns + shift),
                name=[JOINTS[i] for i in order],
                position=latest.position[order].tolist(),
                velocity=latest.velocity[order].tolist(),
            )
            states.publish(message)

        def counted(key: str, shift: int) -> None:
            before = int(run.health['controller'][key])

            def has_counted() -> bool:
                send(shift)
                run.spin(0.02)
                return int(run.health['controller'][key]) > before

            run.tester.until(has_counted, f'{key}: {run.health}')

        run.reports('controller', 'state', 'active')
        counted('late states', -50_000_000)  # late, again and again
        counted('gaps in states', 3_600 * 10**9)  # a clock an hour ahead, and back
        for shift in (-(10**12), 10**12, 0):
            send(shift)
            run.spin(0.05)
        far = OdometryCdr()
        far.set_stamp(10**15)
        odometry.publish(far.to_bytes())
        run.goes_on()
        run.end()
    assert read_log(run.log).summary.statistics is not None


def test_nodes_that_hang_or_are_killed_in_a_run(tmp_path: Path) -> None:
    logs = []
    with live_run(tmp_path, reference_timeout=0.5) as run:
        run.goes_on()
        for name in NODES:
            run.nodes[name].signal(signal.SIGSTOP)
            run.spin(0.5)
            run.nodes[name].signal(signal.SIGCONT)
            run.goes_on()
            kill_and_restart(run, name)
            run.goes_on()
            logs.append(run.log)
        run.end()
    contents = read_log(run.log)
    assert contents.summary.statistics is not None
    assert contents.stamps('joint_states')
    # Of what a killed recorder has written, all but the last moments can be read.
    assert logs[0] != run.log
    assert logs[0].stat().st_size > 10_000


def kill_and_restart(run: LiveRun, name: str) -> None:
    """Kill a node, wait until that shows, start it again and wait until it takes part."""
    answered = run.tester.collect(Time, 'recorder/progress', past=False)
    run.nodes[name].signal(signal.SIGKILL)
    run.nodes[name].wait()
    if name == 'trajectory':
        run.is_told('no reference')
    if name == 'controller':
        run.tester.until(lambda: not run.torque.any(), 'no torque')
    if name == 'plant':
        run.is_told('joint_states')
    activations, killed = run.told.count('active'), run.stamp
    run.start(name)
    if name == 'recorder':
        run.tester.until(
            lambda: any(t.sec * 10**9 + t.nanosec > killed for t in answered), 'a recorder'
        )
    else:
        run.tester.until(lambda: run.told.count('active') > activations, f'a new {name}')
