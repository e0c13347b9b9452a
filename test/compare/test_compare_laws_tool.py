# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Tool of the comparison of all laws: its file of results, and the tables that are made of it."""

from __future__ import annotations

import csv
import importlib.util
from pathlib import Path
import sys
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]


def tool(name: str) -> ModuleType:
    """Return a module of tools/."""
    spec = importlib.util.spec_from_file_location(name, ROOT / 'tools' / f'{name}.py')
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_compare_laws_results_are_read_by_tables(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two laws on two robots; a second run replaces its rows, and the tuned gains are added."""
    compare, tables = tool('compare_laws'), tool('tables')
    results = tmp_path / 'docs' / 'reference' / 'laws' / 'comparison.csv'
    results.parent.mkdir(parents=True)
    laws = ('smc:implicit', 'pid')
    part = compare.Part('robust', 'as it is', 2, {'duration': 0.4}, laws)
    parts = {'robots': part}
    small = {'LAWS': laws, 'RESULTS': results, 'PARTS': parts, 'SHORTER': 'duration=0.2'}
    counts = {'CANDIDATES': 4, 'ROBOTS': 2, 'SEARCH': 1, 'SELECTION': 1, 'BEST': 1}
    for name, value in {**small, **counts}.items():
        monkeypatch.setattr(compare, name, value)
    monkeypatch.setattr(tables, 'ROOT', tmp_path)
    for arguments in (['robots'], ['robots', 'tuned']):
        monkeypatch.setattr(sys, 'argv', ['compare_laws.py', *arguments])
        compare.main()
    with results.open(encoding='utf-8') as file:
        reader = csv.DictReader(file)
        rows = list(reader)
    assert tuple(reader.fieldnames or ()) == compare.COLUMNS
    places = [(row['part'], row['law'], row['switching']) for row in rows]
    assert len(set(places)) == len(places)
    assert places[:2] == [('robots', 'smc', 'implicit'), ('robots', 'pid', '')]
    assert {place[0] for place in places[2:]} >= {'default gains', 'tuned'}
    assert all(row['runs'] == '2' and float(row['error']) > 0.0 for row in rows)
    written = tables.tables()
    error = 1e3 * float(rows[1]['error'])
    assert f'| [`pid`](pid.md) | {error:.3g}' in written['robots']
    assert '[`smc`](smc.md), implicit + observer |' in written['robots']
    assert '[`pid`](pid.md)' in written['tuned']
