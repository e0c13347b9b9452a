# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""What a recorder misses is told in the log, on /diagnostics and in the report."""

from __future__ import annotations

from pathlib import Path
import shutil
import signal

from diagnostic_msgs.msg import DiagnosticArray
from masmc_ros.cli.main import main
from masmc_ros.log.read.gaps import MISSING, state_gaps
from masmc_ros.log.read.reader import read_run
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.nodes.middleware.qos import subscription_qos
from masmc_ros.report.measure.missing import missing
from masmc_ros.report.measure.tracking import tracking
from processes import peer, processes
import pytest
from sensor_msgs.msg import JointState
from test_recorder_killed import recorder, ROBOT

PERIOD = 10**6
HELD_UP = 8 * 10**9
"""Time in ns of the robot for which the recorder stands still: more than buffers can hold."""


def on_disk(log: Path, reports: list[DiagnosticArray]) -> int:
    """Return how many states are missing in what is in the file; once with every report."""
    if not reports:
        return 0
    reports.clear()
    copy = log.with_name('copy.mcap')
    shutil.copy(log, copy)
    main(['recover', str(copy)])
    return sum(gaps.missing for gaps in state_gaps(copy).values())


@pytest.mark.slow
@pytest.mark.parametrize('ends', ['cut off', 'complete'])
def test_a_recorder_that_was_held_up_tells_what_is_missing(
    ends: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / 'run.mcap'
    health: dict[str, str] = {}
    with processes(tmp_path) as started, peer(started.domain) as tester:
        latest = [0]
        reports: list[DiagnosticArray] = []

        def note(raw: bytes) -> None:
            latest[-1] = header_stamp(raw)

        def on_health(report: DiagnosticArray) -> None:
            for status in report.status:
                if status.name == '/recorder':
                    health.update({each.key: each.value for each in status.values})
                    reports.append(report)

        qos = subscription_qos()
        tester.node.create_subscription(JointState, 'joint_states', note, qos, raw=True)
        tester.subscribe(DiagnosticArray, '/diagnostics', on_health)
        started.start('plant', *ROBOT)
        node = started.start('recorder', *recorder(log))
        tester.until(lambda: health.get('messages', '0') != '0', 'messages recorded')
        before = int(health['missing by their stamps'])
        node.signal(signal.SIGSTOP)
        moment = latest[-1] + HELD_UP
        tester.until(lambda: latest[-1] > moment, 'the robot moves on')
        node.signal(signal.SIGCONT)
        tester.until(
            lambda: int(health['missing by their stamps']) > before + 1000, 'missing states told'
        )
        if ends == 'complete':
            node.signal(signal.SIGTERM)
            assert node.wait() == 0
            assert node.logged('WARN', 'missing in')
        else:
            # A flush later, which a busy machine may hold up: a copy of the file tells.
            tester.until(lambda: on_disk(log, reports) > 1000, 'the gap on the disk')
            node.signal(signal.SIGKILL)
            node.wait()
            capsys.readouterr()
    if ends == 'cut off':
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
    if ends == 'complete':
        assert run.metadata[MISSING] == [{'/joint_states': text}]
    # The report of every second is in the log, whatever becomes of the recorder.
    assert run.topics['/diagnostics'] > 0
