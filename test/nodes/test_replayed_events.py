# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Recomputation of lockstep runs with stops, starts and resets is bitwise identical."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from helpers.log_contents import read_log
from helpers.processes import NODES, PAPER, Peer, peer, Processes, processes, ros_arguments
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from masmc_ros.cli.main import main
from masmc_ros.log.read.reader import read_run
from masmc_ros.loop.controller_events import (
    ACTIVATED,
    ADAPTATION_RESET,
    DEACTIVATED,
    RELEASED,
)
from masmc_ros.messages.topics import TELEMETRY, telemetry_topic
import pytest
from std_srvs.srv import SetBool, Trigger

ADAPTIVE = {
    # A fixed reference: a robot without a controller stays near it.
    'trajectory__line_sine.slope': '[0.0, 0.0, 0.0, 0.0]',
    'trajectory__line_sine.amplitude': '[0.0, 0.0, 0.0, 0.0]',
    'plant__disturbance.amplitude': '[0.02, 0.02, 0.02, 0.02]',
    'controller__gamma': 0.1,
    'controller__switching': 'implicit',
    'controller__observer_gain': 0.5,
    'controller__torque_rate_limit': 1000.0,
}
LOAD = {'k_s1': 90.0, 'payload.mass': 0.2, 'payload.com': [0.02, 0.0, 0.0]}
"""Changes in one request, with an announced payload."""

SAME = ('joint_states', 'effort_commands', *map(telemetry_topic, TELEMETRY))


class Run:
    """Nodes of a lockstep run, with its progress."""

    def __init__(self, started: Processes, tester: Peer, log: Path, **settings: Any) -> None:
        self.tester = tester
        self._stamps = tester.watch_time()
        arguments = ros_arguments(
            PAPER,
            **{f'{node}__duration': 20.0 for node in NODES},
            plant__wait_for='[controller, trajectory, recorder, peer]',
            recorder__output=log,
            **settings,
        )
        self.nodes = started.start_all(*arguments)

    def wait_for_progress(self) -> None:
        """Wait until the robot's time has advanced by 0.25 s."""
        last = self._stamps[-1]
        self.tester.until(lambda: self._stamps[-1] > last + 250_000_000, 'progress of the run')

    def enable(self, value: bool) -> None:
        request = SetBool.Request(data=value)
        assert self.tester.call(SetBool, '/controller/enable', request).success

    def change(self, label: str) -> None:
        request = ChangeState.Request(transition=Transition(label=label))
        name = '/controller/change_state'
        assert self.tester.call(ChangeState, name, request, again=False).success

    def trigger(self, name: str) -> None:
        assert self.tester.call(Trigger, name, Trigger.Request(), again=False).success


def check_recomputed(log: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Recompute a run, and compare all messages of its last pass."""
    again = folder / 'again.mcap'
    assert main(['simulate', str(log), '--output', str(again)]) == 0
    assert 'are bitwise identical' in (out := capsys.readouterr().out), out
    assert 'the others differ' not in out
    live, computed = read_log(log), read_log(again)
    for topic in SAME:
        count = len(computed.messages[topic])
        assert count
        assert live.messages[topic][-count:] == computed.messages[topic], topic
    # The recomputed log can be recomputed as well.
    assert main(['simulate', str(again)]) == 0
    assert 'the others differ' not in capsys.readouterr().out


@pytest.mark.slow
def test_lockstep_run_with_events_equals_recomputed_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / 'run.mcap'
    with processes(tmp_path) as started, peer(started.domain) as tester:
        run = Run(started, tester, log, controller__active_on_start='false', **ADAPTIVE)
        run.wait_for_progress()
        run.enable(True)
        run.wait_for_progress()
        run.trigger('/controller/reset_adaptation')
        run.wait_for_progress()
        run.enable(False)
        run.tester.change('/controller', k_s1=80.0)
        run.wait_for_progress()
        run.enable(True)
        run.wait_for_progress()
        run.trigger('/controller/emergency_stop')
        run.enable(True)
        run.trigger('/controller/reset_adaptation')
        run.tester.change('/controller', **LOAD)
        run.wait_for_progress()
        run.trigger('/controller/emergency_stop')
        run.wait_for_progress()
        run.trigger('/controller/clear_fault')
        run.wait_for_progress()
        run.enable(True)
        assert set(started.wait().values()) == {0}, started.output()
    events = [change.event for change in read_run(log).changes]
    assert events.count(ACTIVATED) >= 3
    assert events.count(DEACTIVATED) >= 2
    assert events.count(ADAPTATION_RESET) == 2
    check_recomputed(log, tmp_path, capsys)


@pytest.mark.slow
def test_lockstep_lifecycle_equals_recomputed_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / 'run.mcap'
    with processes(tmp_path) as started, peer(started.domain) as tester:
        run = Run(started, tester, log, **ADAPTIVE)
        run.wait_for_progress()
        for transition in ('deactivate', 'cleanup', 'configure', 'activate', 'shutdown'):
            run.change(transition)
            run.wait_for_progress()
        assert set(started.wait().values()) == {0}, started.output()
    assert [change.event for change in read_run(log).changes] == [
        DEACTIVATED,
        RELEASED,
        DEACTIVATED,
        ACTIVATED,
        RELEASED,
        DEACTIVATED,
    ]
    check_recomputed(log, tmp_path, capsys)


@pytest.mark.slow
def test_lockstep_reset_while_disabled_equals_recomputed_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The last pass starts with the state of the disabled controller, not with its first state."""
    log = tmp_path / 'run.mcap'
    with processes(tmp_path) as started, peer(started.domain) as tester:
        run = Run(started, tester, log, **ADAPTIVE)
        run.wait_for_progress()
        run.enable(False)
        run.wait_for_progress()
        run.trigger('/plant/reset')
        run.wait_for_progress()
        run.enable(True)
        assert set(started.wait().values()) == {0}, started.output()
    assert [(change.tick > 0, change.event) for change in read_run(log).changes] == [
        (False, DEACTIVATED),
        (True, ACTIVATED),
    ]
    check_recomputed(log, tmp_path, capsys)
