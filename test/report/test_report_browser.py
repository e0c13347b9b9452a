# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The report's page in a real browser, where one is installed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
import re
import shutil
import subprocess
from typing import Any

from helpers.browser import chromium, LIMIT, look, needs_chromium
from helpers.report_runs import paper_like, with_change
from masmc_ros.report.report import write_report
from matplotlib.image import imread
import numpy as np
import pytest

FIREFOX = next(filter(None, map(shutil.which, ('firefox', 'firefox-esr'))), None)
needs_firefox = pytest.mark.skipif(FIREFOX is None, reason='no Firefox here')

PLOTS = 2 + 4 + 4
BLUE, BLUE_IN_THE_DARK = (0x00, 0x72, 0xB2), (0x4A, 0xA8, 0xE0)

LOOK = """
  const charts = [...document.querySelectorAll('.plot')];
  const overTime = charts.filter((chart) => chart.classList.contains('over-time'));
  const ranges = () => overTime.map((chart) => [...chart.layout.xaxis.range]);
  const ticks = () =>
    overTime.map((chart) => [...chart.querySelectorAll('.xtick')].map((t) => +t.textContent));
  const found = {
    drawn: charts.map((chart) => chart.querySelectorAll('.scatterlayer .js-line').length),
    expected: charts.map((chart) => chart.data.filter((t) => t.mode === 'lines').length),
    marks: charts.map((chart) => chart.querySelectorAll('.scatterlayer .point').length),
    before: ranges(),
    fits: document.documentElement.scrollWidth <= document.documentElement.clientWidth,
    buttons: [...document.querySelectorAll('[data-title]')].map((b) => b.dataset.title),
    canShare: charts.map((chart) => chart._context.showSendToCloud),
  };
  await Plotly.relayout(overTime[3], { 'xaxis.range[0]': 4, 'xaxis.range[1]': 6 });
  await settle();
  found.zoomed = { ranges: ranges(), ticks: ticks() };
  await Plotly.relayout(overTime[0], { 'xaxis.range[0]': 10, 'xaxis.range[1]': 15 });
  await settle();
  found.again = { ranges: ranges(), ticks: ticks() };
  found.loaded = performance.getEntriesByType('resource').map((entry) => entry.name);
"""


@pytest.fixture(scope='module')
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    run = with_change(paper_like('a.mcap'), 5.0, 'controller', k_s1=150.0)
    folder = tmp_path_factory.mktemp('report')
    write_report([run, paper_like('b.mcap', law='rasmc', scale=0.5)], folder)
    return folder / 'report.html'


@pytest.fixture(scope='module')
def found(report: Path, tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Any]:
    return look(report, LOOK, tmp_path_factory.mktemp('laptop'), '--window-size=1400,900')


@needs_chromium
def test_every_line_is_drawn(found: Mapping[str, Any]) -> None:
    assert found['problems'] == []
    assert len(found['drawn']) == PLOTS
    assert min(found['drawn']) > 0
    assert found['drawn'] == found['expected']
    assert sum(found['marks']) == 3  # errors of E and F, and torques, of the run with a change


@needs_chromium
def test_nothing_is_loaded_and_nothing_can_be_sent(found: Mapping[str, Any]) -> None:
    assert found['loaded'] == []
    assert not any(found['canShare'])
    assert not [title for title in found['buttons'] if re.search('share|cloud', title, re.I)]


@needs_chromium
def test_zooming_one_plot_zooms_all(found: Mapping[str, Any]) -> None:
    assert len(found['before']) == PLOTS - 2
    assert {tuple(span) for span in found['before']} == {(0.0, 20.0)}
    for there, begin, end in (('zoomed', 4, 6), ('again', 10, 15)):
        assert {tuple(span) for span in found[there]['ranges']} == {(begin, end)}
        for ticks in found[there]['ticks']:  # what is drawn
            assert len(ticks) > 1
            assert begin <= min(ticks) < max(ticks) <= end


@pytest.mark.slow
@needs_chromium
@pytest.mark.parametrize('width', [500, 1400])
def test_page_is_as_wide_as_the_window(report: Path, tmp_path: Path, width: int) -> None:
    assert look(report, LOOK, tmp_path, f'--window-size={width},900')['fits']


def share(image: Path, colour: tuple[int, int, int]) -> float:
    """Return how much of a picture has a colour."""
    pixels = np.round(imread(image)[..., :3] * 255).astype(int)
    return float((pixels == colour).all(axis=-1).mean())


@pytest.mark.slow
@needs_chromium
@pytest.mark.parametrize(
    ('options', 'line', 'paper'),
    [
        ((), BLUE, (0xFF, 0xFF, 0xFF)),
        (('--blink-settings=preferredColorScheme=0',), BLUE_IN_THE_DARK, (0x15, 0x18, 0x1C)),
    ],
)
def test_light_and_dark(
    report: Path,
    tmp_path: Path,
    options: tuple[str, ...],
    line: tuple[int, int, int],
    paper: tuple[int, int, int],
) -> None:
    picture = tmp_path / 'page.png'
    chromium(
        tmp_path / 'home', report, f'--screenshot={picture}', '--window-size=1400,1600', *options
    )
    assert share(picture, paper) > 0.7
    assert share(picture, line) > 1e-4


@needs_firefox
def test_firefox_draws_it_too(report: Path, tmp_path: Path) -> None:
    assert FIREFOX is not None
    picture = tmp_path / 'page.png'
    command = [FIREFOX, '--headless', '--no-remote', '--profile', str(tmp_path), '--screenshot',
               str(picture), '--window-size=1400,1600', report.as_uri()]  # fmt: skip
    subprocess.run(command, capture_output=True, timeout=LIMIT)
    assert share(picture, (0xFF, 0xFF, 0xFF)) > 0.7
    assert share(picture, BLUE) > 1e-4
