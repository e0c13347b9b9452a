# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""A lock-step run that was stopped, started and reset on its way is computed again, bit by bit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from log_contents import read_log
from masmc_ros.cli.main import main
from masmc_ros.log.read.reader import read_run
from masmc_ros.loop.controller_events import ACTIVATED, ADAPTATION_RESET, DEACTIVATED
from masmc_ros.messages.names import TELEMETRY, telemetry_topic
from processes import NODES, PAPER, Peer, peer, Processes, processes, ros_arguments
import pytest
from std_srvs.srv import SetBool, Trigger

LEARNING = {
    # A place to stay at, so that a robot that nobody steers is not far from it.
    'trajectory__line_sine.slope': '[0.0, 0.0, 0.0, 0.0]',
    'trajectory__line_sine.amplitude': '[0.0, 0.0, 0.0, 0.0]',
    'plant__disturbance.amplitude': '[0.02, 0.02, 0.02, 0.02]',
    'controller__gamma': 0.1,
    'controller__switching': 'implicit',
    'controller__observer_gain': 0.5,
    'controller__torque_rate_limit': 1000.0,
}
SAME = ('joint_states', 'effort_commands', *map(telemetry_topic, TELEMETRY))


class Run:
    """Nodes of a lock-step run, whose progress the test watches."""

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

    def goes_on(self) -> None:
        """Wait until the robot's time has gone on by a quarter of a second."""
        last = self._stamps[-1]
        self.tester.until(lambda: self._stamps[-1] > last + 250_000_000, 'the run to go on')

    def enable(self, value: bool) -> None:
        request = SetBool.Request(data=value)
        assert self.tester.call(SetBool, '/controller/enable', request).success

    def trigger(self, name: str) -> None:
        assert self.tester.call(Trigger, name, Trigger.Request(), again=False).success


def is_the_same(log: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Compute a run again, and hold its last pass, message by message, against that."""
    again = folder / 'again.mcap'
    assert main(['simulate', str(log), '--output', str(again)]) == 0
    assert 'are the same bits' in (out := capsys.readouterr().out), out
    assert 'the others differ' not in out
    live, computed = read_log(log), read_log(again)
    for topic in SAME:
        count = len(computed.messages[topic])
        assert count
        assert live.messages[topic][-count:] == computed.messages[topic], topic
    # What was computed from a log can be computed from its own log.
    assert main(['simulate', str(again)]) == 0
    assert 'the others differ' not in capsys.readouterr().out


@pytest.mark.slow
def test_stopped_started_reset_and_changed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / 'run.mcap'
    with processes(tmp_path) as started, peer(started.domain) as tester:
        run = Run(started, tester, log, controller__active_on_start='false', **LEARNING)
        run.goes_on()
        run.enable(True)
        run.goes_on()
        run.trigger('/controller/reset_adaptation')
        run.goes_on()
        run.enable(False)
        run.tester.change('/controller', k_s1=80.0)
        run.goes_on()
        run.enable(True)
        run.goes_on()
        run.trigger('/controller/emergency_stop')
        run.enable(True)
        run.trigger('/controller/reset_adaptation')
        run.tester.change('/controller', k_s1=90.0)
        run.goes_on()
        run.trigger('/controller/emergency_stop')
        run.goes_on()
        run.trigger('/controller/clear_fault')
        run.goes_on()
        run.enable(True)
        assert set(started.wait().values()) == {0}, started.output()
    told = [each.event for each in read_run(log).changes]
    assert told.count(ACTIVATED) >= 3
    assert told.count(DEACTIVATED) >= 2
    assert told.count(ADAPTATION_RESET) == 2
    is_the_same(log, tmp_path, capsys)


@pytest.mark.slow
def test_a_robot_that_is_set_back_while_its_controller_rests(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The last pass counts; it begins as the controller was, not as it had been started."""
    log = tmp_path / 'run.mcap'
    with processes(tmp_path) as started, peer(started.domain) as tester:
        run = Run(started, tester, log, **LEARNING)
        run.goes_on()
        run.enable(False)
        run.goes_on()
        run.trigger('/plant/reset')
        run.goes_on()
        run.enable(True)
        assert set(started.wait().values()) == {0}, started.output()
    assert [(each.tick > 0, each.event) for each in read_run(log).changes] == [
        (False, DEACTIVATED),
        (True, ACTIVATED),
    ]
    is_the_same(log, tmp_path, capsys)
