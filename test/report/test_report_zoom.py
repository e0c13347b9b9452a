# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Report plots at several zoom levels in a browser: drawn samples are those of the log."""

from __future__ import annotations

from collections.abc import Mapping
import json
from pathlib import Path
import re
from typing import Any

from helpers.report_runs import run_of, ticks
from helpers.webdriver import look, needs_webdriver
from masmc_ros.cli.main import main
from masmc_ros.log.read.reader import read_run, Run
from masmc_ros.report.measure.tracking import tracking
from masmc_ros.report.page.packed_samples import MOST
from masmc_ros.report.report import write_report
import numpy as np
import pytest

PAPER = Path(__file__).resolve().parents[2] / 'config' / 'paper.yaml'
START, END = 10.0, 10.1

# Samples drawn of the torques, for the whole run and for 0.1 s; then of the path.
ZOOM = """
  const chart = document.getElementById('run-1-torque');
  const drawn = (of) => of.data.filter((trace) => trace.mode === 'lines').map((trace) => ({
    x: [...trace.x], y: [...trace.y], fill: trace.fill,
  }));
  const corners = () => [...chart.querySelectorAll('.scatterlayer .js-line')].map(
    (line) => line.getAttribute('d'),
  );
  const found = { whole: drawn(chart), width: chart.clientWidth };
  const other = document.getElementById('run-1-error_E') ?? chart;
  await Plotly.relayout(other, { 'xaxis.range[0]': %f, 'xaxis.range[1]': %f });
  await settle();
  found.near = drawn(chart);
  found.corners = corners();
  await Plotly.relayout(other, { 'xaxis.range[0]': 0, 'xaxis.range[1]': 1e9 });
  await settle();
  found.again = drawn(chart);
  const path = document.getElementById('run-1-path');
  found.path = drawn(path);
  found.pixel = Math.max(...['x', 'y'].map((axis) => {
    const [from, to] = path.layout[`${axis}axis`].range;
    return (to - from) / path.clientWidth;
  }));
  const box = %s;
  await Plotly.relayout(path, {
    'xaxis.range[0]': box[0], 'xaxis.range[1]': box[1],
    'yaxis.range[0]': box[2], 'yaxis.range[1]': box[3],
  });
  await settle();
  found.piece = drawn(path);
  found.pieceRanges = [path.layout.xaxis.range, path.layout.yaxis.range];
"""


