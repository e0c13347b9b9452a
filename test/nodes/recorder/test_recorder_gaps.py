# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Messages that a recorder misses are reported in the log, on /diagnostics and in the report."""

from __future__ import annotations

from pathlib import Path
import shutil
import signal

from diagnostic_msgs.msg import DiagnosticArray
from helpers.processes import peer, processes
from masmc_ros.cli.main import main
from masmc_ros.log.read.gaps import MISSING, state_gaps
from masmc_ros.log.read.reader import read_run
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.nodes.middleware.ros_topics import subscription_qos
from masmc_ros.report.measure.findings import missing
from masmc_ros.report.measure.tracking import tracking
import pytest
from sensor_msgs.msg import JointState
from test_recorder_killed import recorder, ROBOT

PERIOD = 10**6
DELAY = 8 * 10**9
"""Robot time in ns for which the recorder is stopped: longer than its buffers."""


def on_disk(log: Path, reports: list[DiagnosticArray]) -> int:
    """Return the number of missing states in the file, once per report."""
    if not reports:
        return 0
    reports.clear()
    copy = log.with_name('copy.mcap')
    shutil.copy(log, copy)
    main(['recover', str(copy)])
    return sum(gaps.missing for gaps in state_gaps(copy).values())


@pytest.mark.slow
@pytest.mark.parametrize('ending', ['truncated', 'complete'])
def test_recorder_delayed_missing_states_reported(
    ending: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / 'run.mcap'
    health: dict[str, str] = {}
    with processes(tmp_path) as started, peer(started.domain) as tester:
        latest = [0]
        reports: list[DiagnosticArray] = []

        def store_stamp(raw: bytes) -> None:
            latest[-1] = header_stamp(raw)

        def on_health(report: DiagnosticArray) -> None:
            for status in report.status:
                if status.name == '/recorder':
                    health.update({pair.key: pair.value for pair in status.values})
                    reports.append(report)

        qos = subscription_qos()
        tester.node.create_subscription(JointState, 'joint_states', store_stamp, qos, raw=True)
        tester.subscribe(DiagnosticArray, '/diagnostics', on_health)
        started.start('plant', *ROBOT, '-p', 'control_period:=0.001')
        node = started.start('recorder', *recorder(log))
        tester.until(lambda: health.get('messages', '0') != '0', 'messages recorded')
        previous = int(health['missing by their stamps'])
        node.signal(signal.SIGSTOP)
        moment = latest[-1] + DELAY
        tester.until(lambda: latest[-1] > moment, 'further states')
        node.signal(signal.SIGCONT)
        tester.until(
            lambda: int(health['missing by their stamps']) > previous + 1000,
            'reported missing states',
        )
        if ending == 'complete':
            node.signal(signal.SIGTERM)
            assert node.wait() == 0
            assert node.logged('WARN', 'missing in')
        else:
            # The next flush may be late on a busy machine; a copy of the file shows it.
            tester.until(lambda: on_disk(log, reports) > 1000, 'the gap on the disk')
            node.signal(signal.SIGKILL)
            node.wait()
            capsys.readouterr()
    if ending == 'truncated':
        assert main(['recover', str(log)]) == 0
        assert 'joint_states: ' in capsys.readouterr().out
    run = read_run(log)
    (gaps,) = state_gaps(log).values()
    # Every state is in the log or counted as missing.
    span = round((run.times[-1] - run.times[0]) * 1e9 / PERIOD) + 1
    assert len(run.times) + gaps.missing == span
    assert gaps.missing > 1000
    text = gaps.text()
    assert f'joint_states: {text}, by its stamps.' in missing(run, tracking(run))
    if ending == 'complete':
        assert run.metadata[MISSING] == [{'/joint_states': text}]
    # The report of every second is in the log, even if the recorder is killed.
    assert run.topics['/diagnostics'] > 0
