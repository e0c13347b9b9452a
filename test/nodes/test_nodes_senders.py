# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Messages of third-party publishers: read by joint names and labels, or rejected in one line."""

from __future__ import annotations

from collections.abc import Iterator
import math
from pathlib import Path
from typing import Any

from helpers.processes import NodeProcess, PAPER, Peer, peer, processes, ros_arguments
from masmc_ros.loop.controller import Controller
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.messages.topics import JOINTS
from masmc_ros.numerics.hermite import quintic
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
from numpy.typing import NDArray
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

POSITION = np.array([0.1, -0.2, 1.4, 3.0, -2.0, 0.7, -1.2])
VELOCITY = np.array([0.3, 0.1, -0.2, 1.0, 2.0, 0.4, -0.5])
SAMPLE = np.array([0.3, 0.5, 0.05, 0.1, 0.2, -0.1, 0.15, 0.05, 0.4, -0.3, 0.2, 0.1])
"""Position, velocity and acceleration of a reference."""


class Controlled:
    """Single controller node; the test publishes its states and references."""

    def __init__(self, node: NodeProcess, tester: Peer) -> None:
        self.node = node
        self.tester = tester
        self.states = tester.publisher(JointState, 'joint_states')
        self.references = tester.publisher(Float64MultiArray, 'reference')
        self._answers = tester.collect(Float64MultiArray, 'effort_commands', raw=True)
        self._tick = 0
        values = load_scenario(str(PAPER), ['controller.law=smc'])['controller']
        self._law = Controller(robot_of(values), values['control_period'], values)

    def wait_until_matched(self) -> None:
        self.tester.wait_for_subscribers(self.states)
        self.tester.wait_for_subscribers(self.references)

    @property
    def stamp(self) -> int:
        """Return the latest stamp in ns."""
        return self._tick * 1_000_000

    def next_stamp(self) -> int:
        """Advance the robot's time by one millisecond; return the stamp in ns."""
        self._tick += 1
        return self.stamp

    def answer(self, stamp: int) -> NDArray[np.float64]:
        """Wait for the command that answers a stamp; return its torque."""
        command = EffortCdr()

        def arrived() -> bool:
            return any(command.load(raw) and command.stamp_ns == stamp for raw in self._answers)

        self.tester.until(arrived, f'the answer to {stamp} ns')
        return command.data

    def send(self, message: JointState, after: int = 0) -> int:
        """Send a state with a new stamp in ns, later than `after`; return the stamp."""
        self._tick = max(self._tick, after // 1_000_000)
        stamp = self.next_stamp()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        self.states.publish(message)
        return stamp

    def torque(self, message: JointState) -> list[float]:
        """Send a state with a new stamp; return the torque that answers it."""
        return list(self.answer(self.send(message)).tolist())

    def computed(self, reference: NDArray[np.float64]) -> list[float]:
        """Return the torque that the law computes at the state of these tests."""
        self._law.tick(POSITION, VELOCITY, reference)
        return list(self._law.torque.tolist())

    def answers_in_order(self) -> list[int | None]:
        command = EffortCdr()
        return [command.stamp_ns for raw in self._answers if command.load(raw)]


@pytest.fixture(scope='module')
def controlled(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Controlled]:
    folder = tmp_path_factory.mktemp('controlled')
    with processes(folder) as started, peer(started.domain) as tester:
        node = started.start('controller', *ros_arguments(law='smc', duration=0.0))
        controlled = Controlled(node, tester)
        controlled.wait_until_matched()
        controlled.references.publish(Float64MultiArray(data=SAMPLE.tolist()))
        yield controlled


def state(order: list[int] | None = None, **fields: Any) -> JointState:
    """Return the state of these tests with its joints in an order."""
    order = list(range(7)) if order is None else order
    message = JointState(
        name=[JOINTS[i] for i in order],
        position=POSITION[order].tolist(),
        velocity=VELOCITY[order].tolist(),
        effort=[0.0] * len(order),
    )
    message.header.frame_id = fields.pop('frame_id', '')
    for name, value in fields.items():
        setattr(message, name, value)
    return message


VALID_STATES = {
    'as ours': state(),
    'other order': state([6, 2, 0, 5, 1, 3, 4]),
    'a frame': state(frame_id='world'),
    'no efforts': state(effort=[]),
    'efforts that are unknown': state(effort=[math.nan] * 7),
    'another joint between': state(
        name=[*JOINTS[:4], 'gripper', *JOINTS[4:]],
        position=[*POSITION[:4], 9.0, *POSITION[4:]],
        velocity=[*VELOCITY[:4], 9.0, *VELOCITY[4:]],
        effort=[],
    ),
}


@pytest.mark.parametrize('message', VALID_STATES.values(), ids=VALID_STATES.keys())
def test_controller_valid_state_of_any_form_same_torque(
    controlled: Controlled, message: JointState
) -> None:
    """The torque is bitwise identical for all forms of the same state."""
    expected = controlled.computed(SAMPLE)
    controlled.references.publish(Float64MultiArray(data=SAMPLE.tolist()))
    ours = JointStateCdr()
    ours.position[:], ours.velocity[:] = POSITION, VELOCITY
    controlled.tester.until(lambda: controlled.torque(message) == expected, 'the same torque')
    stamp = controlled.next_stamp()
    ours.set_stamp(stamp)
    controlled.states.publish(ours.to_bytes())
    assert controlled.answer(stamp).tolist() == expected


INVALID_STATES = {
    'missing joint': (state([0, 1, 2, 3, 4, 5]), "'arm_joint_2' is missing"),
    'no joints': (JointState(), "'base_x_joint' is missing"),
    'a joint twice': (state([0, 1, 2, 3, 4, 5, 6, 6]), "'arm_joint_2' appears 2 times"),
    'short positions': (state(position=[0.0] * 6), 'position has 6 numbers for 7 joints'),
    'no velocities': (state(velocity=[]), 'set velocity_source to estimated'),
    'position not a number': (
        state(position=[*POSITION[:6], math.nan]),
        "position of 'arm_joint_2' is not a finite number",
    ),
    'velocity not a number': (
        state(velocity=[*VELOCITY[:3], math.nan, *VELOCITY[4:]], frame_id='somewhere'),
        "velocity of 'wheel_right_joint' is not a finite number",
    ),
    'velocity infinite': (
        state(velocity=[math.inf, *VELOCITY[1:]]),
        "velocity of 'base_x_joint' is not a finite number",
    ),
}


@pytest.mark.parametrize(('message', 'reason'), INVALID_STATES.values(), ids=INVALID_STATES.keys())
def test_controller_invalid_state_rejected(
    controlled: Controlled, message: JointState, reason: str
) -> None:
    stamp = controlled.next_stamp()
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)

    def is_rejected() -> bool:
        # Sending is repeated: log lines are throttled to one per second, and of several states
        # the controller may process only the latest.
        controlled.states.publish(message)
        return bool(controlled.node.logged('ERROR', reason))

    controlled.tester.until(is_rejected, reason)
    assert len(controlled.node.logged('ERROR', reason)[-1].splitlines()) == 1
    # The controller continues, and has not answered the rejected state.
    controlled.torque(state())
    assert stamp not in controlled.answers_in_order()
    assert 'Traceback' not in '\n'.join(controlled.node.stderr())


