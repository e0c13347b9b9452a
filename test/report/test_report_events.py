# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Report of limited torques, resets and activations."""

from __future__ import annotations

from dataclasses import replace

from helpers.report_html import lines, Page
from helpers.report_runs import paper_like, telling, with_change
from masmc_ros.log.read.reader import Run
from masmc_ros.loop.controller_events import ACTIVATED, ADAPTATION_RESET
from masmc_ros.report.measure.labels import labels
from masmc_ros.report.measure.metrics import metrics
from masmc_ros.report.measure.tracking import Compared, tracking
from masmc_ros.report.page.page import report_page
import numpy as np


def page(run: Run) -> Page:
    (label,) = labels([run])
    return Page(report_page([Compared(label, run, tracking(run))], [metrics(run)]))


def with_limited_torque(run: Run) -> Run:
    """Return a run with limited torques of both arm joints at some ticks."""
    requested = run.torque.values[::2].copy()
    requested[100:200, 2] += 5.0
    requested[300, 3] -= 9.0
    return telling(run, raw_torque=(run.torque.times[::2], requested))


def event(run: Run, time: float, name: str) -> Run:
    """Return a run with a controller event at `time` s from its start."""
    changed = with_change(run, time, 'controller')
    return replace(changed, changes=(*run.changes, changed.changes[-1]._replace(event=name)))


def test_report_page_limited_torque_plots_requested_torque() -> None:
    run = with_limited_torque(paper_like())
    figure = page(run).figure('run-1-torque')
    drawn = {trace['name']: trace for trace in figure['data']}
    assert set(drawn) == {
        'right wheel', 'left wheel', 'arm joint 1', 'arm joint 2',
        'arm joint 1, requested', 'arm joint 2, requested',
    }  # fmt: skip
    raw = run.telemetry['raw_torque']
    samples = lines(figure)['arm joint 2, requested']
    np.testing.assert_array_equal(samples['y'], raw.values[:, 3].astype(np.float32))
    np.testing.assert_array_equal(samples['x'], raw.times)
    requested = drawn['arm joint 2, requested']
    assert requested['meta']['colour'] == drawn['arm joint 2']['meta']['colour']
    assert requested['line']['dash'] != drawn['arm joint 2']['line'].get('dash', 'solid')


def test_report_page_unlimited_torque_is_plotted_once() -> None:
    run = paper_like()
    run = telling(run, raw_torque=(run.torque.times, run.torque.values.copy()))
    assert len(page(run).figure('run-1-torque')['data']) == 4


def test_report_page_events_are_marked_separately_from_changes() -> None:
    run = event(paper_like(k_s1=100.0), 2.0, ADAPTATION_RESET)
    assert labels([run]) == labels([paper_like(k_s1=100.0)])
    run = event(with_change(run, 5.0, 'controller', k_s1=1.0), 5.0, ACTIVATED)
    shown = page(run)
    (mark,) = (t for t in shown.figure('run-1-torque')['data'] if t['mode'] != 'lines')
    assert mark['text'] == ['adaptation reset', 'k_s1, activated']
    assert mark['hovertext'] == [
        'controller: adaptation reset',
        'controller k_s1: 100.0 → 1.0<br>controller: activated',
    ]
    _, *rows = shown.table(**{'class': 'changes'})
    assert rows == [
        ['2.000', '200', 'controller', 'adaptation reset', '', ''],
        ['5.000', '500', 'controller', 'k_s1', '100.0', '1.0'],
        ['5.000', '500', 'controller', 'activated', '', ''],
    ]
