# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Faults injected into a run of nodes: the run continues, and torques stay within limits."""

from __future__ import annotations

from collections.abc import Callable
import itertools
import math
from pathlib import Path
import signal
from typing import Any

from builtin_interfaces.msg import Time
from helpers.checked_log import check_log
from helpers.live_run import live_run, LiveRun
from helpers.processes import NODES
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.platform_messages import OdometryCdr
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.messages.topics import JOINTS
from nav_msgs.msg import Odometry
import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout, String
from std_srvs.srv import SetBool

GARBAGE = b'\x00\x01\x00\x00\xff\xff\xff\x7f'
"""Message that is shorter than its length field states."""


def joint_state(stamp: int, *, joint: str = '', **fields: Any) -> JointState:
    """Return a state at rest, optionally with another name of the last joint."""
    message = JointState(name=[*JOINTS[:6], joint or JOINTS[6]])
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
    message.position = message.velocity = [0.0] * 7
    for name, value in fields.items():
        setattr(message, name, value)
    return message


def ours_with(stamp: int, **numbers: float) -> bytes:
    """Return a state in the controller's own layout with invalid numbers."""
    state = JointStateCdr()
    for field, number in numbers.items():
        getattr(state, field)[5] = number
    state.set_stamp(stamp)
    return state.to_bytes()


def odometry(stamp: int, x: float = 0.0, turn: float = 0.0, w: float = 1.0) -> Odometry:
    message = Odometry()
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
    message.pose.pose.position.x = x
    message.pose.pose.orientation.w = w
    message.twist.twist.angular.z = turn
    return message


def command(torque: float) -> bytes:
    message = EffortCdr()
    message.data[2] = torque
    return message.to_bytes()


def window(period: float, number: float = 0.0) -> bytes:
    return ReferenceWindow(0, period, np.full((2, 3, 4), number)).to_bytes()


def labelled(label: str) -> Float64MultiArray:
    layout = MultiArrayLayout(dim=[MultiArrayDimension(label=label, size=4, stride=4)])
    return Float64MultiArray(layout=layout, data=[0.0] * 4)


Input = tuple[str, str, type]
"""Node, topic that it subscribes to, and type of the topic."""

Bad = tuple[Callable[[int], Any], str]
"""Function from a stamp in ns to an invalid message, and part of the reason for its rejection."""

BAD: dict[Input, list[Bad]] = {
    ('controller', 'joint_states', JointState): [
        (lambda t: ours_with(t, velocity=math.nan), "velocity of 'arm_joint_1' is not a finite"),
        (lambda t: ours_with(t, position=math.inf), "position of 'arm_joint_1' is not a finite"),
        (lambda t: joint_state(t, position=[0.0] * 6), 'position has 6 numbers for 7 joints'),
        (lambda t: joint_state(t, velocity=[0.0] * 8), 'velocity has 8 numbers for 7 joints'),
        (lambda t: joint_state(t, joint='arm_joint_3'), "'arm_joint_2' is missing"),
        (lambda t: joint_state(t, joint='arm_joint_1'), "'arm_joint_1' appears 2 times"),
        (lambda t: joint_state(-(10**9)), 'stamp -1000000000 ns is negative'),
        (lambda t: GARBAGE, '8 bytes that are no JointState'),
        (lambda t: ours_with(t)[:-40], 'bytes that are no JointState'),
    ],
    ('controller', 'odom', Odometry): [
        (lambda t: odometry(t, x=math.nan), 'a number of the pose or of the twist is not finite'),
        (lambda t: odometry(t, turn=-math.inf), 'a number of the pose or of the twist is not'),
        (lambda t: odometry(t, w=0.0), 'has not length 1'),
        (lambda t: GARBAGE, '8 bytes that are no Odometry'),
    ],
    ('controller', 'reference', Float64MultiArray): [
        (lambda t: Float64MultiArray(data=[math.nan] * 4), 'is not finite'),
        (lambda t: Float64MultiArray(data=[-math.inf] * 12), 'is not finite'),
        (lambda t: Float64MultiArray(data=[0.0] * 5), 'a set-point of 5 numbers'),
        (lambda t: Float64MultiArray(data=[0.0] * 13), 'a set-point of 13 numbers'),
        (lambda t: window(0.0), 'sample period 0 s'),
        (lambda t: window(0.1, math.nan), 'finite'),
        (lambda t: GARBAGE, '8 bytes that are no Float64MultiArray'),
    ],
    ('controller', 'plant/parameters', String): [
        (lambda t: String(data='{"a": 1}'), 'no record of parameters'),
        (lambda t: GARBAGE, 'no record of parameters'),
    ],
    ('plant', 'effort_commands', Float64MultiArray): [
        (lambda t: command(math.nan), 'is not a finite number'),
        (lambda t: Float64MultiArray(data=[0.0, math.inf, 0.0, 0.0]), "'wheel_left_joint' is not"),
        (lambda t: Float64MultiArray(data=[0.0] * 3), '3 numbers; expected 4'),
        (lambda t: Float64MultiArray(data=[0.0] * 5), '5 numbers; expected 4'),
        (lambda t: labelled('effort@soon'), "label 'effort@soon' is not"),
        (lambda t: GARBAGE, '8 bytes that are no Float64MultiArray'),
    ],
    ('plant', 'recorder/progress', Time): [(lambda t: GARBAGE, 'recorder/progress rejected')],
    ('trajectory', 'controller/state', String): [(lambda t: GARBAGE, 'controller/state rejected')],
}
"""Invalid messages for each node and topic, sent in sequence; all topics in parallel."""


