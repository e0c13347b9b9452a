# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Wheel slip and contact forces in reports and exports."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

from helpers.report_html import lines, Page
from helpers.report_runs import paper_like, series
from masmc_ros.cli.main import main
from masmc_ros.log.read.reader import read_run, Run
from masmc_ros.loop.signals import CONTACT
from masmc_ros.loop.simulation import Simulation
from masmc_ros.report.digest import digests_of
from masmc_ros.report.export import table_of, write_export
from masmc_ros.report.measure.metrics import metrics
from masmc_ros.report.measure.table import csv_table, markdown_table, text_table
from masmc_ros.report.page.page import report_page
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')
SETTINGS = (
    'plant.physics=mujoco', 'plant.friction=0.05', 'robot.wheel_spin_inertia=0.01',
    'duration=0.4', 'plant.odom_decimation=4',
)  # fmt: skip
TIMES = paper_like().times[:5]
CONTACT_VALUES = np.array(
    [
        [0.0, 0.0, 80.0, 1.0, 0.0, 0.0, 70.0, 1.0],
        [0.03, 0.04, 75.0, 4.0, 0.0, 0.01, 60.0, 2.0],
        [0.01, 0.0, 85.0, 1.0, -0.02, 0.0, 65.0, 1.0],
    ]
)


def slipping() -> Run:
    """Return a run with three contact messages of two wheels."""
    return replace(paper_like(), contact=series(TIMES[:3], CONTACT_VALUES))


@pytest.fixture(scope='module')
def logged(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Return a computed run with slipping wheels, read from its log."""
    log = tmp_path_factory.mktemp('contact') / 'slips.mcap'
    settings = [word for setting in SETTINGS for word in ('--set', setting)]
    assert main(['simulate', PAPER, '--output', str(log), *settings]) == 0
    return read_run(log)


def test_contact_log_values_equal_simulated_ones(logged: Run) -> None:
    values = load_scenario(PAPER, list(SETTINGS))
    contact = np.concatenate([part.contact for part in Simulation(values).run()])
    assert logged.contact is not None
    np.testing.assert_array_equal(logged.contact.values, contact[::4])
    np.testing.assert_array_equal(logged.contact.times, logged.times[::4])
    assert logged.contact_names == ('wheel_right_joint', 'wheel_left_joint')
    assert metrics(logged).fastest_slip > 0.01


def test_contact_tables_show_largest_slip_and_smallest_force() -> None:
    rows = {'slips': metrics(slipping()), 'rolls': metrics(paper_like())}
    text, markdown = text_table(rows), markdown_table(rows)
    assert text.splitlines()[0].endswith('fastest slip  least normal force')
    assert text.splitlines()[3].split()[-2:] == ['50.000', '60.000']
    assert text.splitlines()[4].split()[-2:] == ['-', '-']
    assert 'fastest slip (mm/s) | least normal force (N) |' in markdown
    slips, rolls = csv.DictReader(csv_table(rows).splitlines())
    assert float(slips['fastest_slip (m/s)']) == 0.05
    assert float(slips['least_normal_force (N)']) == 60.0
    assert rolls['fastest_slip (m/s)'] == ''


def test_contact_tables_without_contact_have_no_slip() -> None:
    rows = {'rolls': metrics(paper_like())}
    for text in (text_table(rows), markdown_table(rows), csv_table(rows)):
        assert 'slip' not in text
    assert not any('slip' in column.name for column in table_of(paper_like()).columns)


def test_contact_page_plots_slip_and_forces() -> None:
    run = slipping()
    page = Page(report_page(['slips'], digests_of([run]), [0]))
    drawn = lines(page.figure('run-1-slip'))
    assert list(drawn) == [
        f'{joint}, {part}'
        for joint in run.contact_names
        for part in ('slip in the rolling direction', 'slip along the axle')
    ]
    for line, values in zip(drawn.values(), CONTACT_VALUES[:, [0, 1, 4, 5]].T, strict=True):
        np.testing.assert_array_equal(line['y'], values.astype(np.float32))
    assert len(lines(page.figure('run-1-contact_force'))) == 4
    assert page.table(id='metrics')[0][-2:] == ['fastest slip (mm/s)', 'least normal force (N)']


def test_contact_export_has_four_columns_per_wheel(tmp_path: Path) -> None:
    run = slipping()
    columns, values, known = table_of(run)
    names = [column.name for column in columns]
    first = names.index('slip_along_wheel_right_joint_m_per_s')
    assert names[first:] == [
        'slip_along_wheel_right_joint_m_per_s',
        'slip_across_wheel_right_joint_m_per_s',
        'normal_force_wheel_right_joint_N',
        'friction_wheel_right_joint_N',
        'slip_along_wheel_left_joint_m_per_s',
        'slip_across_wheel_left_joint_m_per_s',
        'normal_force_wheel_left_joint_N',
        'friction_wheel_left_joint_N',
    ]
    np.testing.assert_array_equal(values[:3, first:], CONTACT_VALUES)
    assert known[:3, first:].all()
    assert not known[3:, first:].any()
    (path,) = write_export([run], tmp_path, 'npz', overwrite=False)
    with np.load(path) as arrays:
        np.testing.assert_array_equal(arrays['contact'], CONTACT_VALUES)
        np.testing.assert_array_equal(arrays['contact_time_s'], TIMES[:3])


def test_contact_names_without_joints_are_numbered() -> None:
    contacts = series(TIMES, np.zeros((len(TIMES), 4 * len(CONTACT))))
    run = replace(paper_like(), contact=contacts)
    assert run.contact_names == ('contact_1', 'contact_2', 'contact_3', 'contact_4')