@pytest.mark.parametrize('count', [4, 8, 12])
def test_controller_unlabelled_reference_is_set_point(controlled: Controlled, count: int) -> None:
    numbers = (SAMPLE + 0.01 * count)[:count]
    full = np.zeros(12)
    full[:count] = numbers
    expected = controlled.computed(full)
    controlled.references.publish(Float64MultiArray(data=numbers.tolist()))
    controlled.tester.until(lambda: controlled.torque(state()) == expected, 'its torque')


def test_controller_set_point_with_other_label_followed(controlled: Controlled) -> None:
    layout = MultiArrayLayout(dim=[MultiArrayDimension(label='axis', size=4, stride=4)])
    numbers = SAMPLE[:4] - 0.02
    expected = controlled.computed(np.concatenate([numbers, np.zeros(8)]))
    controlled.references.publish(Float64MultiArray(layout=layout, data=numbers.tolist()))
    controlled.tester.until(lambda: controlled.torque(state()) == expected, 'its torque')


def test_controller_reference_window_samples_interpolated(controlled: Controlled) -> None:
    """Samples with a period of 4 ms are used unmodified at their times, interpolated between."""
    first = controlled.next_stamp()
    rows = SAMPLE + 1e-3 * np.sin(np.arange(500))[:, None]
    controlled.references.publish(ReferenceWindow(first, 0.004, rows.reshape(-1, 3, 4)).to_bytes())

    def is_followed() -> bool:
        """Send a state at a time of a sample; return True if the sample is followed."""
        while (controlled.next_stamp() + 1_000_000 - first) % 4_000_000:
            pass
        torque = controlled.torque(state())
        return torque == controlled.computed(rows[(controlled.stamp - first) // 4_000_000])

    controlled.tester.until(is_followed, 'the window')
    for quarter in (1, 2, 3):
        torque = controlled.torque(state())
        k, remainder = divmod(controlled.stamp - first, 4_000_000)
        assert remainder == quarter * 1_000_000
        before, after = rows[k].reshape(3, 4), rows[k + 1].reshape(3, 4)
        axes = [
            quintic(tuple(before[:, i]), tuple(after[:, i]), 0.004, quarter / 4) for i in range(4)
        ]
        expected = controlled.computed(np.array(axes).T.reshape(-1))
        assert torque == pytest.approx(expected, rel=1e-9)
    # During a trajectory a set-point is rejected; a state after its end waits for a set-point.
    stamp = controlled.send(state(), after=first + 4_000_000 * len(rows))

    def is_answered() -> bool:
        controlled.references.publish(Float64MultiArray(data=SAMPLE.tolist()))
        return stamp in controlled.answers_in_order()

    controlled.tester.until(is_answered, 'the set-point after the trajectory')
    assert controlled.answer(stamp).tolist() == controlled.computed(SAMPLE)


BAD_REFERENCES = {
    'five numbers': (Float64MultiArray(data=[0.0] * 5), 'a set-point of 5 numbers'),
    'no numbers': (Float64MultiArray(), 'a set-point of 0 numbers'),
    'not a number': (
        Float64MultiArray(data=[0.3, math.nan, 0.0, 0.0]),
        'number 1 is not finite',
    ),
    'no time between samples': (
        ReferenceWindow(0, 0.0, np.zeros((2, 3, 4))).to_bytes(),
        'sample period 0 s',
    ),
    'one sample without a period': (
        ReferenceWindow(0, 0.0, np.zeros((1, 3, 4))).to_bytes(),
        'sample period 0 s',
    ),
    'a period that is too long': (
        ReferenceWindow(0, 1e300, np.zeros((2, 3, 4))).to_bytes(),
        'sample period 1e+300 s',
    ),
    'a stamp out of range': (
        Float64MultiArray(
            layout=MultiArrayLayout(
                dim=[
                    MultiArrayDimension(label=label, size=size)
                    for label, size in (('samples', 1), ('derivative', 3), ('task', 4))
                ],
                data_offset=3,
            ),
            data=[1e300, 0.0, 0.001, *[0.0] * 12],
        ),
        'stamp [1e+300, 0]',
    ),
    'bytes that are no message': (b'\x00\x01\x00\x00\x07', 'bytes that are no'),
}


@pytest.mark.parametrize(('message', 'reason'), BAD_REFERENCES.values(), ids=BAD_REFERENCES.keys())
def test_controller_invalid_reference_rejected(
    controlled: Controlled, message: Float64MultiArray | bytes, reason: str
) -> None:
    controlled.references.publish(Float64MultiArray(data=SAMPLE.tolist()))
    expected = controlled.computed(SAMPLE)
    controlled.tester.until(lambda: controlled.torque(state()) == expected, 'its torque')

    error_count = len(controlled.node.logged('ERROR', reason))

    def is_rejected() -> bool:
        controlled.references.publish(message)
        return len(controlled.node.logged('ERROR', reason)) > error_count

    controlled.tester.until(is_rejected, reason)
    assert controlled.torque(state()) == expected


def test_plant_real_time_four_unlabelled_numbers_applied(tmp_path: Path) -> None:
    """ros2_control's effort controllers send no label; a label must name a recent state."""
    labelled = EffortCdr()
    with processes(tmp_path) as started, peer(started.domain) as tester:
        raw = tester.collect(JointState, 'joint_states', raw=True)
        commands = tester.publisher(Float64MultiArray, 'effort_commands')
        settings = {'pacing': 'realtime', 'wait_for': '[peer]', 'command_timeout': 1000.0}
        plant = started.start('plant', *ros_arguments(duration=0.0, **settings))
        tester.wait_for_subscribers(commands)
        tester.until(lambda: raw, 'the first state')
        state = JointStateCdr()

        def applies(torque: list[float]) -> bool:
            assert state.load(raw[-1])
            return state.effort.tolist() == [0.0, 0.0, 0.0, *torque]

        commands.publish(Float64MultiArray(data=[0.1, 0.2, 0.3, 0.4]))
        tester.until(lambda: applies([0.1, 0.2, 0.3, 0.4]), 'the unlabelled command')
        labelled.data[:] = [-0.1, -0.2, -0.3, -0.4]
        commands.publish(labelled.to_bytes())
        tester.until(lambda: applies([-0.1, -0.2, -0.3, -0.4]), 'the labelled command')
        labelled.data[:] = 9.0
        labelled.set_stamp(10**15)
        commands.publish(labelled.to_bytes())
        for bad, reason in (
            (Float64MultiArray(data=[1.0, math.nan, 1.0, 1.0]), "'wheel_left_joint' is not a"),
            (Float64MultiArray(data=[1.0] * 3), '3 numbers; expected 4'),
            (Float64MultiArray(data=[1.0] * 7), '7 numbers; expected 4'),
        ):

            def is_rejected(bad: Float64MultiArray = bad, reason: str = reason) -> bool:
                commands.publish(bad)
                return bool(plant.logged('ERROR', reason))

            tester.until(is_rejected, reason)
        assert applies([-0.1, -0.2, -0.3, -0.4])


def test_plant_lockstep_other_commands_dropped(tmp_path: Path) -> None:
    """The plant drops commands for an earlier or later state, and commands without a label."""
    command = EffortCdr()
    with processes(tmp_path) as started, peer(started.domain) as tester:
        raw = tester.collect(JointState, 'joint_states', raw=True)
        commands = tester.publisher(Float64MultiArray, 'effort_commands')
        started.start('plant', *ros_arguments(wait_for='[peer]', duration=0.0))
        tester.wait_for_subscribers(commands)
        tester.until(lambda: raw, 'the first state')
        for tick in range(5):
            commands.publish(Float64MultiArray(data=[9.0] * 4))
            for other in (tick - 1, tick + 1):
                command.set_stamp(max(0, other) * 1_000_000 + (other < 0))
                command.data[:] = 9.0
                commands.publish(command.to_bytes())
            command.set_stamp(tick * 1_000_000)
            command.data[:] = [0.1 * tick, 0.0, 0.0, 0.5]

            def has_moved(tick: int = tick) -> bool:
                # Sending is repeated: of several commands only the latest may be processed.
                commands.publish(command.to_bytes())
                return len(raw) > tick + 1

            tester.until(has_moved, f'state {tick + 1}')
            state = JointStateCdr()
            assert state.load(raw[tick + 1])
            assert state.stamp_ns == (tick + 1) * 1_000_000
            assert state.effort.tolist()[3:] == command.data.tolist()
        assert len(raw) == 6