def test_nodes_invalid_message_rejected_and_run_continues(tmp_path: Path) -> None:
    """Each node rejects the message with its reason, and the run continues unchanged."""
    settings = {
        'pose_source': 'odom',
        'trajectory__start_time': -1.0,
        'plant__odom_decimation': 5,
    }
    with live_run(tmp_path, **settings) as run:
        run.injected |= {GARBAGE, command(math.nan)}
        run.wait_for_progress()
        publishers = {
            # The plant subscribes with the durability of the recorder: transient local.
            key: run.tester.publisher(key[2], key[1], latched=key[1] == 'recorder/progress')
            for key in BAD
        }
        for turn in range(max(map(len, BAD.values()))):
            check_rejected(run, publishers, {k: b[turn] for k, b in BAD.items() if turn < len(b)})
        states = publishers['controller', 'joint_states', JointState]

        for bad_state, reason in ((GARBAGE, 'no stamp'), (joint_state(-1), 'is negative')):

            def trajectory_rejects(state: Any = bad_state, part: str = reason) -> bool:
                states.publish(state)
                run.spin(0.02)
                messages = lines(run, ('trajectory', 'joint_states', JointState))
                return any(part in line for line in messages)

            run.tester.until(trajectory_rejects, f'a state rejected by the trajectory: {reason}')
        run.wait_for_progress()
        for (node, topic, _), bad in BAD.items():
            if node != 'trajectory':
                counts_at_least(run, node, f'{topic} rejected', len(bad))
        records = publishers['controller', 'plant/parameters', String]

        def recorder_complains() -> list[str]:
            # On a busy machine it subscribes to a new publisher late, because of its priority.
            records.publish(GARBAGE)
            run.spin(0.02)
            return run.nodes['recorder'].logged('ERROR', 'plant/parameters')

        # The recorder writes every message, and logs an error for those that it cannot read.
        run.tester.until(recorder_complains, 'an error of the recorder')
        run.end()


def counts_at_least(run: LiveRun, node: str, key: str, count: int) -> None:
    """Wait until a node reports a value of at least `count` for a key."""
    run.tester.until(
        lambda: int(run.health.get(node, {}).get(key, '0')) >= count, f'{count} {key} of {node}'
    )


