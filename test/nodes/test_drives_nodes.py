# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Nodes: enabling of the controller, source of the reference, and custom joint names."""

from __future__ import annotations

import csv
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

from helpers.log_contents import read_log
from helpers.processes import NODES, PAPER, Peer, peer, processes, ros_arguments
from masmc_ros.cli.main import main
from masmc_ros.log.read.reader import read_run
from masmc_ros.loop.controller_events import ACTIVATED, DEACTIVATED
from masmc_ros.messages.commands import EffortCdr
import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool

NAMES = ('base_x', 'base_y', 'yaw', 'front/right', 'front/left', 'shoulder', 'elbow')
RATE_LIMIT = 1000.0
PERIOD = 0.001


class Lockstep:
    """Run of the paper in lockstep, with interventions of the test."""

    def __init__(self, tester: Peer) -> None:
        self.tester = tester
        self.stamps = tester.watch_time()
        self.void = 0
        self._command = EffortCdr()
        tester.subscribe(Float64MultiArray, 'effort_commands', self._on_command, raw=True)

    def _on_command(self, raw: bytes) -> None:
        assert self._command.load(raw)
        self.void = self.void + 1 if self._command.is_void else 0

    def wait_for_void_commands(self, count: int) -> None:
        """Wait for that many void commands in a row; odometry may still be in the queue."""
        self.tester.until(lambda: self.void >= count, 'void commands')

    def wait_for_progress(self, seconds: float) -> None:
        start = self.stamps[-1]
        self.tester.until(lambda: self.stamps[-1] > start + 1e9 * seconds, 'progress of the run')

    def enable(self, value: bool) -> None:
        answer = self.tester.call(SetBool, '/controller/enable', SetBool.Request(data=value))
        assert answer.success


