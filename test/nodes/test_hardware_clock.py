# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Controller with repeated, late and unordered states, and with a clock that jumps.

The test is the robot: it stands still, and publishes a state at every tick.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import signal
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from helpers.checked_log import check_log, LIMIT
from helpers.processes import NodeProcess, Peer, peer, Processes, processes, ros_arguments
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.messages.joint_state import JointStateCdr
import numpy as np
from numpy.typing import NDArray
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
    Robot that stands still independently of commands.

    Attributes
    ----------
    stamp
        latest published stamp in ns.
    answers
        all commands, by the stamp in ns that they answer.
    states
        all texts of `controller/state`.

    """

    def __init__(self, tester: Peer, folder: Path, nodes: dict[str, NodeProcess]) -> None:
        self.tester = tester
        self.folder = folder
        self.nodes = nodes
        self.stamp = START
        self.answers: dict[int, list[NDArray[np.float64]]] = {}
        self.health: dict[str, str] = {}
        self._reported = 0
        self.states: list[str] = []
        self._state, self._command = JointStateCdr(), EffortCdr()
        self._state.position[:] = [0.0, 0.0, np.pi / 2, 0.0, 0.0, np.pi / 4, -np.pi / 2]
        self._states = tester.publisher(JointState, 'joint_states')
        tester.subscribe(Float64MultiArray, 'effort_commands', self._on_command, raw=True)
        tester.subscribe(String, 'controller/state', lambda m: self.states.append(m.data))
        tester.subscribe(DiagnosticArray, '/diagnostics', self._on_health)
        tester.until(lambda: self._listeners() >= set(NODES), 'all nodes')
        tester.wait_for_subscribers(self._states, len(NODES))

    def _listeners(self) -> set[str]:
        topic = self._states.topic_name
        return {info.node_name for info in self.tester.node.get_subscriptions_info_by_topic(topic)}

    def send(self, stamp: int) -> None:
        """Send the state with a stamp in ns."""
        self._state.set_stamp(stamp)
        self._states.publish(self._state.to_bytes())
        self.stamp = stamp

    def ticks(self, stamp: int, count: int = 1) -> NDArray[np.float64]:
        """Send states from a stamp, each after the last answer; return the last torque."""
        for tick in range(count):
            current = stamp + tick * PERIOD
            self.send(current)
            self.tester.until(lambda t=current: t in self.answers, f'an answer to {current}')
        return self.answers[self.stamp][-1]

    def counted(self, key: str) -> int:
        """Return a figure of the controller's next report."""
        now = time.time_ns()
        self.tester.until(lambda: self._reported > now, 'a report')
        return int(self.health[key])

    def counts(self, key: str, count: int) -> None:
        """Wait until a figure of a new report has a value."""
        self.tester.until(lambda: self.counted(key) == count, f'{count} {key}')

    def end(self) -> None:
        """End all nodes, and check all torques and the log."""
        for node in self.nodes.values():
            node.signal(signal.SIGINT)
        assert {node.wait() for node in self.nodes.values()} == {0}
        for torques in self.answers.values():
            for torque in torques:
                assert np.all(np.abs(torque) <= LIMIT)
        check_log(self.folder / 'run.mcap', states=self.states)

    def _on_command(self, raw: bytes) -> None:
        assert self._command.load(raw)
        assert self._command.stamp_ns is not None
        self.answers.setdefault(self._command.stamp_ns, []).append(self._command.data.copy())

    def _on_health(self, message: DiagnosticArray) -> None:
        if message.status[0].name.strip('/') != 'controller':
            return
        self.health = {pair.key: pair.value for pair in message.status[0].values}
        stamp = message.header.stamp
        self._reported = stamp.sec * 10**9 + stamp.nanosec


@contextmanager
def still_robot(folder: Path, **settings: Any) -> Iterator[tuple[Processes, StillRobot]]:
    """Yield a robot with an active controller, on a path that starts at the robot."""
    values: dict[str, Any] = {
        'pacing': 'realtime',
        'control_period': PERIOD * 1e-9,
        'duration': 0.0,
        'trajectory__start_time': -1.0,
        'controller__torque_limit': str(LIMIT.tolist()),
        # The robot waits for every answer, which may take long on a busy machine.
        'controller__state_timeout': 60.0,
        # The robot does not move; therefore its error grows.
        'controller__runaway_detection': 'false',
        'recorder__output': folder / 'run.mcap',
        **settings,
    }
    with processes(folder) as started, peer(started.domain) as tester:
        nodes = started.start_all(*ros_arguments(**values), nodes=NODES)
        robot = StillRobot(tester, folder, nodes)
        tester.until(lambda: robot.states == ['active'], 'an active controller')

        def has_answer() -> bool:
            robot.send(robot.stamp + PERIOD)
            tester.until(lambda: True)
            return bool(robot.answers)

        tester.until(has_answer, 'the first answer')
        robot.ticks(robot.stamp + PERIOD, 20)
        yield started, robot


