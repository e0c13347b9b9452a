# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Report page in an installed browser."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
import re
import shutil
import subprocess
from threading import Event, Thread
from typing import Any

from helpers.report_runs import paper_like, with_change
from helpers.webdriver import browser, look, needs_webdriver
from masmc_ros.report.report import write_report
from matplotlib.image import imread
import numpy as np
import pytest

FIREFOX = next(filter(None, map(shutil.which, ('firefox', 'firefox-esr'))), None)
needs_firefox = pytest.mark.skipif(FIREFOX is None, reason='no Firefox here')

LIMIT = 120.0
PLOTS = 4 + 4 + 4
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
  const robots = () =>
    [...document.querySelectorAll('.robot .body')].map((body) => body.getAttribute('points'));
  found.robots = [robots()];
  const { left, top } = overTime[1].getBoundingClientRect();
  const { _offset: offset, _length: length } = overTime[1]._fullLayout.xaxis;
  overTime[1].dispatchEvent(new PointerEvent('pointermove', {
    clientX: left + offset + length / 2, clientY: top + 50,
  }));
  await settle();
  found.cursors = [...document.querySelectorAll('.cursor')].map((line) => !line.hidden);
  found.values = [...document.querySelectorAll('.values')].map((text) => text.textContent);
  found.robots.push(robots());
  found.sliders = [...document.querySelectorAll('.replay input')].map((slider) => +slider.value);
  found.units = overTime.map((chart) => chart.layout.yaxis.title.text);
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
def inspection(report: Path, tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Any]:
    return look(report, LOOK, tmp_path_factory.mktemp('laptop'))


@needs_webdriver
def test_report_page_in_browser_draws_every_line(inspection: Mapping[str, Any]) -> None:
    assert inspection['problems'] == []
    assert len(inspection['drawn']) == PLOTS
    assert min(inspection['drawn']) > 0
    assert inspection['drawn'] == inspection['expected']
    assert sum(inspection['marks']) == 3  # errors of E and F, and torques, of the changed run


@needs_webdriver
def test_report_page_in_browser_loads_and_sends_nothing(inspection: Mapping[str, Any]) -> None:
    assert inspection['loaded'] == []
    assert not any(inspection['canShare'])
    assert not [title for title in inspection['buttons'] if re.search('share|cloud', title, re.I)]


@needs_webdriver
def test_report_page_zoom_of_one_plot_applies_to_all(inspection: Mapping[str, Any]) -> None:
    assert len(inspection['before']) == PLOTS - 2
    assert {tuple(span) for span in inspection['before']} == {(0.0, 20.0)}
    for state, start, end in (('zoomed', 4, 6), ('again', 10, 15)):
        assert {tuple(span) for span in inspection[state]['ranges']} == {(start, end)}
        for ticks in inspection[state]['ticks']:  # drawn range
            assert len(ticks) > 1
            assert start <= min(ticks) < max(ticks) <= end


@needs_webdriver
def test_report_page_cursor_shows_values_of_all_plots(inspection: Mapping[str, Any]) -> None:
    assert inspection['cursors'] == [True] * (PLOTS - 2)
    for text, quantity in zip(inspection['values'], inspection['units'], strict=True):
        assert text.startswith('t = 10.000 s: ')
        unit = re.search(r'\(([^()]*)\)$', quantity)
        assert unit is None or text.endswith(f'({unit[1]})')


@needs_webdriver
def test_report_page_robot_follows_cursor(inspection: Mapping[str, Any]) -> None:
    before, after = inspection['robots']
    assert len(before) == len(after) == 2
    assert inspection['sliders'] == pytest.approx([10.0, 10.0], abs=0.01)
    for start, place in zip(before, after, strict=True):
        (x0, y0), (x, y) = (np.array([p.split(',') for p in points.split()], float).mean(axis=0)
                            for points in (start, place))  # fmt: skip
        # The axle moves 2 m to the right, of 4 m in 20 s.
        assert x - x0 > 50.0
        assert abs(y - y0) < 2.0


@pytest.mark.slow
@needs_webdriver
@pytest.mark.parametrize('width', [500, 1400])
def test_report_page_fits_window_width(report: Path, tmp_path: Path, width: int) -> None:
    assert look(report, LOOK, tmp_path, width=width)['fits']


def share(image: Path, colour: tuple[int, int, int]) -> float:
    """Return the share of pixels of a colour."""
    pixels = np.round(imread(image)[..., :3] * 255).astype(int)
    return float((pixels == colour).all(axis=-1).mean())


@pytest.mark.slow
@needs_webdriver
@pytest.mark.parametrize(
    ('options', 'line', 'paper'),
    [
        ((), BLUE, (0xFF, 0xFF, 0xFF)),
        (('--blink-settings=preferredColorScheme=0',), BLUE_IN_THE_DARK, (0x15, 0x18, 0x1C)),
    ],
)
def test_report_page_follows_colour_scheme(
    report: Path,
    tmp_path: Path,
    options: tuple[str, ...],
    line: tuple[int, int, int],
    paper: tuple[int, int, int],
) -> None:
    picture = tmp_path / 'page.png'
    with browser(tmp_path, (1400, 1600), *options) as session:
        session.open(report.as_uri())
        session.until('return document.documentElement.dataset.drawn;', 'the drawn page')
        session.screenshot(picture)
    assert share(picture, paper) > 0.7
    assert share(picture, line) > 1e-4


class Waiting(BaseHTTPRequestHandler):
    """Server of an image that arrives when the page has asked for another one."""

    is_drawn = Event()

    def do_GET(self) -> None:
        if self.path == '/drawn.png':
            self.is_drawn.set()
        self.is_drawn.wait(LIMIT / 2)
        self.send_error(404)

    def log_message(self, *_: object) -> None:
        """Print nothing."""


@pytest.fixture
def waiting() -> Iterator[str]:
    """Yield the address of a server; the load event of a page with its image is that late."""
    Waiting.is_drawn.clear()
    with ThreadingHTTPServer(('127.0.0.1', 0), Waiting) as server:
        thread = Thread(target=server.serve_forever, daemon=True)
        thread.start()
        try:
            yield f'http://127.0.0.1:{server.server_port}'
        finally:
            Waiting.is_drawn.set()
            server.shutdown()
            thread.join(LIMIT)


@needs_firefox
def test_report_page_in_firefox_is_drawn(report: Path, tmp_path: Path, waiting: str) -> None:
    """Firefox takes the picture at the load event, which waits for an image."""
    assert FIREFOX is not None
    script = (
        '<script>(async () => { while (!document.documentElement.dataset.drawn)'
        ' await new Promise((go) => setTimeout(go, 50));'
        f" new Image().src = '{waiting}/drawn.png'; }})();</script>"
    )
    text = report.read_text(encoding='utf-8')
    assert text.count('img-src data:') == 1
    text = text.replace('img-src data:', f'img-src {waiting} data:')
    page, picture = tmp_path / 'page.html', tmp_path / 'page.png'
    image = f'<img src="{waiting}/wait.png" alt="" hidden>'
    page.write_text(text.replace('<noscript>', f'{image}{script}<noscript>'), encoding='utf-8')
    (tmp_path / 'profile').mkdir()
    command = [FIREFOX, '--headless', '--no-remote', '--profile', str(tmp_path / 'profile'),
               '--screenshot', str(picture), '--window-size=1400,1600', page.as_uri()]  # fmt: skip
    subprocess.run(command, capture_output=True, timeout=LIMIT)
    assert Waiting.is_drawn.is_set()
    assert share(picture, (0xFF, 0xFF, 0xFF)) > 0.7
    assert share(picture, BLUE) > 1e-4
