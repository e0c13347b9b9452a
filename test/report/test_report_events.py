# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""What the report shows of limits that cut the torque, and of resets and activations."""

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


def cut(run: Run) -> Run:
    """Return a run whose law asked for more than was sent, of both arm joints at some ticks."""
    asked = run.torque.values[::2].copy()
    asked[100:200, 2] += 5.0
    asked[300, 3] -= 9.0
    return telling(run, raw_torque=(run.torque.times[::2], asked))


def event(run: Run, time: float, what: str) -> Run:
    """Return a run in which something happened to the controller, `time` in s from its start."""
    changed = with_change(run, time, 'controller')
    return replace(changed, changes=(*run.changes, changed.changes[-1]._replace(event=what)))


def test_what_the_law_asked_for_is_drawn_where_it_was_cut() -> None:
    run = cut(paper_like())
    figure = page(run).figure('run-1-torque')
    drawn = {trace['name']: trace for trace in figure['data']}
    assert set(drawn) == {
        'right wheel', 'left wheel', 'arm joint 1', 'arm joint 2',
        'arm joint 1, asked for', 'arm joint 2, asked for',
    }  # fmt: skip
    raw = run.telemetry['raw_torque']
    samples = lines(figure)['arm joint 2, asked for']
    np.testing.assert_array_equal(samples['y'], raw.values[:, 3].astype(np.float32))
    np.testing.assert_array_equal(samples['x'], raw.times)
    asked = drawn['arm joint 2, asked for']
    assert asked['meta']['colour'] == drawn['arm joint 2']['meta']['colour']
    assert asked['line']['dash'] != drawn['arm joint 2']['line'].get('dash', 'solid')


def test_what_was_not_cut_is_drawn_once() -> None:
    run = paper_like()
    run = telling(run, raw_torque=(run.torque.times, run.torque.values.copy()))
    assert len(page(run).figure('run-1-torque')['data']) == 4


def test_events_are_marked_and_are_no_changes_of_parameters() -> None:
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
