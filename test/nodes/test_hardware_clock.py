# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
A controller on a robot whose messages come twice, late, out of order, by a clock that jumps.

The test is the robot: it stands still, and says at every tick what time it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import signal
import time
from typing import Any

from checked_log import check_log, LIMIT
from diagnostic_msgs.msg import DiagnosticArray
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.messages.joint_state import JointStateCdr
import numpy as np
from numpy.typing import NDArray
from processes import NodeProcess, Peer, peer, Processes, processes, ros_arguments
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

MS = 1_000_000
PERIOD = 2 * MS
HOUR = 3_600 * 10**9
START = 10 * HOUR
NODES = ('recorder', 'trajectory', 'controller')


class StillRobot:
    """
    A robot that stands still whatever it is told to do.

    Attributes
    ----------
    stamp
        the latest stamp sent in ns.
    answers
        every command, by the stamp in ns that it answers.
    told
        every state that the controller told.

    """

    def __init__(self, tester: Peer, folder: Path, nodes: dict[str, NodeProcess]) -> None:
        self.tester = tester
        self.folder = folder
        self.nodes = nodes
        self.stamp = START
        self.answers: dict[int, list[NDArray[np.float64]]] = {}
        self.health: dict[str, str] = {}
        self._reported = 0
        self.told: list[str] = []
        self._state, self._command = JointStateCdr(), EffortCdr()
        self._state.position[:] = [0.0, 0.0, np.pi / 2, 0.0, 0.0, np.pi / 4, -np.pi / 2]
        self._states = tester.publisher(JointState, 'joint_states')
        tester.subscribe(Float64MultiArray, 'effort_commands', self._on_command, raw=True)
        tester.subscribe(String, 'controller/state', lambda m: self.told.append(m.data))
        tester.subscribe(DiagnosticArray, '/diagnostics', self._on_health)
        tester.until(lambda: self._listeners() >= set(NODES), 'all nodes')
        tester.wait_for_subscribers(self._states, len(NODES))

    def _listeners(self) -> set[str]:
        topic = self._states.topic_name
        return {each.node_name for each in self.tester.node.get_subscriptions_info_by_topic(topic)}

    def send(self, stamp: int) -> None:
        """Send the state with a stamp in ns."""
        self._state.set_stamp(stamp)
        self._states.publish(self._state.to_bytes())
        self.stamp = stamp

    def ticks(self, stamp: int, count: int = 1) -> NDArray[np.float64]:
        """Send states from a stamp on, each once the last is answered; return the last torque."""
        for tick in range(count):
            present = stamp + tick * PERIOD
            self.send(present)
            self.tester.until(lambda t=present: t in self.answers, f'an answer to {present}')
        return self.answers[self.stamp][-1]

    def counted(self, key: str) -> int:
        """Return a figure of a report that the controller has made from now on."""
        now = time.time_ns()
        self.tester.until(lambda: self._reported > now, 'a report')
        return int(self.health[key])

    def counts(self, key: str, count: int) -> None:
        """Wait until a report that was made from now on has this figure."""
        self.tester.until(lambda: self.counted(key) == count, f'{count} {key}')

    def end(self) -> None:
        """End all nodes; every torque must be fine, and the log whole."""
        for node in self.nodes.values():
            node.signal(signal.SIGINT)
        assert {node.wait() for node in self.nodes.values()} == {0}
        for torques in self.answers.values():
            for torque in torques:
                assert np.all(np.abs(torque) <= LIMIT)
        check_log(self.folder / 'run.mcap', told=self.told)

    def _on_command(self, raw: bytes) -> None:
        assert self._command.load(raw)
        assert self._command.stamp_ns is not None
        self.answers.setdefault(self._command.stamp_ns, []).append(self._command.data.copy())

    def _on_health(self, message: DiagnosticArray) -> None:
        if message.status[0].name.strip('/') != 'controller':
            return
        self.health = {each.key: each.value for each in message.status[0].values}
        made = message.header.stamp
        self._reported = made.sec * 10**9 + made.nanosec


@contextmanager
def still_robot(folder: Path, **settings: Any) -> Iterator[tuple[Processes, StillRobot]]:
    """Yield a robot at its first tick, its controller active on a path that begins there."""
    values: dict[str, Any] = {
        'pacing': 'realtime',
        'control_period': PERIOD * 1e-9,
        'duration': 0.0,
        'trajectory__start_time': -1.0,
        'controller__torque_limit': str(LIMIT.tolist()),
        # The robot waits for every answer, however long a busy machine takes for it.
        'controller__state_timeout': 60.0,
        # It does not move, however large its error becomes.
        'controller__runaway_detection': 'false',
        'recorder__output': folder / 'run.mcap',
        **settings,
    }
    with processes(folder) as started, peer(started.domain) as tester:
        nodes = started.start_all(*ros_arguments(**values), nodes=NODES)
        robot = StillRobot(tester, folder, nodes)
        tester.until(lambda: robot.told == ['active'], 'an active controller')

        def begins() -> bool:
            robot.send(robot.stamp + PERIOD)
            tester.until(lambda: True)
            return bool(robot.answers)

        tester.until(begins, 'the first answer')
        robot.ticks(robot.stamp + PERIOD, 20)
        yield started, robot


