# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Faults brought into a run of real nodes: it goes on, and never applies a wild torque."""

from __future__ import annotations

from collections.abc import Callable
import itertools
import math
from pathlib import Path
import signal
from typing import Any

from builtin_interfaces.msg import Time
from checked_log import check_log
from live_run import live_run, LiveRun
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.names import JOINTS
from masmc_ros.messages.platform_motion import OdometryCdr
from masmc_ros.messages.reference_window import ReferenceWindow
from nav_msgs.msg import Odometry
import numpy as np
from processes import NODES
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout, String
from std_srvs.srv import SetBool

GARBAGE = b'\x00\x01\x00\x00\xff\xff\xff\x7f'
"""A message that promises more than it holds."""


def joint_state(stamp: int, *, joint: str = '', **fields: Any) -> JointState:
    """Return a state at rest, with another name for the last joint if one is given."""
    message = JointState(name=[*JOINTS[:6], joint or JOINTS[6]])
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
    message.position = message.velocity = [0.0] * 7
    for name, value in fields.items():
        setattr(message, name, value)
    return message


def ours_with(stamp: int, **numbers: float) -> bytes:
    """Return a state in the controller's own layout with numbers that are not right."""
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
"""A node, a topic that it listens to, and its type."""

Bad = tuple[Callable[[int], Any], str]
"""What makes a message that is not right at a stamp in ns, and part of why it is refused."""

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
"""What is sent to a node on a topic, one after the other; topics go beside each other."""


def test_bad_messages_on_every_input(tmp_path: Path) -> None:
    """Every one is refused by name, one line a second; the run goes on as if it had not come."""
    settings = {
        'pose_source': 'odom',
        'trajectory__start_time': -1.0,
        'plant__odom_decimation': 5,
    }
    with live_run(tmp_path, **settings) as run:
        run.injected |= {GARBAGE, command(math.nan)}
        run.goes_on()
        publishers = {
            # A plant listens to recorders of its own kind alone, which are latched.
            key: run.tester.publisher(key[2], key[1], latched=key[1] == 'recorder/progress')
            for key in BAD
        }
        for turn in range(max(map(len, BAD.values()))):
            are_refused(run, publishers, {k: b[turn] for k, b in BAD.items() if turn < len(b)})
        states = publishers['controller', 'joint_states', JointState]

        for bad_state, reason in ((GARBAGE, 'no stamp'), (joint_state(-1), 'is negative')):

            def follower_refuses(state: Any = bad_state, part: str = reason) -> bool:
                states.publish(state)
                run.spin(0.02)
                told = lines(run, ('trajectory', 'joint_states', JointState))
                return any(part in line for line in told)

            run.tester.until(follower_refuses, f'a trajectory that refuses a state: {reason}')
        run.goes_on()
        for (node, topic, _), bad in BAD.items():
            if node != 'trajectory':
                counts_at_least(run, node, f'{topic} rejected', len(bad))
        run.end()
        # A recorder writes what comes, and says what it cannot read.
        assert run.nodes['recorder'].logged('ERROR', 'plant/parameters')


def counts_at_least(run: LiveRun, node: str, key: str, count: int) -> None:
    """Wait until a node reports so many of something."""
    run.tester.until(
        lambda: int(run.health.get(node, {}).get(key, '0')) >= count, f'{count} {key} of {node}'
    )


def are_refused(run: LiveRun, publishers: dict[Input, Any], bad: dict[Input, Bad]) -> None:
    """Send bad messages, one kind to each input, until every one was refused for its reason."""
    seen = {key: len(lines(run, key)) for key in bad}

    def is_refused() -> bool:
        # Again and again: of messages at once only the last counts.
        for key, (make, _) in bad.items():
            publishers[key].publish(make(run.stamp + 2_000_000))
        run.spin(0.02)
        return all(
            any(reason in line for line in lines(run, key)[seen[key]:])
            for key, (_, reason) in bad.items()
        )

    run.tester.until(is_refused, f'one of {[(*key[:2], bad[key][1]) for key in bad]}')
    assert run.wrong == []


def lines(run: LiveRun, key: Input) -> list[str]:
    """Return what a node has said of messages that it refused."""
    node, topic, _ = key
    return [line for line in run.nodes[node].logged('ERROR', ' rejected: ') if topic in line]


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

        def counted(key: str, *shifts: int) -> None:
            before = int(run.health['controller'][key])
            shift = itertools.cycle(shifts)

            def has_counted() -> bool:
                send(next(shift))
                run.spin(0.02)
                return int(run.health['controller'][key]) > before

            run.tester.until(has_counted, f'{key}: {run.health}')

        run.reports('controller', 'state', 'active')
        # Late, again and again; where the test lags behind, the other of the two is.
        counted('late states', -50_000_000, 100_000_000)
        counted('gaps in states', 3_600 * 10**9)  # a clock an hour ahead, and back
        for shift in (-(10**12), 10**12, 0):
            send(shift)
            run.spin(0.05)
        far = OdometryCdr()
        far.set_stamp(10**15)
        odometry.publish(far.to_bytes())
        run.goes_on()
        run.end()


