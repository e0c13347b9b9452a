# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Extensions of a copy of the package by the blocks of docs/development/extending.md alone.

A block that starts with `# masmc_ros/...` is a new file, one that starts with `--- masmc_ros/...`
inserts lines. `test_documentation_examples.py` runs laws, paths and mechanisms of that page.
"""

from __future__ import annotations

import csv
from pathlib import Path
import re
import shutil
import subprocess
import sys

from helpers.child_environment import child_environment
from helpers.pages import blocks, DOCS, ROOT
from helpers.processes import peer, processes
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64


@pytest.fixture(scope='module')
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a copy of the package and all extensions."""
    site = tmp_path_factory.mktemp('site')
    shutil.copytree(ROOT / 'masmc_ros', site / 'masmc_ros')
    shutil.copytree(ROOT / 'config', site / 'config')
    count = 0
    for block in blocks(DOCS / 'development' / 'extending.md', 'python', 'diff'):
        if match := re.match(r'# (masmc_ros/\S+)\n', block):
            path = site / match[1]
            path.parent.mkdir(exist_ok=True)
            (path.parent / '__init__.py').touch()
            path.write_text(block, encoding='utf-8')
        elif match := re.match(r'--- (masmc_ros/\S+)\n', block):
            _insert(site / match[1], block[match.end():])
        count += match is not None
    assert count == 7
    return site


def _insert(path: Path, diff: str) -> None:
    """Insert the added lines of a diff after its unchanged ones, which occur once."""
    lines = diff.splitlines(keepends=True)
    before = ''.join(line[1:] for line in lines if line.startswith(' '))
    added = ''.join(line[1:] for line in lines if line.startswith('+'))
    text = path.read_text(encoding='utf-8')
    assert text.count(before) == 1, before
    path.write_text(text.replace(before, before + added), encoding='utf-8')


def masmc(site: Path, *arguments: str) -> str:
    """Run a command of the copy; return its output."""
    done = subprocess.run(
        [sys.executable, '-m', 'masmc_ros.cli.main', *arguments],
        cwd=site,
        env={**child_environment(), 'PYTHONPATH': str(site), 'NUMBA_DISABLE_JIT': '1'},
        capture_output=True,
        text=True,
        timeout=300.0,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_command_of_documentation_prints_joints(site: Path) -> None:
    assert masmc(site, 'joints', 'config/paper.yaml').splitlines() == [
        'wheel_right_joint', 'wheel_left_joint', 'arm_joint_1', 'arm_joint_2',
    ]
    assert 'joints' in masmc(site, '--help')


def test_metric_of_documentation_is_in_tables(site: Path) -> None:
    settings = '--set', 'duration=0.03', '--set', 'control_period=0.001'
    masmc(site, 'simulate', 'config/paper.yaml', *settings, '--output', 'run.mcap')
    assert 'largest torque' in masmc(site, 'report', 'run.mcap', '--output', 'report')
    with (site / 'report' / 'metrics.csv').open(newline='', encoding='utf-8') as stream:
        (row,) = csv.DictReader(stream)
    assert float(row['largest_torque (N·m)']) >= float(row['torque_rms (N·m)']) > 0.0
    assert 'largest torque' in (site / 'report' / 'report.html').read_text(encoding='utf-8')


def test_metric_without_sums_is_named_by_campaigns(site: Path) -> None:
    settings = '--set', 'duration=0.003', '--set', 'control_period=0.001'
    said = masmc(site, 'sweep', 'config/paper.yaml', '--vary', 'controller.sigma=0,1', *settings)
    assert 'not computed in campaigns: largest torque' in said
    assert 'largest torque' not in said.split('not computed')[0]


def test_node_of_documentation_publishes_largest_speed(site: Path, tmp_path: Path) -> None:
    with processes(tmp_path) as started, peer(started.domain) as tester:
        received: list[Float64] = []
        tester.subscribe(Float64, 'largest_speed', received.append, past=False)
        publisher = tester.publisher(JointState, 'joint_states')
        # Without the working directory in front of the path, which has the package as well.
        environment = {'PYTHONPATH': str(site), 'PYTHONSAFEPATH': '1'}
        started.start('speed', '--ros-args', '-p', 'factor:=2.0', environment=environment)
        state = JointState(velocity=[0.5, -1.5, 1.0])

        def is_received() -> bool:
            if not received:
                publisher.publish(state)
            return bool(received)

        tester.until(is_received, 'the largest speed')
        assert received[0].data == 3.0
