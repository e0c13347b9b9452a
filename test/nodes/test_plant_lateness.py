# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Lateness of the plant: share of late ticks, lost time, and the remedy in the report."""

from __future__ import annotations

from pathlib import Path
import signal
import time

from diagnostic_msgs.msg import DiagnosticArray
from helpers.processes import peer, processes, ros_arguments
from masmc_ros.nodes.plant.health import PlantHealth
from masmc_ros.nodes.process.base import Health, OK, RejectedMessages, WARN
from masmc_ros.plant.plant_core import Lateness, TOLERATED_SHARE
import pytest

SHARE = 'late ticks in the last second (%)'
BEHIND = "robot's time behind in the last second (s)"
OLDER = 'ticks under an older command in the last second (%)'


def report(health: PlantHealth, ticks: int) -> Health:
    return health.report(
        None, [], RejectedMessages(None), state='real time',
        ticks=ticks, dropped=0, command_age=0.0, slip=None,
    )  # fmt: skip


@pytest.mark.parametrize(('late', 'level'), [(0, OK), (2, OK), (3, WARN), (100, WARN)])
def test_lateness_above_limit_warns(late: int, level: bytes) -> None:
    assert TOLERATED_SHARE == 0.02
    lateness = Lateness(0.01)
    health = PlantHealth(0.01, lateness)
    for _ in range(100):
        lateness.add_tick(is_older=False)
    lateness.add_late(late)
    diagnostics = report(health, 100)
    assert diagnostics.level == level
    assert diagnostics.values['late ticks'] == str(late)
    assert diagnostics.values[SHARE] == f'{late:.1f}'
    if level == WARN:
        for words in (f'late ticks: {late:.1f} %', 'expected at most 2 %', 'control_period'):
            assert words in diagnostics.message
        assert len(diagnostics.message.splitlines()) == 1
    # The next second is punctual; the total stays.
    lateness.add_tick(is_older=False)
    after = report(health, 101)
    assert (after.level, after.values['late ticks'], after.values[SHARE]) == (OK, str(late), '0.0')


def test_lateness_time_given_up_reported() -> None:
    lateness = Lateness(0.01)
    for number in range(60):
        lateness.add_tick(is_older=number < 15)
    lateness.add_late(40)
    lateness.add_skipped(40)
    figures, warning = lateness.report(1.0)
    assert (figures[SHARE], figures[BEHIND], figures[OLDER]) == ('40.0', '0.400', '25.0')
    assert 'fell behind by 0.400 s' in warning


def test_lateness_paused_plant_zero() -> None:
    figures, warning = Lateness(0.001).report(1.0)
    assert (figures[SHARE], figures[BEHIND], figures[OLDER], warning) == (
        '0.0',
        '0.000',
        '0.0',
        '',
    )


def test_plant_stopped_process_reports_lateness(tmp_path: Path) -> None:
    with processes(tmp_path) as started, peer(started.domain) as tester:
        reports: list[dict[str, str]] = []
        warnings: list[str] = []

        def on_health(message: DiagnosticArray) -> None:
            for status in message.status:
                if status.name == '/plant':
                    reports.append({v.key: v.value for v in status.values})
                    if status.level == WARN and 'late ticks: ' in status.message:
                        warnings.append(status.message)

        tester.subscribe(DiagnosticArray, '/diagnostics', on_health)
        nodes = started.start_all(*ros_arguments(None, wait_for='[]'), nodes=('plant',))
        tester.until(lambda: reports and float(reports[-1]['rate (1/s)']) > 10.0, 'motion')
        warnings.clear()
        nodes['plant'].signal(signal.SIGSTOP)
        time.sleep(0.3)
        nodes['plant'].signal(signal.SIGCONT)
        tester.until(lambda: warnings, 'a warning')
        tester.until(lambda: any(float(r[BEHIND]) > 0.2 for r in reports), 'the time behind')
        tester.until(lambda: float(reports[-1][SHARE]) <= 2.0, 'a punctual second')