@pytest.mark.slow
def test_states_that_come_twice_late_and_out_of_order(tmp_path: Path) -> None:
    with still_robot(tmp_path) as (_, robot):
        begin = robot.stamp + PERIOD
        late, repeated = robot.counted('late states'), robot.counted('repeated states')
        first = robot.ticks(begin)
        for count in (2, 3):
            robot.send(begin)
            robot.tester.until(lambda n=count: len(robot.answers[begin]) == n, 'the same answer')
        assert all(np.array_equal(each, first) for each in robot.answers[begin])
        robot.counts('repeated states', repeated + 2)

        # The second of four comes last but one; once more, and a third time with the first.
        robot.ticks(begin + PERIOD)
        robot.ticks(begin + 3 * PERIOD)
        robot.send(begin + 2 * PERIOD)
        robot.counts('late states', late + 1)
        robot.ticks(begin + 4 * PERIOD)
        robot.send(begin + 2 * PERIOD)
        robot.counts('late states', late + 2)
        robot.send(begin)
        robot.counts('late states', late + 3)
        robot.ticks(begin + 5 * PERIOD, 20)
        assert begin + 2 * PERIOD not in robot.answers
        assert len(robot.answers[begin]) == 3
        assert robot.counted('gaps in states') == 0
        assert robot.told == ['active']
        robot.end()


@pytest.mark.slow
def test_a_clock_that_jumps_an_hour_either_way(tmp_path: Path) -> None:
    """The controller starts anew each time, goes on with small torques, and says so."""
    with still_robot(tmp_path) as (_, robot):
        controller = robot.nodes['controller']
        calm = np.abs(robot.ticks(robot.stamp + PERIOD, 50)).max()
        robot.ticks(robot.stamp + HOUR, 50)
        robot.counts('gaps in states', 1)
        assert controller.logged('WARN', 'the controller restarts')
        # Two hours back is before the path began.
        robot.ticks(robot.stamp - 2 * HOUR, 50)
        assert len(controller.logged('INFO', 'time was set back')) == 1
        torque = robot.tester.until(
            lambda: [t for t in [robot.ticks(robot.stamp + PERIOD, 10)] if t.any()],
            'a torque: something is followed',
        )
        assert np.abs(torque).max() < 10.0 * calm + 1.0
        torque = robot.ticks(robot.stamp + PERIOD, 50)
        assert np.abs(torque).max() < 10.0 * calm + 1.0
        assert robot.nodes['trajectory'].logged('INFO', 'the path restarts')
        # A single stamp that is wrong changes nothing for those that follow.
        here = robot.stamp
        for wrong in (here + HOUR, 0):
            robot.ticks(wrong)
            assert robot.ticks(here + PERIOD, 50).any()
            here = robot.stamp
        assert len(robot.nodes['trajectory'].logged('INFO', 'the path restarts')) == 1
        assert robot.told == ['active']
        robot.end()


@pytest.mark.slow
def test_a_reference_that_stops_and_comes_back(tmp_path: Path) -> None:
    """Its last position is held; with a timeout the torque is zero, and the fault is named."""
    with still_robot(tmp_path, controller__reference_timeout=0.2) as (started, robot):
        for number in (signal.SIGSTOP, signal.SIGKILL):
            robot.nodes['trajectory'].signal(number)

            def has_ended(robot: StillRobot = robot) -> bool:
                robot.ticks(robot.stamp + PERIOD, 10)
                return robot.told[-1].startswith('fault')

            robot.tester.until(has_ended, 'a fault')
            assert robot.told[-1] == 'fault: no reference for 0.2 s'
            assert not robot.ticks(robot.stamp + PERIOD, 10).any()
            if number == signal.SIGSTOP:
                robot.nodes['trajectory'].signal(signal.SIGCONT)
            else:
                robot.nodes['trajectory'].wait()
                arguments = ros_arguments(
                    pacing='realtime',
                    control_period=PERIOD * 1e-9,
                    duration=0.0,
                    start_time=-1.0,
                )
                robot.nodes['trajectory'] = started.start('trajectory', *arguments)

            def is_back(robot: StillRobot = robot) -> bool:
                robot.ticks(robot.stamp + PERIOD, 10)
                return robot.told[-1] == 'active'

            robot.tester.until(is_back, 'a reference')
            robot.tester.until(
                lambda: robot.ticks(robot.stamp + PERIOD, 20).any(), 'torque for the reference'
            )
        # A trajectory that is held up again lets the reference end once more.
        faults = len(robot.told) // 2
        assert faults >= 2
        assert robot.told == ['active', 'fault: no reference for 0.2 s'] * faults + ['active']
        robot.end()
