# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Adaptation in reports: ratios of the estimates, plots, tables and figures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from helpers.report_html import lines, Page
from helpers.report_runs import paper_like, telling
import masmc_ros as masmc
from masmc_ros.log.read.reader import Run
from masmc_ros.report.digest import digests_of
from masmc_ros.report.measure.adaptation import adaptation, assumed_model
from masmc_ros.report.measure.parameters import robot_of_node
from masmc_ros.report.page.page import report_page
from masmc_ros.report.report import write_report
from masmc_ros.robot.two_link.paper_robot import ROBOT
import numpy as np
import pytest

PLANT: dict[str, Any] = {parameter.name: parameter.default for parameter in ROBOT}
NOMINAL: dict[str, Any] = {'model_scale': 0.5, 'payload.mass': 0.0}


def estimating(plant: dict[str, Any], path: str = 'a.mcap', **controller: Any) -> Run:
    """Return a run whose estimates move from half of the true parameters to 90 % of them."""
    run = paper_like(path, **NOMINAL, **controller)
    run = replace(run, parameters={**run.parameters, **({'plant': plant} if plant else {})})
    robot = robot_of_node(run, 'controller')
    assert robot is not None
    share = np.linspace(0.5, 0.9, len(run.times))
    return telling(run, estimate=(run.times, share[:, None] * robot.theta))


def page_of(*runs: Run) -> Page:
    """Return the page of runs with the names of their files."""
    names = [run.path.stem for run in runs]
    return Page(report_page(names, digests_of(runs), range(len(runs))))


def test_adaptation_of_simulated_plant_is_relative_to_truth() -> None:
    adapted = adaptation(estimating(PLANT))
    assert adapted is not None
    assert adapted.is_true
    assert adapted.quantities[0].name == 'mass'
    assert adapted.values[0] == pytest.approx(21.35300031)
    np.testing.assert_allclose(adapted.ratios[0], 0.5)
    np.testing.assert_allclose(adapted.final_errors, -10.0)
    assert assumed_model(estimating(PLANT)) == pytest.approx((0.5, 0.5))


def test_adaptation_without_plant_is_relative_to_nominal() -> None:
    run = estimating({})
    adapted = adaptation(run)
    assert adapted is not None
    assert not adapted.is_true
    np.testing.assert_allclose(adapted.final_errors, 80.0)
    assert assumed_model(run) is None
    shown = page_of(run)
    assert 'nominal 10.7 kg' in shown.root.text
    assert 'nominal model of the controller' in shown.root.text


def test_adaptation_payload_counts_from_its_pick_up() -> None:
    adapted = adaptation(estimating({**PLANT, 'payload.mass': 2.0, 'payload.time': 5.0}))
    assert adapted is not None
    before, after = adapted.ratios[499, 0], adapted.ratios[500, 0]
    assert after / before == pytest.approx(21.353 / 23.353, rel=1e-3)


@pytest.mark.parametrize('run', [paper_like(), replace(estimating({}), parameters={})])
def test_adaptation_without_estimates_or_robots_is_none(run: Run) -> None:
    assert adaptation(run) is None
    assert 'final-errors' not in [e.attributes.get('id') for e in page_of(run).root.within]


def test_report_page_adaptation_has_plot_per_parameter() -> None:
    shown = page_of(estimating(PLANT), estimating(PLANT, 'b.mcap', law='rasmc'))
    names = [name for name in shown.figures() if 'adaptation' in name]
    assert names == [f'all-adaptation_{number}' for number in range(7)]
    assert 'run-1-estimate' not in shown.figures()
    figure = shown.figure(names[0])
    drawn = lines(figure)
    assert list(drawn) == ['a: −10.0 %', 'b: −10.0 %']
    np.testing.assert_allclose(drawn['a: −10.0 %']['y'][[0, -1]], [0.5, 0.9], rtol=1e-6)
    (level,) = figure['layout']['shapes']
    assert level['y0'] == level['y1'] == 1.0
    (title,) = shown.root.find_all('figcaption', id=f'{names[3]}-title')
    assert title.text == 'p₁: true 1.2 kg·m'
    head, first, _ = shown.table(id='final-errors')
    assert head[:2] == ['run', 'M (%)']
    assert first == ['a', *['−10.0'] * 7]


@pytest.mark.parametrize(
    ('file_format', 'start'), [('png', b'\x89PNG'), ('pdf', b'%PDF'), ('svg', b'<?xml')]
)
def test_write_report_writes_figures_in_format(
    tmp_path: Path, file_format: str, start: bytes
) -> None:
    files = write_report([estimating(PLANT)], tmp_path / 'a', file_format).files
    figures = [path for path in files if path.suffix == f'.{file_format}']
    assert [path.stem for path in figures][-2:] == ['comparison', 'adaptation']
    assert all(path.read_bytes().startswith(start) for path in figures)
    again = write_report([estimating(PLANT)], tmp_path / 'b', file_format).files
    assert [path.read_bytes() for path in again] == [path.read_bytes() for path in files]


@pytest.mark.slow
def test_write_report_of_many_runs_has_few_figures(tmp_path: Path) -> None:
    runs = [paper_like(f'{number}.mcap', k_s1=float(number)) for number in range(7)]
    for has_all, count in ((False, 3 + 1), (True, 7 * 3 + 1)):
        folder = tmp_path / str(has_all)
        write_report(runs, folder, has_all_figures=has_all)
        assert len(list(folder.glob('*.png'))) == count


def test_plot_adaptation_draws_every_parameter() -> None:
    run = masmc.simulate('paper', duration=0.1)
    figure = run.plot.adaptation()
    assert len(figure.axes) == 7
    level, line = figure.axes[0].get_lines()
    assert list(level.get_ydata()) == [1.0, 1.0]
    np.testing.assert_allclose(line.get_ydata()[0], 0.5)
    assert figure.axes[0].get_title(loc='left').startswith('M: true 21.4 kg\nfinal −5')