def check_rejected(run: LiveRun, publishers: dict[Input, Any], bad: dict[Input, Bad]) -> None:
    """Send one invalid message to each input until each is rejected for its reason."""
    seen = {key: len(lines(run, key)) for key in bad}

    def is_rejected() -> bool:
        # Sending is repeated, because a node may process only the latest message.
        for key, (make, _) in bad.items():
            publishers[key].publish(make(run.stamp + 2_000_000))
        run.spin(0.02)
        return all(
            any(reason in line for line in lines(run, key)[seen[key]:])
            for key, (_, reason) in bad.items()
        )

    run.tester.until(is_rejected, f'one of {[(*key[:2], bad[key][1]) for key in bad]}')
    assert run.wrong == []


def lines(run: LiveRun, key: Input) -> list[str]:
    """Return a node's log lines about rejected messages of a topic."""
    node, topic, _ = key
    return [line for line in run.nodes[node].logged('ERROR', ' rejected: ') if topic in line]


def test_controller_foreign_states_and_clock_jumps_run_continues(tmp_path: Path) -> None:
    """A second publisher sends states with another joint order and wrong stamps."""
    with live_run(tmp_path) as run:
        states = run.tester.publisher(JointState, 'joint_states')
        odometry = run.tester.publisher(Odometry, 'odom')
        run.wait_for_progress()
        latest = JointStateCdr()

        def store(raw: bytes) -> None:
            latest.load(raw)

        run.tester.subscribe(JointState, 'joint_states', store, raw=True)
        run.tester.until(lambda: latest.stamp_ns > 0, 'a state')
        order = [6, 3, 0, 5, 1, 4, 2]

        def send(shift: int) -> None:
            """Send the current state with another joint order and another stamp."""
            message = joint_state(
                max(0, latest.stamp_ns + shift),
                name=[JOINTS[i] for i in order],
                position=latest.position[order].tolist(),
                velocity=latest.velocity[order].tolist(),
            )
            states.publish(message)

        def counted(key: str, *shifts: int) -> None:
            previous = int(run.health['controller'][key])
            shift = itertools.cycle(shifts)

            def has_counted() -> bool:
                # If the test itself is late, its states look like those of another robot, and end
                # the law until no more of them arrive.
                if run.states[-1] == 'active':
                    send(next(shift))
                run.spin(0.02)
                return int(run.health['controller'][key]) > previous

            run.tester.until(has_counted, lambda: f'{key}: {run.health}')

        run.wait_for_report('controller', 'state', 'active')
        # Late states; the second shift applies if the test itself is late.
        counted('late states', -50_000_000, 100_000_000)
        counted('gaps in states', 3_600 * 10**9)  # a clock an hour ahead, and back
        for shift in (-(10**12), 10**12, 0):
            send(shift)
            run.spin(0.05)
        far = OdometryCdr()
        far.set_stamp(10**15)
        odometry.publish(far.to_bytes())
        run.wait_for_progress()
        run.end()


@pytest.mark.slow
def test_nodes_stopped_or_killed_run_continues(tmp_path: Path) -> None:
    logs = []
    with live_run(tmp_path, reference_timeout=0.5) as run:
        run.wait_for_progress()
        for name in NODES:
            run.nodes[name].signal(signal.SIGSTOP)
            wait_for_missing_node(run, name)
            run.nodes[name].signal(signal.SIGCONT)
            run.wait_for_progress()
            kill_and_restart(run, name)
            run.wait_for_progress()
            logs.append(run.log)
        # The new recorder completes the log of the killed one.
        recorder = run.nodes['recorder']
        run.tester.until(lambda: recorder.logged('WARN', 'completed with'), 'a recovery')
        run.end()
    assert logs[0] != run.log
    check_log(logs[0])


