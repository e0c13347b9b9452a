# SPDX-License-Identifier: Apache-2.0
"""Nodes in real time: they end cleanly on signals, the log is whole, any sender is served."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('rclpy')

from processes import PAPER, peer, processes, ros_arguments
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from masmc_ros.log.cdr import EffortCdr, JointStateCdr


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
    with processes(tmp_path) as started, peer(started.domain) as tester:
        answers = tester.collect(Float64MultiArray, 'effort_commands', raw=True)
        reference = tester.publisher(Float64MultiArray, 'reference')
        states = tester.publisher(JointState, 'joint_states')
        started.start('controller', *ros_arguments(PAPER, controller__law='smc'))
        tester.wait_for_subscribers(reference)
        tester.wait_for_subscribers(states)
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

            tester.until(arrived)
            return found[0]

        states.publish(foreign)
        torque = answered(1_000_000)

        def is_refused(state: JointState, expected: str) -> bool:
            states.publish(state)  # again: of several at once the last counts
            return expected in started.output()

        tester.until(lambda: is_refused(bad, "'arm_joint_1' is missing"))
        tester.until(lambda: is_refused(nan, "position of 'arm_joint_1' is not a finite number"))
        ours.set_stamp(4_000_000)
        states.publish(ours.to_bytes())
        assert np.array_equal(answered(4_000_000), torque)
        assert b'effort@0.002' not in b''.join(answers)
        assert b'effort@0.003' not in b''.join(answers)


def test_the_plant_takes_only_the_command_that_it_waits_for(tmp_path: Path) -> None:
    with processes(tmp_path) as started, peer(started.domain) as tester:
        states = tester.collect(JointState, 'joint_states', raw=True)
        commands = tester.publisher(Float64MultiArray, 'effort_commands')
        started.start('plant', *ros_arguments(PAPER, plant__wait_for='[peer]'))
        tester.wait_for_subscribers(commands)
        tester.until(lambda: len(states) == 1)
        command = EffortCdr()
        command.data[:] = float('nan')

        def is_refused(expected: str) -> bool:
            commands.publish(command.to_bytes())  # again: of several at once the last counts
            return expected in started.output()

        tester.until(lambda: is_refused('[nan, nan, nan, nan], expected 4 finite numbers'))
        command.set_stamp(7_000_000)
        command.data[:] = 1.0
        commands.publish(command.to_bytes())
        commands.publish(Float64MultiArray(data=[1.0] * 4))
        # Only this one carries the stamp of the outstanding state and is sane.
        command.set_stamp(0)
        command.data[:] = [0.1, 0.2, 0.3, 0.4]
        commands.publish(command.to_bytes())
        tester.until(lambda: len(states) >= 2)
        state = JointStateCdr()
        assert state.load(states[1])
        assert state.stamp_ns == 1_000_000
        assert state.effort.tolist() == [0.0, 0.0, 0.0, 0.1, 0.2, 0.3, 0.4]
    assert len(states) == 2
