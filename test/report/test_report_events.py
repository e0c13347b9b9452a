# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Report of limited torques, resets and activations."""

from __future__ import annotations

from dataclasses import replace

from helpers.report_html import lines, Page
from helpers.report_runs import paper_like, telling, with_change
from masmc_ros.log.read.reader import Run
from masmc_ros.loop.controller_events import ACTIVATED, ADAPTATION_RESET, DEACTIVATED
from masmc_ros.report.digest import digests_of
from masmc_ros.report.measure.labels import labels
from masmc_ros.report.measure.metrics import metrics
from masmc_ros.report.page.page import report_page
import numpy as np


def page(run: Run) -> Page:
    return Page(report_page(labels([run]), digests_of([run]), [0]))


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
    run = event(with_change(run, 9.0, 'controller', k_s1=1.0), 9.0, ACTIVATED)
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
        ['9.000', '900', 'controller', 'k_s1', '100.0', '1.0'],
        ['9.000', '900', 'controller', 'activated', '', ''],
    ]


def test_report_page_many_changes_share_marks() -> None:
    run = paper_like(k_s1=100.0)
    for index in range(200):
        run = with_change(run, 1.0 + 0.01 * index, 'controller', k_s1=float(index))
    shown = page(run)
    figure = shown.figure('run-1-torque')
    (mark,) = (t for t in figure['data'] if t['mode'] != 'lines')
    assert mark['text'][0].startswith('k_s1 (')
    assert len(mark['x']) == len(figure['layout']['shapes']) < 10
    _, *rows = shown.table(**{'class': 'changes'})
    assert len(rows) == 200


def test_metrics_notes_list_last_events_and_count_earlier() -> None:
    run = paper_like(k_s1=100.0)
    for time, name in (
        (1.0, DEACTIVATED), (2.0, ACTIVATED), (3.0, ADAPTATION_RESET), (4.0, DEACTIVATED)
    ):  # fmt: skip
        run = event(run, time, name)
    assert metrics(run).notes == (
        '1 earlier event of the controller before these:',
        'Event activated at t = 2.000 s.',
        'Event adaptation reset at t = 3.000 s.',
        'Event deactivated at t = 4.000 s.',
    )
    # With the states of the controller, their reasons replace the events.
    states = (run.times[0], 'active'), (run.times[0] + 1.5, 'fault: stop'), (9.0, 'active')
    assert metrics(replace(run, controller_states=states)).notes == (
        'Controller fault: stop, from t = 1.500 s to 9.000 s.',
        'Event adaptation reset at t = 3.000 s.',
    )


def test_report_page_notes_are_apart_from_missing_data() -> None:
    shown = page(event(paper_like(k_s1=100.0), 2.0, DEACTIVATED))
    (remarks,) = shown.root.find_all('div', **{'class': 'remarks'})
    assert 'Event deactivated at t = 2.000 s.' in remarks.text
    for box in shown.root.find_all('div', **{'class': 'missing'}):
        assert 'Event' not in box.text