@pytest.fixture(scope='module')
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Return a run with a law that switches at every tick."""
    log = tmp_path_factory.mktemp('run') / 'sign.mcap'
    settings = ('controller.law=smc', 'controller.switching=sign', 'duration=12')
    options = [option for setting in settings for option in ('--set', setting)]
    assert main(['simulate', str(PAPER), *options, '--output', str(log)]) == 0
    return read_run(log)


def zoomed_report(
    run: Run, folder: Path, start: float, end: float, box: list[float]
) -> Mapping[str, Any]:
    """Write a report and return the results of ZOOM in it."""
    write_report([run], folder / 'report')
    script = ZOOM % (start, end, json.dumps(box))
    return look(folder / 'report' / 'report.html', script, folder)


@pytest.fixture(scope='module')
def zoom(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Any]:
    actual = tracking(run).actual
    assert actual is not None
    x, y = actual[np.searchsorted(run.times, 11.0), :2]
    box = [x - 5e-3, x + 5e-3, y - 5e-3, y + 5e-3]
    return zoomed_report(run, tmp_path_factory.mktemp('sign'), START, END, box)


def changes_of_sign(values: Any) -> int:
    """Return the number of zero crossings of a signal."""
    return int(np.count_nonzero(np.diff(np.sign(np.asarray(values, dtype=float)))))


@pytest.mark.slow
@needs_webdriver
def test_report_zoom_short_section_draws_every_sample(run: Run, zoom: Mapping[str, Any]) -> None:
    assert zoom['problems'] == []
    is_seen = (run.torque.times >= START) & (run.torque.times <= END)
    crossings = 0
    for drawn, torque, line in zip(
        zoom['near'], run.torque.values.T, zoom['corners'], strict=True
    ):
        x, y = np.array(drawn['x']), np.array(drawn['y'])
        inside = (x >= START) & (x <= END)
        np.testing.assert_array_equal(x[inside], run.torque.times[is_seen])
        np.testing.assert_array_equal(y[inside], torque[is_seen].astype(np.float32))
        assert x[0] < START  # the line enters from the left
        # The drawn polyline has at least as many corners.
        assert len(re.findall('[ML]', line)) >= np.count_nonzero(is_seen)
        crossings = max(crossings, changes_of_sign(y[inside]))
    assert crossings > 80, 'the law does not switch'


@pytest.mark.slow
@needs_webdriver
@pytest.mark.parametrize('which', ['whole', 'again'])
def test_report_zoom_whole_run_draws_extremes_per_pixel(
    run: Run, zoom: Mapping[str, Any], which: str
) -> None:
    times, width = run.torque.times, zoom['width']
    assert len(times) > 4 * width
    columns = np.floor((times - times[0]) * (width / (times[-1] - times[0])))
    for drawn, torque in zip(zoom[which], run.torque.values.T, strict=True):
        values = dict(zip(times.tolist(), torque.astype(np.float32).tolist(), strict=True))
        x, y = np.array(drawn['x']), np.array(drawn['y'])
        assert [values[time] for time in x.tolist()] == y.tolist()  # samples of the log
        assert len(x) <= 2 * (width + 1)
        sample_columns = columns[np.searchsorted(times, x)]
        for column in np.unique(columns):
            whole = torque[columns == column].astype(np.float32)
            left = y[sample_columns == column]
            assert (left.min(), left.max()) == (whole.min(), whole.max())


def distances(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Return the distance of every point from the nearest corner of a line."""
    return np.array([np.linalg.norm(line - point, axis=1).min() for point in points])


@needs_webdriver
def test_report_zoom_path_is_accurate_to_one_pixel(run: Run, zoom: Mapping[str, Any]) -> None:
    actual = tracking(run).actual
    assert actual is not None
    points = actual[:, :2]
    (line,) = (np.array([d['x'], d['y']], dtype=float).T for d in zoom['path'][:1])
    assert len(line) < len(points) / 2
    assert distances(points[::7], line).max() < zoom['pixel']
    piece = np.array([zoom['piece'][0]['x'], zoom['piece'][0]['y']], dtype=float).T
    (left, right), (bottom, top) = zoom['pieceRanges']
    seen = points[
        (points[:, 0] > left)
        & (points[:, 0] < right)
        & (points[:, 1] > bottom)
        & (points[:, 1] < top)
    ]
    assert len(seen) > 20
    assert distances(seen, piece).max() < (right - left) / zoom['width']
    assert len(piece) < len(points) / 10


@needs_webdriver
@pytest.mark.slow
def test_report_zoom_too_many_samples_draws_boxes(tmp_path: Path) -> None:
    times = ticks(45.0, 1e-4)
    assert len(times) > 2 * MOST
    chatter = np.where(np.arange(len(times)) % 2, 80.0, -80.0)[:, None] * np.ones(4)
    run = run_of(np.ones((len(times), 4)), times, torque=chatter)
    zoom = zoomed_report(run, tmp_path, START, START + 0.01, [0.0, 1.0, 0.0, 1.0])
    assert zoom['problems'] == []
    for drawn in zoom['near']:
        assert drawn['fill'] == 'toself'  # boxes, not a line
        x, y = np.array(drawn['x'], dtype=float), np.array(drawn['y'], dtype=float)
        boxes = np.stack((x, y), axis=1).reshape(-1, 6, 2)
        np.testing.assert_array_equal(np.nanmin(boxes[:, :, 1], axis=1), -80.0)
        np.testing.assert_array_equal(np.nanmax(boxes[:, :, 1], axis=1), 80.0)
        starts, ends = boxes[:, 0, 0], boxes[:, 2, 0]
        np.testing.assert_array_equal(ends[:-1], starts[1:])
        assert starts[0] <= START < START + 0.01 <= ends[-1]
    assert {drawn['fill'] for drawn in zoom['whole']} == {'none'}