@pytest.mark.slow
def test_run_with_restarted_nodes_ends_regularly(tmp_path: Path) -> None:
    """All nodes but the paused plant are killed and restarted; they continue the run."""
    last = 8_000_000_000
    with live_run(tmp_path, duration=last * 1e-9) as run:
        run.wait_for_progress()
        pause(run, on=True)
        # All earlier states of the controller have arrived then; the pause is no fault.
        run.spin(0.5)
        assert run.states[-1] == 'active'
        for name in ('trajectory', 'controller', 'recorder'):
            run.nodes[name].signal(signal.SIGKILL)
            run.nodes[name].wait()
        assert 0 < run.stamp < last, 'the run ended before the nodes were killed'
        activations = run.states.count('active')
        # Killed nodes do not send earlier messages to a new subscriber.
        records = run.tester.collect(String, 'trajectory/parameters')
        progress = run.tester.collect(Time, 'recorder/progress')
        for name in ('trajectory', 'controller', 'recorder'):
            run.start(name)
        run.tester.until(lambda: run.states.count('active') > activations, 'a new controller')
        run.tester.until(lambda: records and progress, 'a new trajectory and a new recorder')
        pause(run, on=False)
        for name, node in run.nodes.items():
            assert node.wait() == 0, (name, run.started.output())
        assert run.wrong == []
    contents = check_log(run.log)
    assert contents.stamps('joint_states')[-1] == last
    assert contents.stamps('effort_commands')[-1] == last


@pytest.mark.slow
def test_second_controller_torques_limited_and_reported(tmp_path: Path) -> None:
    """Both compute the same law; all torques are valid, and all nodes warn of the second one."""
    # The second controller starts with an approach; the first one opposes it up to its limits.
    with live_run(tmp_path, runaway_detection='false') as run:
        run.wait_for_progress()
        first = run.nodes['controller']
        run.start('controller')
        run.wait_for_report('controller', 'others on effort_commands', '/controller')
        run.wait_for_report('plant', 'senders of commands', '/controller, /controller')
        run.wait_for_report('plant', 'message', 'more than one node commands the robot')
        run.wait_for_progress(1.0)
        first.signal(signal.SIGINT)
        assert first.wait() == 0
        run.tester.until(
            lambda: 'senders of commands' not in run.health['plant'], 'a single controller'
        )
        run.wait_for_progress()
        run.end(in_order=False)


def pause(run: LiveRun, *, on: bool) -> None:
    assert run.tester.call(SetBool, '/plant/pause', SetBool.Request(data=on)).success


def wait_for_missing_node(run: LiveRun, name: str) -> None:
    """Wait for the documented effect of a missing node."""
    if name == 'trajectory':
        run.wait_for_state('fault: no reference for 0.5 s')
    if name == 'plant':
        run.wait_for_state('fault: no usable joint_states for 0.2 s')
    if name == 'controller':
        run.tester.until(lambda: not run.torque.any(), 'no torque')
    if name == 'recorder':
        run.spin(0.5)  # in real time no node waits for the recorder


def kill_and_restart(run: LiveRun, name: str) -> None:
    """Kill a node, wait for the effect, restart it and wait until it participates."""
    progress = run.tester.collect(Time, 'recorder/progress', past=False)
    run.nodes[name].signal(signal.SIGKILL)
    run.nodes[name].wait()
    wait_for_missing_node(run, name)
    activations, killed = run.states.count('active'), run.stamp
    run.start(name)
    if name == 'recorder':
        run.tester.until(
            lambda: any(t.sec * 10**9 + t.nanosec > killed for t in progress), 'a recorder'
        )
    else:
        run.tester.until(lambda: run.states.count('active') > activations, f'a new {name}')


@pytest.mark.slow
def test_plant_delayed_last_command_still_valid(tmp_path: Path) -> None:
    """Robot time does not advance during the delay; the last torque remains active."""
    with live_run(tmp_path, state_timeout=5.0) as run:
        run.wait_for_progress()
        plant = run.nodes['plant']
        for _ in range(5):
            plant.signal(signal.SIGSTOP)
            run.spin(0.5)
            run.torques.clear()
            plant.signal(signal.SIGCONT)
            run.tester.until(lambda: len(run.torques) > 5, 'motion')
            assert all(np.any(torque) for torque in run.torques)
            run.wait_for_progress(0.1)
        assert plant.logged('WARN', 'no command') == []
        run.end()
