# SPDX-License-Identifier: Apache-2.0
"""Nodes in real time: they end cleanly on signals, the log is whole, any sender is served."""

from __future__ import annotations

from pathlib import Path
import signal

from mcap.reader import make_reader
import numpy as np
import pytest

pytest.importorskip('rclpy')

from live_nodes import messages, NODES, nodes, observer, PAPER, ros_arguments, watch_time
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from masmc_ros.log.cdr import EffortCdr, JointStateCdr
from masmc_ros.log.reader import read_run
from masmc_ros.log.stamps import header_stamp
from masmc_ros.nodes.qos import subscribe_with_past


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_signals_end_everything_with_a_whole_log(tmp_path: Path, number: signal.Signals) -> None:
    log = tmp_path / 'run.mcap'
    with nodes(tmp_path) as started:
        arguments = ros_arguments(
            PAPER,
            **{f'{name}__duration': 0.0 for name in (*NODES, 'recorder')},
            plant__pacing='realtime',
            plant__wait_for='[controller, trajectory, recorder, observer]',
            recorder__output=log,
        )
        with observer(started.domain) as (node, spin_until):
            stamps = watch_time(node)
            for name in (*NODES, 'recorder'):
                started.start(name, *arguments)
            spin_until(lambda: stamps[-1] >= 500_000_000)
        started.signal(number)
        assert set(started.wait().values()) == {0}, started.output()
    with log.open('rb') as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count > 1000
    states = [header_stamp(raw) for raw in messages(log)['joint_states']]
    assert states == [1_000_000 * k for k in range(len(states))]
    run = read_run(log)
    assert np.isfinite(run.torque).all()


def _state(names: list[str], values: np.ndarray, stamp: int) -> JointState:
    state = JointState(name=names)
    state.header.stamp.sec, state.header.stamp.nanosec = divmod(stamp, 10**9)
    state.header.frame_id = 'somewhere'
    state.position = values.tolist()
    state.velocity = (0.1 * values).tolist()
    return state


def test_the_controller_serves_any_sender(tmp_path: Path) -> None:
    """Joints in another order from a volatile publisher: the same torque as in ours."""
    ours = JointStateCdr()
    ours.position[:] = [0.0, 0.0, 1.5, 0.0, 0.0, 0.8, -1.5]
    ours.velocity[:] = 0.1 * ours.position
    names = list(deserialize_message(ours.to_bytes(), JointState).name)
    order = [5, 2, 0, 6, 1, 4, 3]
    foreign = _state([names[i] for i in order], ours.position[order], 1_000_000)
    bad = _state(names[:5], ours.position[:5], 2_000_000)
    nan = _state(names, np.where(np.arange(7) == 5, np.nan, ours.position), 3_000_000)
    answers: list[bytes] = []
    with nodes(tmp_path) as started, observer(started.domain) as (node, spin_until):
        subscribe_with_past(node, Float64MultiArray, 'effort_commands', answers.append, depth=100)
        reference = node.create_publisher(Float64MultiArray, 'reference', QoSProfile(depth=10))
        states = node.create_publisher(JointState, 'joint_states', QoSProfile(depth=10))
        started.start('controller', *ros_arguments(PAPER, controller__law='smc'))
        spin_until(lambda: reference.get_subscription_count() and states.get_subscription_count())
        reference.publish(Float64MultiArray(data=[0.3, 0.5, 0.0, 0.0]))

        def answered(stamp: int) -> np.ndarray:
            """Send until the controller answers: matching has two ends."""
            command = EffortCdr()
            found: list[np.ndarray] = []

            def arrived() -> bool:
                for raw in answers:
                    if command.load(raw) and command.stamp_ns == stamp:
                        found.append(command.data.copy())
                return bool(found)

            spin_until(arrived)
            return found[0]

        states.publish(foreign)
        torque = answered(1_000_000)

        def is_refused(state: JointState, expected: str) -> bool:
            states.publish(state)  # again: of several at once the last counts
            return expected in started.output()

        spin_until(lambda: is_refused(bad, "'arm_joint_1' is missing"))
        spin_until(lambda: is_refused(nan, "position of 'arm_joint_1' is not a finite number"))
        ours.set_stamp(4_000_000)
        states.publish(ours.to_bytes())
        assert np.array_equal(answered(4_000_000), torque)
        assert b'effort@0.002' not in b''.join(answers)
        assert b'effort@0.003' not in b''.join(answers)


def test_the_plant_takes_only_the_command_that_it_waits_for(tmp_path: Path) -> None:
    states: list[bytes] = []
    with nodes(tmp_path) as started, observer(started.domain) as (node, spin_until):
        subscribe_with_past(node, JointState, 'joint_states', states.append, depth=100)
        commands = node.create_publisher(
            Float64MultiArray, 'effort_commands', QoSProfile(depth=10)
        )
        started.start('plant', *ros_arguments(PAPER, plant__wait_for='[observer]'))
        spin_until(lambda: len(states) == 1 and commands.get_subscription_count() == 1)
        command = EffortCdr()
        command.data[:] = float('nan')

        def is_refused(expected: str) -> bool:
            commands.publish(command.to_bytes())  # again: of several at once the last counts
            return expected in started.output()

        spin_until(lambda: is_refused('[nan, nan, nan, nan], expected 4 finite numbers'))
        command.set_stamp(7_000_000)
        command.data[:] = 1.0
        commands.publish(command.to_bytes())
        commands.publish(Float64MultiArray(data=[1.0] * 4))
        # Only this one carries the stamp of the outstanding state and is sane.
        command.set_stamp(0)
        command.data[:] = [0.1, 0.2, 0.3, 0.4]
        commands.publish(command.to_bytes())
        spin_until(lambda: len(states) >= 2)
        state = JointStateCdr()
        assert state.load(states[1])
        assert state.stamp_ns == 1_000_000
        assert state.effort.tolist() == [0.0, 0.0, 0.0, 0.1, 0.2, 0.3, 0.4]
    assert len(states) == 2