@pytest.mark.slow
def test_nodes_that_hang_or_are_killed_in_a_run(tmp_path: Path) -> None:
    logs = []
    with live_run(tmp_path, reference_timeout=0.5) as run:
        run.goes_on()
        for name in NODES:
            run.nodes[name].signal(signal.SIGSTOP)
            wait_for_the_lack_of(run, name)
            run.nodes[name].signal(signal.SIGCONT)
            run.goes_on()
            kill_and_restart(run, name)
            run.goes_on()
            logs.append(run.log)
        # What a killed recorder has written is completed by the next, and as fine as the rest.
        recorder = run.nodes['recorder']
        run.tester.until(lambda: recorder.logged('WARN', 'completed with'), 'a recovery')
        run.end()
    assert logs[0] != run.log
    check_log(logs[0])


@pytest.mark.slow
def test_a_run_with_nodes_that_were_killed_comes_to_its_end(tmp_path: Path) -> None:
    """All but the plant, which stands still meanwhile: everything else takes up the run."""
    last = 8_000_000_000
    with live_run(tmp_path, duration=last * 1e-9) as run:
        run.goes_on()
        pause(run, on=True)
        # What the controller has told before is here by then; the pause is no fault.
        run.spin(0.5)
        assert run.told[-1] == 'active'
        for name in ('trajectory', 'controller', 'recorder'):
            run.nodes[name].signal(signal.SIGKILL)
            run.nodes[name].wait()
        assert 0 < run.stamp < last, 'killed too late to show anything'
        activations = run.told.count('active')
        # The dead do not send their past to a new listener.
        records = run.tester.collect(String, 'trajectory/parameters')
        progress = run.tester.collect(Time, 'recorder/progress')
        for name in ('trajectory', 'controller', 'recorder'):
            run.start(name)
        run.tester.until(lambda: run.told.count('active') > activations, 'a new controller')
        run.tester.until(lambda: records and progress, 'a new trajectory and a new recorder')
        pause(run, on=False)
        for name, node in run.nodes.items():
            assert node.wait() == 0, (name, run.started.output())
        assert run.wrong == []
    contents = check_log(run.log)
    assert contents.stamps('joint_states')[-1] == last
    assert contents.stamps('effort_commands')[-1] == last


@pytest.mark.slow
def test_two_controllers_at_once(tmp_path: Path) -> None:
    """Both compute the same law; whichever torque acts is fine, and everybody warns of it."""
    # The second one starts with an approach, against which the first one pushes to its limits.
    with live_run(tmp_path, runaway_detection='false') as run:
        run.goes_on()
        first = run.nodes['controller']
        run.start('controller')
        run.reports('controller', 'others on effort_commands', '/controller')
        run.reports('plant', 'senders of commands', '/controller, /controller')
        run.reports('plant', 'message', 'more than one node commands the robot')
        run.goes_on(1.0)
        first.signal(signal.SIGINT)
        assert first.wait() == 0
        run.tester.until(
            lambda: 'senders of commands' not in run.health['plant'], 'a controller alone'
        )
        run.goes_on()
        run.end(in_order=False)


def pause(run: LiveRun, *, on: bool) -> None:
    assert run.tester.call(SetBool, '/plant/pause', SetBool.Request(data=on)).success


def wait_for_the_lack_of(run: LiveRun, name: str) -> None:
    """Wait until it shows, as documented, that a node does nothing any more."""
    if name == 'trajectory':
        run.is_told('fault: no reference for 0.5 s')
    if name == 'plant':
        run.is_told('fault: no usable joint_states for 0.2 s')
    if name == 'controller':
        run.tester.until(lambda: not run.torque.any(), 'no torque')
    if name == 'recorder':
        run.spin(0.5)  # in real time nobody waits for it


def kill_and_restart(run: LiveRun, name: str) -> None:
    """Kill a node, wait until that shows, start it again and wait until it takes part."""
    answered = run.tester.collect(Time, 'recorder/progress', past=False)
    run.nodes[name].signal(signal.SIGKILL)
    run.nodes[name].wait()
    wait_for_the_lack_of(run, name)
    activations, killed = run.told.count('active'), run.stamp
    run.start(name)
    if name == 'recorder':
        run.tester.until(
            lambda: any(t.sec * 10**9 + t.nanosec > killed for t in answered), 'a recorder'
        )
    else:
        run.tester.until(lambda: run.told.count('active') > activations, f'a new {name}')


@pytest.mark.slow
def test_to_a_plant_that_was_held_up_its_command_is_not_old(tmp_path: Path) -> None:
    """The robot's time stood still; what was commanded holds, and no zeros come in between."""
    with live_run(tmp_path, state_timeout=5.0) as run:
        run.goes_on()
        plant = run.nodes['plant']
        for _ in range(5):
            plant.signal(signal.SIGSTOP)
            run.spin(0.5)
            run.torques.clear()
            plant.signal(signal.SIGCONT)
            run.tester.until(lambda: len(run.torques) > 5, 'motion')
            assert all(np.any(torque) for torque in run.torques)
            run.goes_on(0.1)
        assert plant.logged('WARN', 'no command') == []
        run.end()
