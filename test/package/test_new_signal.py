# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Extension by a signal: a declaration and a line that computes it are sufficient."""

from __future__ import annotations

import csv
from pathlib import Path
import shutil
import subprocess
import sys

from helpers.child_environment import child_environment
from helpers.report_html import lines, Page
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]

DECLARED = """
    Signal('push', 'joints', 'torque cut off by limits', 'N·m', label='cut_torque',
           of_torques=True, title='Torque cut off', symbol='cut'),
    Signal('stretched', description='e in the norm of all axes', unit='m',
           label='stretched', title='Error of all axes'),
"""
COMPUTED = """
    signals.push = elementwise(minus, raw, torque)
    signals.stretched = math.sqrt(dot(tick.error, tick.error))
"""
IMPORTED = """
import math
from masmc_ros.numerics.scalars import minus
from masmc_ros.jit.tuples import dot
"""
SIMULATION = (
    'simulate', 'config/paper.yaml', '--set', 'duration=0.03', '--set', 'control_period=0.001',
    '--set', 'controller.torque_limit=[2.0, 2.0, 0.5, 0.5]',
)  # fmt: skip


def insert(path: Path, mark: str, text: str, *, after: bool = False) -> None:
    """Insert lines before or after a mark that occurs once."""
    source = path.read_text(encoding='utf-8')
    assert source.count(mark) == 1, mark
    inserted = mark + text if after else text.removeprefix('\n') + mark
    path.write_text(source.replace(mark, inserted), encoding='utf-8')


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a copy of the package with two more signals, and its output."""
    folder = tmp_path_factory.mktemp('signal')
    for name in ('masmc_ros', 'config'):
        shutil.copytree(ROOT / name, folder / name)
    insert(folder / 'masmc_ros/loop/signals.py', "    Signal('singular'", DECLARED)
    control = folder / 'masmc_ros/loop/control.py'
    insert(control, "    signals.singular =", COMPUTED)
    insert(control, 'from masmc_ros.law import law\n', IMPORTED, after=True)
    # Without JIT the inserted lines need no compilation; the results are bitwise identical.
    variables = {**child_environment(), 'PYTHONPATH': str(folder), 'NUMBA_DISABLE_JIT': '1'}
    for arguments in (
        (*SIMULATION, '--output', 'run.mcap'),
        ('report', 'run.mcap', '--output', 'report'),
        ('export', 'run.mcap', '--output', 'export'),
        ('export', 'run.mcap', '--output', 'export', '--format', 'npz'),
    ):
        command = [sys.executable, '-m', 'masmc_ros.cli.main', *arguments]
        result = subprocess.run(
            command, cwd=folder, env=variables, capture_output=True, text=True, timeout=300.0,
            check=False,
        )
        assert result.returncode == 0, result.stderr
    return folder


def test_new_signal_in_exported_arrays(folder: Path) -> None:
    with np.load(folder / 'export' / 'run.npz') as arrays:
        raw, limited = arrays['raw_torque'], arrays['command']
        assert (arrays['push'] == raw - limited).all()
        assert arrays['push'].any()
        assert (arrays['push_time_s'] == arrays['time_s']).all()
        norm = np.linalg.norm(arrays['error'], axis=1)
        assert arrays['stretched'][:, 0] == pytest.approx(norm, abs=1e-15)


def test_new_signal_in_exported_table(folder: Path) -> None:
    with (folder / 'export' / 'run.csv').open(newline='', encoding='utf-8') as stream:
        rows = list(csv.DictReader(stream))
    names = [name for name in rows[0] if name.startswith(('push', 'stretched'))]
    assert names == [
        'push_wheel_right_joint_N_m', 'push_wheel_left_joint_N_m',
        'push_arm_joint_1_N_m', 'push_arm_joint_2_N_m', 'stretched_m',
    ]  # fmt: skip
    assert all(float(row['stretched_m']) > 0.0 for row in rows)


def test_new_signal_in_report(folder: Path) -> None:
    html = (folder / 'report' / 'report.html').read_text(encoding='utf-8')
    page = Page(html)
    figure = page.figure('run-1-push')
    assert figure['layout']['yaxis']['title']['text'] == 'cut (N·m)'
    assert next(iter(lines(figure))) == 'cut of right wheel'
    (drawn,) = lines(page.figure('run-1-stretched')).values()
    assert len(drawn['y']) == 31
    assert 'No controller/' not in html


def test_new_signal_in_published_topics(folder: Path) -> None:
    script = (
        'from masmc_ros.messages.topics import TELEMETRY\n'
        'from masmc_ros.messages.topics import TOPICS\n'
        'content = {topic.name: topic.content for topic in TOPICS}\n'
        'print(TELEMETRY["cut_torque"], content["controller/cut_torque"])'
    )
    result = subprocess.run(
        [sys.executable, '-c', script], env={**child_environment(), 'PYTHONPATH': str(folder)},
        cwd=folder, capture_output=True, text=True, timeout=60.0, check=True,
    )
    assert result.stdout == '4 torque cut off by limits (4) in N·m, after [sec, nanosec]\n'
