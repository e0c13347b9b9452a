# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Report page in a browser: sorting, ordinates that follow the zoom, names of events, print."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

from helpers.report_runs import paper_like, series, with_change
from helpers.webdriver import look, needs_webdriver
from masmc_ros.report.report import write_report
import numpy as np
import pytest

PEAK = -113.0

READ = """
  const torque = document.getElementById('run-1-torque');
  const errors = document.getElementById('run-1-error_E');
  const table = document.getElementById('metrics');
  const column = () => [...table.tBodies[0].rows].map((row) => row.cells[1].textContent);
  const heads = [...table.tHead.rows[0].cells];
  const button = heads[1].querySelector('button');
  const found = { rows: [column()], sorts: [] };
  for (let i = 0; i < 2; i += 1) {
    button.focus();
    button.click();
    found.rows.push(column());
    found.sorts.push(heads[1].getAttribute('aria-sort'));
  }
  found.isButton = document.activeElement === button;
  const links = [...document.querySelectorAll('nav a')];
  found.heights = links.map((link) => link.getBoundingClientRect().height);
  const state = (chart) => ({
    range: [...chart.layout.yaxis.range],
    notes: (chart.layout.annotations ?? []).map((note) => note.text),
    boxes: [...chart.querySelectorAll('.textpoint text')].map((text) => {
      const { left, right } = text.getBoundingClientRect();
      return [left, right];
    }),
    text: chart.data.at(-1).text,
    edge: chart.getBoundingClientRect().right,
  });
  found.whole = state(torque);
  await Plotly.relayout(errors, { 'xaxis.range[0]': 0, 'xaxis.range[1]': 0.05 });
  await settle();
  found.start = state(torque);
  await Plotly.relayout(errors, { 'xaxis.range[0]': 10, 'xaxis.range[1]': 11 });
  await settle();
  found.later = state(torque);
  found.errors = state(errors);
  await Plotly.relayout(errors, { 'xaxis.range[0]': 0, 'xaxis.range[1]': 20 });
  await settle();
  found.again = state(torque);
  const colour = () => torque.querySelector('.js-line').style.stroke;
  found.colours = [colour()];
  dispatchEvent(new Event('beforeprint'));
  found.colours.push(colour());
  const drawings = [...torque.querySelectorAll('.main-svg')];
  found.viewBoxes = drawings.map((svg) => svg.getAttribute('viewBox'));
  dispatchEvent(new Event('afterprint'));
  found.colours.push(colour());
"""


@pytest.fixture(scope='module')
def found(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Any]:
    """Return the results of READ on a dark page of three runs with a peak and many changes."""
    run = paper_like('a.mcap', k_s1=2.0)
    torque = run.torque.values.copy()
    torque[1, 2] = PEAK
    run = replace(run, torque=series(run.torque.times, torque))
    for time in (5.0, 5.7, 6.4, 18.0, 19.5):
        run = with_change(run, time, 'controller', sigma=time, boundary_layer=time)
    folder = tmp_path_factory.mktemp('report')
    others = [paper_like(f'{gain}.mcap', k_s1=gain) for gain in (10.0, 1.0)]
    write_report([run, *others], folder)
    dark = '--blink-settings=preferredColorScheme=0'
    return look(folder / 'report.html', READ, folder, dark)


@needs_webdriver
def test_report_table_sorts_by_number(found: Mapping[str, Any]) -> None:
    assert found['problems'] == []
    assert found['rows'][1:] == [['1', '2', '10'], ['10', '2', '1']]
    assert found['sorts'] == ['ascending', 'descending']
    assert found['isButton']


@needs_webdriver
def test_report_links_of_runs_fit_fingers(found: Mapping[str, Any]) -> None:
    # The smallest target of a touch in WCAG 2.2, success criterion 2.5.8, in CSS pixels.
    assert len(found['heights']) == 3
    assert min(found['heights']) >= 24.0


@needs_webdriver
def test_report_ordinate_follows_zoom(found: Mapping[str, Any]) -> None:
    low, high = found['whole']['range']
    assert -1.0 < low < 1.0 < 3.0 < high < 4.0
    assert found['whole']['notes'] == ['peak −113 N·m at 0.010 s, arm joint 1']
    assert found['start']['range'][0] < PEAK
    assert found['start']['notes'] == []
    # Torques are 2 + sin(t), from 10 s to 11 s.
    np.testing.assert_allclose(found['later']['range'], [1.0, 1.46], atol=0.1)
    assert max(map(abs, found['errors']['range'])) < 10.0
    assert found['again'] == found['whole']


@needs_webdriver
@pytest.mark.parametrize('state', ['whole', 'later', 'again'])
def test_report_names_of_events_do_not_overlap(found: Mapping[str, Any], state: str) -> None:
    boxes = sorted(box for box in found[state]['boxes'] if box[1] > box[0])
    assert state == 'later' or boxes
    for (_, end), (start, _) in pairwise(boxes):
        assert end <= start
    assert all(right <= found[state]['edge'] for _, right in boxes)


@needs_webdriver
def test_report_print_has_light_colours(found: Mapping[str, Any]) -> None:
    dark, light, again = found['colours']
    assert dark == again == 'rgb(74, 168, 224)'
    assert light == 'rgb(0, 114, 178)'
    assert all(box.startswith('0 0 ') for box in found['viewBoxes'])