@pytest.mark.slow
def test_controller_repeated_and_late_states_counted(tmp_path: Path) -> None:
    with still_robot(tmp_path) as (_, robot):
        first_stamp = robot.stamp + PERIOD
        late, repeated = robot.counted('late states'), robot.counted('repeated states')
        first = robot.ticks(first_stamp)
        for count in (2, 3):
            robot.send(first_stamp)
            robot.tester.until(
                lambda n=count: len(robot.answers[first_stamp]) == n, 'the same answer'
            )
        assert all(np.array_equal(torque, first) for torque in robot.answers[first_stamp])
        robot.counts('repeated states', repeated + 2)

        # The third state arrives after the fourth, and again after the fifth.
        robot.ticks(first_stamp + PERIOD)
        robot.ticks(first_stamp + 3 * PERIOD)
        robot.send(first_stamp + 2 * PERIOD)
        robot.counts('late states', late + 1)
        robot.ticks(first_stamp + 4 * PERIOD)
        robot.send(first_stamp + 2 * PERIOD)
        robot.counts('late states', late + 2)
        robot.send(first_stamp)
        robot.counts('late states', late + 3)
        robot.ticks(first_stamp + 5 * PERIOD, 20)
        assert first_stamp + 2 * PERIOD not in robot.answers
        assert len(robot.answers[first_stamp]) == 3
        assert robot.counted('gaps in states') == 0
        assert robot.states == ['active']
        robot.end()


@pytest.mark.slow
def test_controller_clock_jumps_by_one_hour_restarts(tmp_path: Path) -> None:
    """The controller restarts after each jump, with small torques and a log line."""
    with still_robot(tmp_path) as (_, robot):
        controller = robot.nodes['controller']
        calm = np.abs(robot.ticks(robot.stamp + PERIOD, 50)).max()
        robot.ticks(robot.stamp + HOUR, 50)
        robot.counts('gaps in states', 1)
        assert controller.logged('WARN', 'the controller restarts')
        # Two hours earlier is before the start of the path.
        robot.ticks(robot.stamp - 2 * HOUR, 50)
        assert len(controller.logged('INFO', 'time was set back')) == 1
        torque = robot.tester.until(
            lambda: [t for t in [robot.ticks(robot.stamp + PERIOD, 10)] if t.any()],
            'a torque for the reference',
        )
        assert np.abs(torque).max() < 10.0 * calm + 1.0
        torque = robot.ticks(robot.stamp + PERIOD, 50)
        assert np.abs(torque).max() < 10.0 * calm + 1.0
        assert robot.nodes['trajectory'].logged('INFO', 'the path restarts')
        # A single wrong stamp has no effect on later states.
        last_stamp = robot.stamp
        for wrong in (last_stamp + HOUR, 0):
            robot.ticks(wrong)
            assert robot.ticks(last_stamp + PERIOD, 50).any()
            last_stamp = robot.stamp
        assert len(robot.nodes['trajectory'].logged('INFO', 'the path restarts')) == 1
        assert robot.states == ['active']
        robot.end()


@pytest.mark.slow
def test_controller_reference_timeout_ends_and_resumes(tmp_path: Path) -> None:
    """After the timeout the torque is zero and the fault is reported; the run then resumes."""
    with still_robot(tmp_path, controller__reference_timeout=0.2) as (started, robot):
        for number in (signal.SIGSTOP, signal.SIGKILL):
            robot.nodes['trajectory'].signal(number)

            def has_ended(robot: StillRobot = robot) -> bool:
                robot.ticks(robot.stamp + PERIOD, 10)
                return robot.states[-1].startswith('fault')

            robot.tester.until(has_ended, 'a fault')
            assert robot.states[-1] == 'fault: no reference for 0.2 s'
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
                return robot.states[-1] == 'active'

            robot.tester.until(is_back, 'a reference')
            robot.tester.until(
                lambda: robot.ticks(robot.stamp + PERIOD, 20).any(), 'torque for the reference'
            )
        # A further delay of the trajectory node may end the reference again.
        faults = len(robot.states) // 2
        assert faults >= 2
        assert robot.states == ['active', 'fault: no reference for 0.2 s'] * faults + ['active']
        robot.end()