@pytest.mark.slow
def test_lockstep_enable_and_set_point_run_reproducible(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / 'run.mcap'
    with processes(tmp_path) as started, peer(started.domain) as tester:
        run = Lockstep(tester)
        description = tester.collect(String, 'robot_description')
        states = tester.collect(JointState, 'joint_states')
        nodes = started.start_all(
            *ros_arguments(
                PAPER,
                **{f'{node}__duration': 16.0 for node in NODES},
                plant__wait_for='[controller, trajectory, recorder, peer]',
                recorder__output=log,
                controller__torque_rate_limit=RATE_LIMIT,
                controller__fault_action='void',
                **{'robot.joint_names': f'[{", ".join(NAMES)}]'},
            )
        )
        run.wait_for_progress(2.0)
        tester.known_client(SetBool, '/controller/enable')
        for value in (False, True, False, True):
            run.enable(value)
        run.wait_for_progress(1.0)
        # A set-point during a trajectory is rejected with a message and changes nothing.
        points = tester.publisher(Float64MultiArray, 'reference')
        tester.wait_for_subscribers(points, 2)
        points.publish(Float64MultiArray(data=[0.3, 0.5, 0.0, 0.0]))
        rejection = 'reference rejected: a set-point while a trajectory runs'
        tester.until(lambda: nodes['controller'].logged('ERROR', rejection), rejection)
        run.enable(False)
        run.wait_for_void_commands(1200)
        run.enable(True)
        assert set(started.wait().values()) == {0}, started.output()
        assert 'Traceback' not in started.output()
        assert tuple(states[0].name) == NAMES
        joints = ElementTree.fromstring(description[0].data).findall('joint')
        assert [joint.get('name') for joint in joints][:4] == list(NAMES[3:])
    logged = read_run(log)
    assert logged.joint_names == NAMES
    events = [change.event for change in logged.changes]
    # A controller that was disabled and enabled between two ticks reports only the latter.
    assert events.count(ACTIVATED) >= 2
    assert (DEACTIVATED, DEACTIVATED) not in pairwise(events)
    assert events[-2:] == [DEACTIVATED, ACTIVATED]
    check_stop_and_return(log)
    # The deviation has decayed at the end.
    assert np.abs(logged.telemetry['error'].values[-1]).max() < 0.05

    again = tmp_path / 'again.mcap'
    assert main(['simulate', str(log), '--output', str(again)]) == 0
    out = capsys.readouterr().out
    assert 'are bitwise identical' in out, out
    assert 'the others differ' not in out
    for topic in ('joint_states', 'effort_commands', 'controller/tracking_error'):
        assert read_log(again).messages[topic] == read_log(log).messages[topic], topic
    assert main(['export', str(again), '--output', str(tmp_path)]) == 0
    with (tmp_path / 'again.csv').open(encoding='utf-8') as stream:
        header = next(csv.reader(line for line in stream if not line.startswith('#')))
    assert 'position_front/right_rad' in header
    assert 'velocity_elbow_rad_per_s' in header


def check_stop_and_return(log: Path) -> None:
    """Check the commands and the motion of the robot while the controller is disabled."""
    run = read_run(log)
    message = EffortCdr()
    before, longest = np.zeros(4), 0
    held: list[int] = []
    for k, raw in enumerate(read_log(log).messages['effort_commands']):
        assert message.load(raw)
        torque = message.data.copy()
        if message.is_void:
            assert not torque.any()
            held.append(k)
        else:
            if k > 1:
                # The torque starts at zero when the robot is at rest.
                assert (np.abs(torque - before) <= RATE_LIMIT * PERIOD + 1e-9).all(), k
            assert k < 1000 or (np.abs(torque) < [4.0, 4.0, 10.0, 8.0]).all(), k
            longest = max(longest, len(held))
            if len(held) > 1000:
                positions = run.position[held[0]:k, 5:]
                assert np.ptp(positions, axis=0).max() < 0.1
            held = []
        before = torque
    assert longest > 1000


@pytest.mark.slow
def test_real_time_drives_without_command_hold_velocity(tmp_path: Path) -> None:
    """The drives hold before the first command and after a command timeout."""
    with processes(tmp_path) as started, peer(started.domain) as tester:
        states = tester.collect(JointState, 'joint_states')
        node = started.start(
            'plant',
            *ros_arguments(
                PAPER,
                pacing='realtime',
                duration=0.0,
                control_period=0.01,
                wait_for="['']",
                command_timeout=0.3,
            ),
        )

        def arm(first: int) -> np.ndarray:
            return np.array([list(state.position)[5:] for state in states[first:]])

        commands = tester.publisher(Float64MultiArray, 'effort_commands')
        tester.wait_for_subscribers(commands)
        tester.until(lambda: len(states) > 200, 'time')
        assert np.ptp(arm(0), axis=0).max() < 0.1
        zero = Float64MultiArray(data=[0.0] * 4)

        def is_free() -> bool:
            commands.publish(zero)
            return bool(np.abs(np.array(states[-1].velocity[5:])).max() > 1.0)

        tester.until(is_free, 'a free arm')
        warning = 'no command on effort_commands for 0.3 s; the drives hold until one comes'
        tester.until(lambda: node.logged('WARN', warning), warning)
        # Within one second a free arm turns by more.
        tester.until(lambda: np.ptp(arm(-100), axis=0).max() < 0.1, 'a held arm')
        assert all(not any(state.effort) for state in states)
        node.signal(2)  # SIGINT
        assert node.wait() == 0, started.output()


@pytest.mark.parametrize(
    'names', ["''", '[a, b, c]', '[a, b, c, c]', "[a, b, c, '']", '[x, b, z, w, a, c, x]']
)
def test_simulate_invalid_joint_names_rejected(
    names: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['simulate', str(PAPER), '--set', f'robot.joint_names={names}']) == 2
    err = capsys.readouterr().err
    assert 'robot.joint_names = ' in err
    assert 'expected 7 different names, or 4 of the driven joints alone' in err
    assert len(err.splitlines()) == 1
