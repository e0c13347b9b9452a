# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Real nodes: who commands, whose reference is followed, and joints by names of their own."""

from __future__ import annotations

import csv
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

from log_contents import read_log
from masmc_ros.cli.main import main
from masmc_ros.log.read.reader import read_run
from masmc_ros.loop.controller_events import ACTIVATED, DEACTIVATED
from masmc_ros.messages.commands import EffortCdr
import numpy as np
from processes import NODES, PAPER, Peer, peer, processes, ros_arguments
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool

NAMES = ('base_x', 'base_y', 'yaw', 'front/right', 'front/left', 'shoulder', 'elbow')
RATE_LIMIT = 1000.0
PERIOD = 0.001


class Lockstep:
    """A run of the paper in lock-step, which the test disturbs on its way."""

    def __init__(self, tester: Peer) -> None:
        self.tester = tester
        self.stamps = tester.watch_time()

    def goes_on(self, seconds: float) -> None:
        begun = self.stamps[-1]
        self.tester.until(lambda: self.stamps[-1] > begun + 1e9 * seconds, 'the run to go on')

    def enable(self, value: bool) -> None:
        answer = self.tester.call(SetBool, '/controller/enable', SetBool.Request(data=value))
        assert answer.success


@pytest.mark.slow
def test_in_lockstep_disabled_enabled_and_given_a_set_point(
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
        run.goes_on(2.0)
        tester.known_client(SetBool, '/controller/enable')
        for value in (False, True, False, True):
            run.enable(value)
        run.goes_on(1.0)
        # Beside a running trajectory: refused, told, and nothing is different.
        points = tester.publisher(Float64MultiArray, 'reference')
        tester.wait_for_subscribers(points, 2)
        points.publish(Float64MultiArray(data=[0.3, 0.5, 0.0, 0.0]))
        refused = 'reference rejected: a set-point beside a trajectory'
        tester.until(lambda: nodes['controller'].logged('ERROR', refused), refused)
        run.enable(False)
        run.goes_on(1.5)
        run.enable(True)
        assert set(started.wait().values()) == {0}, started.output()
        assert 'Traceback' not in started.output()
        assert tuple(states[0].name) == NAMES
        joints = ElementTree.fromstring(description[0].data).findall('joint')
        assert [each.get('name') for each in joints][:4] == list(NAMES[3:])
    logged = read_run(log)
    assert logged.joint_names == NAMES
    events = [change.event for change in logged.changes]
    # Who was off and on again between two ticks was told to be on alone.
    assert events.count(ACTIVATED) >= 2
    assert (DEACTIVATED, DEACTIVATED) not in pairwise(events)
    assert events[-2:] == [DEACTIVATED, ACTIVATED]
    stands_and_comes_back(log)
    # The last of what was off its way is forgotten.
    assert np.abs(logged.telemetry['error'].values[-1]).max() < 0.05

    again = tmp_path / 'again.mcap'
    assert main(['simulate', str(log), '--output', str(again)]) == 0
    out = capsys.readouterr().out
    assert 'are the same bits' in out, out
    assert 'the others differ' not in out
    for topic in ('joint_states', 'effort_commands', 'controller/tracking_error'):
        assert read_log(again).messages[topic] == read_log(log).messages[topic], topic
    assert main(['export', str(again), '--output', str(tmp_path)]) == 0
    with (tmp_path / 'again.csv').open(encoding='utf-8') as stream:
        header = next(csv.reader(line for line in stream if not line.startswith('#')))
    assert 'position_front/right_rad' in header
    assert 'velocity_elbow_rad_per_s' in header


def stands_and_comes_back(log: Path) -> None:
    """Check what was commanded and what the robot did meanwhile."""
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
                # From rest it begins at zero.
                assert (np.abs(torque - before) <= RATE_LIMIT * PERIOD + 1e-9).all(), k
            assert k < 1000 or (np.abs(torque) < [4.0, 4.0, 10.0, 8.0]).all(), k
            longest = max(longest, len(held))
            if len(held) > 1000:
                positions = run.position[held[0]:k, 5:]
                assert np.ptp(positions, axis=0).max() < 0.1
            held = []
        before = torque
    assert longest > 1000


def test_by_the_wall_clock_the_drives_hold_where_no_command_is_in_force(tmp_path: Path) -> None:
    """Before the first command, and when the last is too old; under a command they let go."""
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

        tester.until(is_free, 'an arm that nobody holds')
        said = 'no command on effort_commands for 0.3 s; the drives hold until one comes'
        tester.until(lambda: node.logged('WARN', said), said)
        # For a second, in which a free arm turns by more.
        tester.until(lambda: np.ptp(arm(-100), axis=0).max() < 0.1, 'an arm that is held again')
        assert all(not any(state.effort) for state in states)
        node.signal(2)  # SIGINT
        assert node.wait() == 0, started.output()


@pytest.mark.parametrize(
    'names', ["''", '[a, b, c]', '[a, b, c, c]', "[a, b, c, '']", '[x, b, z, w, a, c, x]']
)
def test_names_that_are_none_are_refused(
    names: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['simulate', str(PAPER), '--set', f'robot.joint_names={names}']) == 2
    err = capsys.readouterr().err
    assert 'robot.joint_names = ' in err
    assert 'expected 7 different names, or 4 of the driven joints alone' in err
    assert len(err.splitlines()) == 1
