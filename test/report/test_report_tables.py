# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Labels and tables of runs."""

from __future__ import annotations

import csv
from dataclasses import replace
import io
import math
from pathlib import Path
from typing import Any

from helpers.report_runs import paper_like, telling, with_change
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.report.draw.figures import figure_names
from masmc_ros.report.measure.labels import labels
from masmc_ros.report.measure.metrics import Metrics, metrics, Reached
from masmc_ros.report.measure.table import csv_table, markdown_table, number, text_table
from masmc_ros.report.report import write_report
from masmc_ros.result_text import aligned
from masmc_ros.robot.mechanisms import DEFAULT
import pytest

E, F = DEFAULT.points

KNOWN = Metrics(
    start=10.0,
    end=20.0,
    points={E: Reached(0.020688, 0.0752, 1.934), F: Reached(0.0395656, 0.0601855, math.inf)},
    joints=4,
    torque_rms=3.4239,
    torque_variation=236554.4,
    estimate_norm=None,
)


@pytest.mark.parametrize(
    ('parameters', 'label'),
    [
        ({}, 'smc, tanh δ 0.2'),
        ({'law': 'rasmc', 'boundary_layer': 0.05}, 'rasmc, tanh δ 0.05'),
        ({'law': 'nonlinear_feedback'}, 'nonlinear_feedback'),
        ({'switching': 'sign'}, 'smc, sign'),
        ({'switching': 'implicit', 'observer_gain': 0.5}, 'smc, implicit + observer, β 0.5'),
        ({'switching': 'implicit'}, 'smc, implicit'),
        ({'law': 'mine', 'switching': None}, 'mine'),
    ],
)
def test_label_names_law_and_reaching_term(parameters: dict[str, Any], label: str) -> None:
    assert labels([paper_like(**parameters)]) == [label]


def test_label_parameters_changed_is_marked() -> None:
    run = paper_like()
    changed = with_change(run, 5.0, 'controller', k_s1=150.0)
    assert labels([changed]) == ['smc, tanh δ 0.2, changed']


def test_labels_runs_of_equal_law_contain_file_name() -> None:
    runs = [paper_like('a.mcap'), paper_like('b.mcap'), paper_like('c.mcap', law='rasmc')]
    assert labels(runs) == ['smc, tanh δ 0.2 (a)', 'smc, tanh δ 0.2 (b)', 'rasmc, tanh δ 0.2']


def test_label_log_without_parameters_is_file_name() -> None:
    assert labels([replace(paper_like('bags/lab.mcap'), parameters={})]) == ['lab']


def test_labels_current_folder_has_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    run = replace(paper_like('.'), parameters={})
    assert labels([run]) == [tmp_path.name]
    assert figure_names([run])[0][0] == f'{tmp_path.name}_path.png'


@given(st.lists(st.sampled_from(['a', 'x/a', 'y/a', 'b', 'q' * 60, 'x/' + 'q' * 60]), min_size=1))
def test_labels_of_several_runs_are_unique(paths: list[str]) -> None:
    run_labels = labels([paper_like(f'{path}.mcap') for path in paths])
    assert len(set(run_labels)) == len(paths)
    assert max(map(len, run_labels)) < 80


@given(st.floats(-1e12, 1e12))
def test_number_text_keeps_five_digits(value: float) -> None:
    assert float(number(value)) == pytest.approx(value, rel=5.1e-5, abs=0.0)
    assert len(number(value)) <= 12


@pytest.mark.parametrize(
    ('value', 'text'),
    [(24.2834, '24.283'), (0.774, '0.77400'), (236554.4, '236550'), (0.0218352, '0.021835')],
)
def test_number_text_has_no_exponent(value: float, text: str) -> None:
    assert number(value) == text


def test_text_table_columns_are_aligned() -> None:
    text = text_table({'smc, sign': KNOWN, 'a much longer label of a run': metrics(paper_like())})
    head, units, rule, first, second = text.splitlines()[:5]
    ends = [len(head.rstrip()), len(units), len(rule), len(first), len(second)]
    assert len(set(ends)) == 1
    assert first.split() == [
        'smc,', 'sign', '10-20', '20.688', '75.200', '39.566', '60.186', '1.9340', 'does', 'not',
        '3.4239', '236550',
    ]  # fmt: skip
    # Every column ends with its rule.
    edges = [
        i for i, letter in enumerate(rule) if letter == '-' and rule[i + 1:i + 2] in (' ', '')
    ]
    for line in (first, second):
        assert all(line[i] != ' ' for i in edges[1:])


@pytest.mark.slow
def test_report_diverged_run_has_infinite_distances(
    tmp_path: Path, recwarn: pytest.WarningsRecorder
) -> None:
    run = paper_like()
    error = run.telemetry['error'].values.copy()
    error[1500:] = 1e200
    write_report([telling(run, error=(run.times, error))], tmp_path)
    assert not recwarn.list
    row = (tmp_path / 'table.txt').read_text(encoding='utf-8').splitlines()[3].split()
    assert row[5:13] == [*4 * ['inf'], *2 * ['does', 'not']]


def test_markdown_table_has_one_cell_per_column() -> None:
    lines = markdown_table({'a|b': KNOWN}).splitlines()
    assert len(lines) == 3
    assert {line.replace(r'\|', '').count('|') for line in lines} == {11}
    assert '| 75.200 |' in lines[2]


@given(st.floats(0.0, 1e6), st.floats(0.0, 1e6) | st.none())
def test_csv_table_restores_numbers_exactly(rms: float, variation: float | None) -> None:
    reached = replace(KNOWN.points[F], rms=rms)
    row = replace(KNOWN, points={**KNOWN.points, F: reached}, torque_variation=variation)
    (read,) = csv.DictReader(io.StringIO(csv_table({'smc, "x"': row})))
    assert read.pop('run') == 'smc, "x"'
    for column in ('first_error (s)', 'last_error (s)', 'error_share (1)', 'notes'):
        assert read.pop(column) == ''
    known = [0.020688, 0.0752, rms, 0.0601855, 1.934, math.inf, 3.4239, variation, None]
    assert [float(text) if text else None for text in read.values()] == [10.0, 20.0, *known]
    assert list(read)[4] == 'platform_rms (m)'


def test_aligned_columns_have_equal_widths() -> None:
    rows = [['law', 'RMS'], ['rasmc', '1'], ['', '10.25']]
    assert aligned(rows, left=(0,)) == ['law      RMS', 'rasmc      1', '       10.25']
    assert aligned(rows, left=range(2)) == ['law    RMS', 'rasmc  1', '       10.25']


def test_wide_table_continues_below_with_its_key_column() -> None:
    rows = [['law', 'a', 'b'], ['', '(m)', '(s)'], ['rasmc', '10', '20']]
    assert aligned(rows, left=(0,), rule=2, width=10) == [
        'law      a', '       (m)', '-----  ---', 'rasmc   10', '',
        'law      b', '       (s)', '-----  ---', 'rasmc   20',
    ]  # fmt: skip
    assert len(aligned(rows, left=(0,), width=15)) == len(rows)
