# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Verdict, names and order of runs, and the table of the page."""

from __future__ import annotations

from dataclasses import replace
import math
from pathlib import Path

from helpers.report_html import Page
from helpers.report_runs import paper_like
from masmc_ros.report.measure.findings import verdict
from masmc_ros.report.measure.metrics import Metrics, metrics, Reached
from masmc_ros.report.measure.parameters import differences, natural_key, run_names, run_order
from masmc_ros.report.report import write_report
from masmc_ros.robot.mechanisms import DEFAULT
import pytest

E, F = DEFAULT.points


def row(rms: float | None, variation: float | None = 10.0) -> Metrics:
    """Return the metrics of a run with an RMS error in m."""
    points = {E: Reached(rms=rms), F: Reached(rms=None if rms is None else 2.0 * rms)}
    return Metrics(10.0, 20.0, points, 4, torque_variation=variation)


@pytest.mark.parametrize(
    ('rows', 'sentence'),
    [
        (
            {'smc': row(0.02069, 15.3), 'rasmc': row(0.00649, 11.6)},
            'rasmc tracks the end effector 3.2 times better than smc (6.49 mm and 20.7 mm RMS),'
            ' at 24 % less torque variation.',
        ),
        (
            {'a': row(0.002), 'b': row(0.004, 20.0), 'c': row(0.02, 5.0)},
            'Of 3 runs, a tracks the end effector 2.0 times better than b (2.00 mm and 4.00 mm'
            ' RMS) and 10 times better than c, at 50 % less torque variation than b.',
        ),
        (
            {'a': row(0.002), 'b': row(0.00201)},
            'a and b track the end effector equally well: 2.00 mm and 2.01 mm RMS.',
        ),
        (
            {'a': row(0.002), 'b': row(0.00201), 'c': row(0.00203)},
            'Of 3 runs, all track the end effector equally well: 2.00 mm (a) to 2.03 mm RMS.',
        ),
        (
            {'a': row(0.002, 1e5), 'b': row(0.02)},
            'a tracks the end effector 10 times better than b (2.00 mm and 20.0 mm RMS), at 10000'
            ' times the torque variation.',
        ),
        (
            {'a': row(0.002), 'b': row(math.inf), 'c': row(0.004)},
            'Of 3 runs, a tracks the end effector 2.0 times better than c (2.00 mm and 4.00 mm'
            ' RMS), at the same torque variation.',
        ),
        (
            {'a': row(0.00649)},
            'a tracks with an RMS error of 6.49 mm at the end effector and 13.0 mm at the platform'
            ' point F from 10 s to 20 s.',
        ),
        ({'a': row(None)}, ''),
        ({'a': row(None), 'b': row(0.002)}, ''),
    ],
)
def test_verdict_compares_errors_and_variation(rows: dict[str, Metrics], sentence: str) -> None:
    assert verdict(rows) == sentence


def test_run_names_and_order_follow_differing_gains() -> None:
    runs = [
        paper_like(f'{gain}.mcap', law=law, k_s1=[gain] * 4, sigma=2.0)
        for law in ('smc', 'rasmc')
        for gain in (10.0, 100.0, 2.0)
    ]
    names = run_names(runs)
    assert names[:3] == [f'smc, tanh δ 0.2, k_s1 {gain}' for gain in (10, 100, 2)]
    assert [names[i].split()[-1] for i in run_order(runs)] == ['2', '10', '100'] * 2
    assert [(entry.name, entry.texts[:3]) for entry in differences(runs)] == [
        ('law', ['smc'] * 3), ('k_s1', ['10', '100', '2']),
    ]  # fmt: skip


def test_run_names_without_differences_are_file_names() -> None:
    assert run_names([paper_like('a.mcap'), paper_like('b.mcap')]) == [
        'smc, tanh δ 0.2 (a)', 'smc, tanh δ 0.2 (b)',
    ]  # fmt: skip


def test_differences_shared_parameter_is_listed_once() -> None:
    light, heavy = (
        replace(run, parameters={**run.parameters, 'plant': {'robot.link_1_mass': mass}})
        for mass in (2.0, 3.0)
        for run in (paper_like(**{'robot.link_1_mass': mass}),)
    )
    assert [entry.name for entry in differences([light, heavy])] == ['robot.link_1_mass']
    other = replace(heavy, parameters={**heavy.parameters, 'plant': {'robot.link_1_mass': 4.0}})
    names = [entry.name for entry in differences([light, other])]
    assert names == ['controller robot.link_1_mass', 'plant robot.link_1_mass']


def test_natural_key_sorts_numbers_by_value() -> None:
    texts = ['gain 10', 'gain 2', 'gain -1', 'gain 1e-3', 'a']
    assert sorted(texts, key=natural_key) == ['a', 'gain -1', 'gain 1e-3', 'gain 2', 'gain 10']


def test_report_table_marks_best_values_and_differing_gains(tmp_path: Path) -> None:
    runs = [paper_like('a.mcap', k_s1=10.0), paper_like('b.mcap', scale=0.5, k_s1=2.0)]
    write_report(runs, tmp_path)
    shown = Page((tmp_path / 'report.html').read_text(encoding='utf-8'))
    head, first, second = shown.table(id='metrics')
    assert head[:4] == ['run', 'k_s1', 'window (s)', 'E RMS (mm)']
    assert (first[0], first[1], second[1]) == ('smc, tanh δ 0.2, k_s1 2', '2', '10')
    assert 'estimate norm (mixed)' not in head
    (table,) = shown.root.find_all('table', id='metrics')
    best = [cell.text for cell in table.find_all('td', **{'class': 'best'})]
    assert first[3] in best
    assert second[3] not in best
    keys = [float(cell.attributes['data-key']) for cell in table.find_all('td')[2:3]]
    assert keys == [pytest.approx(metrics(runs[1]).of('end_effector').rms)]
    # Files with numbers keep the order and the names of the logs.
    rows = (tmp_path / 'metrics.csv').read_text(encoding='utf-8').splitlines()
    assert [line.split('"')[1] for line in rows[1:]] == [
        'smc, tanh δ 0.2 (a)', 'smc, tanh δ 0.2 (b)',
    ]  # fmt: skip
    assert 'estimate_norm' in rows[0]
