# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Reports of many runs: one run in memory, sections that are opened, metrics over parameters."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import replace
import gc
import gzip
import json
from pathlib import Path
from threading import Event
from typing import Any
import weakref

from helpers.logged_runs import numbers, write_run
from helpers.report_html import Page
from helpers.report_runs import run_of, ticks
from helpers.webdriver import browser, needs_webdriver
from masmc_ros.errors import InputError
from masmc_ros.log.read.reader import read_run, Run
from masmc_ros.report.digest import compared_runs, digests_of, LogRuns
from masmc_ros.report.report import write_report
import numpy as np
import pytest

GAINS = [40.0, 80.0, 20.0, 160.0, 10.0, 320.0, 5.0]
TIMES = ticks(1.0, 0.02)


def gained(gain: float) -> Run:
    """Return a short run whose error is 1 m by its gain."""
    error = np.full((len(TIMES), 4), 1.0 / gain)
    run = run_of(error, TIMES, path=f'{gain}.mcap')
    run.position[:, 0] = TIMES
    # Without the parameters of a robot nothing is compiled.
    return replace(run, parameters={'controller': {'law': 'pid', 'k_s1': gain}})


class Counted(Sequence[Run]):
    """Runs that are made when they are used; counts those in memory."""

    def __init__(self) -> None:
        self.alive = weakref.WeakSet[Any]()
        self.most = 0

    def __len__(self) -> int:
        """Return the number of runs."""
        return len(GAINS)

    def __getitem__(self, place: Any) -> Any:
        """Make a run."""
        gc.collect()  # of figures, which refer to themselves
        run = gained(GAINS[place])
        # Arrays of samples decide on the memory.
        self.alive.add(_Owner.of(run))
        self.most = max(self.most, len(self.alive))
        return run


class _Owner(np.ndarray):
    """Array that weak references can point to."""

    @staticmethod
    def of(run: Run) -> _Owner:
        """Replace the positions of a run; return them."""
        owner = run.position.view(_Owner)
        object.__setattr__(run, 'position', owner)
        return owner

    # Arrays compare by value and have none; a weak set needs one.
    __hash__ = object.__hash__  # type: ignore[assignment]


@pytest.fixture(scope='module')
def counted() -> Counted:
    return Counted()


@pytest.fixture(scope='module')
def report(counted: Counted, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('many')
    write_report(counted, folder, has_all_figures=False)
    return folder / 'report.html'


def test_report_of_many_runs_keeps_few_in_memory(report: Path, counted: Counted) -> None:
    assert report.exists()
    assert 1 <= counted.most <= 2


def test_report_page_many_runs_have_metric_over_parameter(report: Path) -> None:
    page = Page(report.read_text(encoding='utf-8'))
    (data,) = page.root.find_all('script', id='trend-data')
    trend = json.loads(data.text)
    (parameter,) = trend['parameters']
    assert (parameter['name'], parameter['values']) == ('k_s1', sorted(GAINS))
    assert [group['name'] for group in trend['groups']] == ['k_s1']
    rms = trend['metrics'][0]
    assert rms['name'] == 'E RMS (mm)'
    assert rms['values'] == pytest.approx([2**0.5 * 1e3 / gain for gain in sorted(GAINS)])
    assert trend['links'] == [f'run-{1 + GAINS.index(gain)}' for gain in sorted(GAINS)]


def test_report_page_many_runs_sections_are_compressed(report: Path) -> None:
    page = Page(report.read_text(encoding='utf-8'))
    sections = page.root.find_all('details', **{'class': 'run'})
    assert len(sections) == len(GAINS)
    for section, gain in zip(sections, sorted(GAINS), strict=True):
        (packed,) = section.find_all('script')
        content = gzip.decompress(base64.b64decode(packed.text)).decode()
        assert f'{gain}.mcap: {len(TIMES)} states' in content
        assert Page(content).figures()[1].endswith('-error_E')


def test_report_of_many_logs_read_in_two_processes_is_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    paths = [str(tmp_path / f'{count}.mcap') for count in range(40, 48)]
    for count, path in enumerate(paths, 40):
        write_run(Path(path), numbers(count))
    monkeypatch.setattr('masmc_ros.report.digest.processors', lambda: 2)
    is_helped, read = Event(), list[str]()

    def read_later(path: str) -> Run:
        # The other process has time to start.
        assert is_helped.wait(60.0)
        read.append(path)
        return read_run(path)

    monkeypatch.setattr('masmc_ros.report.digest.read_run', read_later)
    found = digests_of(LogRuns(paths, is_helped.set))
    assert paths[0] in read
    assert len(read) < len(paths)
    alone = digests_of([read_run(path) for path in paths])
    for one, other in zip(found, alone, strict=True):
        assert repr(one) == repr(other)
    Path(paths[5]).write_bytes(Path(paths[5]).read_bytes()[:5000])
    with pytest.raises(InputError, match=r'45\.mcap'):
        digests_of(LogRuns(paths, lambda: None))


def test_compared_runs_contain_best_and_worst() -> None:
    (digest,) = digests_of([gained(40.0)])
    errors = np.random.default_rng(3).permutation(50) + 1.0
    point, reached = next(iter(digest.metrics.points.items()))
    digests = []
    for error in errors.tolist():
        points = {point: reached.__class__(**{**vars(reached), 'rms': error})}
        row = digest.metrics.__class__(**{**vars(digest.metrics), 'points': points})
        digests.append(digest._replace(metrics=row))
    chosen = [errors[place] for place in compared_runs(digests)]
    assert len(chosen) == 20
    assert (min(chosen), max(chosen)) == (1.0, 50.0)
    assert compared_runs(digests[:3]) == [0, 1, 2]


@pytest.mark.slow
@needs_webdriver
def test_report_page_many_runs_are_drawn_when_opened(report: Path, tmp_path: Path) -> None:
    with browser(tmp_path) as session:
        session.open(report.as_uri())
        session.until('return document.documentElement.dataset.drawn;', 'the drawn page')
        assert session.run("return document.querySelectorAll('.run .plot').length;") == 0
        session.run("location.hash = 'run-2';")
        drawn = session.until(
            "const plots = [...document.querySelectorAll('.run[open] .plot')];"
            'return plots.length && plots.some((plot) => plot.querySelector(".js-line"))'
            ' && document.querySelector(".run[open] h2").id;',
            'the plots of a run',
        )
        assert drawn == 'run-2'
        session.run(
            "const choice = document.getElementById('trend-metric'); choice.value = 1;"
            "choice.dispatchEvent(new Event('change'));"
        )
        title = "return document.getElementById('trend').layout.yaxis.title.text === 'E max (mm)';"
        session.until(title, 'the other metric')
