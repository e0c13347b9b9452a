# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""A built wheel in an empty environment outside the checkout: commands, nodes, and a law."""

from __future__ import annotations

import json
import os
from pathlib import Path
import shutil
import subprocess
import sys

from helpers.child_environment import domain, domain_variables
import pytest

ROOT = Path(__file__).resolve().parents[2]
PATIENCE = 900.0

INTERPRETED = {'NUMBA_DISABLE_JIT': '1'}
"""Variables for so few ticks that plain Python computes them faster than Numba compiles."""

LAW = """
import numpy as np


class Push:
    '''Request the same torque at every tick.'''

    parameters = ()

    def step(self, tick):
        return np.array([0.5, 0.5, 0.1, 0.1]), tick.estimate
"""
SETUP = """
from setuptools import setup

setup(
    name='pushing',
    version='1.0',
    py_modules=['pushing'],
    entry_points={'masmc_ros.laws': ['push = pushing:Push']},
)
"""

pytestmark = pytest.mark.slow


def run(folder: Path, *command: str | Path, **variables: str) -> str:
    """Run a command outside the checkout, without the environment of this process."""
    hidden = ('PYTHONPATH', 'LD_LIBRARY_PATH', '_ROS_WHEELS_BOOTSTRAP_COMPLETE', 'VIRTUAL_ENV')
    result = subprocess.run(
        list(map(str, command)),
        cwd=folder,
        env={n: v for n, v in os.environ.items() if n not in hidden} | variables,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert result.returncode == 0, result.stdout[-2000:] + result.stderr[-4000:]
    return result.stdout


def wheel_of(source: Path, folder: Path) -> Path:
    """Build a wheel with the tools of this environment."""
    offline = ('--quiet', '--no-deps', '--no-build-isolation', '--no-index')
    run(folder, sys.executable, '-m', 'pip', 'wheel', *offline, '-w', folder, source)
    (wheel,) = folder.glob('*.whl')
    return wheel


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the environment `env`."""
    if 'AMENT_PREFIX_PATH' in os.environ:
        pytest.skip('a ROS 2 installation is sourced')
    folder = tmp_path_factory.mktemp('wheel')
    source, package = folder / 'source', folder / 'pushing'
    unwanted = shutil.ignore_patterns('.*', '__pycache__', 'build', '*.egg-info', '*.mcap')
    shutil.copytree(ROOT, source, ignore=unwanted)
    package.mkdir()
    (package / 'pushing.py').write_text(LAW, encoding='utf-8')
    (package / 'setup.py').write_text(SETUP, encoding='utf-8')
    wheels = []
    for name, tree in (('own', source), ('law', package)):
        (folder / name).mkdir()
        wheels.append(wheel_of(tree, folder / name))
    run(folder, sys.executable, '-m', 'venv', folder / 'env')
    constraints = ('-c', ROOT / 'constraints.txt')
    pip = (folder / 'env' / 'bin' / 'python', '-m', 'pip', 'install', '--quiet')
    # Most modules of the dependencies are never imported here.
    run(folder, *pip, '--no-compile', *constraints, f'{wheels[0]}[ros]', wheels[1])
    shutil.rmtree(source)
    return folder


def masmc(folder: Path, *arguments: str, **variables: str) -> str:
    return run(folder, folder / 'env' / 'bin' / 'masmc', *arguments, **variables)


def test_wheel_nodes_run_is_recorded_and_recomputed(folder: Path) -> None:
    paper = folder / 'env' / 'share' / 'masmc_ros' / 'config' / 'paper.yaml'
    settings = ('-p', 'duration:=0.05', '-p', 'recorder:output:=nodes.mcap')
    arguments = ('--record', '--ros-args', '--params-file', str(paper), *settings)
    with domain() as number:
        masmc(folder, 'run', 'composed', *arguments, **domain_variables(number), **INTERPRETED)
    recomputed = masmc(folder, 'simulate', 'nodes.mcap', **INTERPRETED)
    assert 'all 51 states and 51 commands of nodes.mcap are bitwise identical' in recomputed


def test_wheel_law_of_package_simulated_and_reported(folder: Path) -> None:
    assert 'push' in masmc(folder, 'laws')
    settings = ('--set', 'controller.law=push', '--set', 'duration=0.5')
    result = json.loads(
        masmc(folder, 'simulate', 'paper', *settings, '--output', 'run.mcap', '--json')
    )
    assert result['runs'][0]['run'].startswith('push')
    report = json.loads(masmc(folder, 'report', 'run.mcap', '--json'))
    assert report['runs'][0]['torque_rms'] == pytest.approx(0.52**0.5)
    assert all((folder / file).exists() for file in report['files'])


def test_wheel_has_executables_of_ros2_run(folder: Path) -> None:
    help_text = run(folder, folder / 'env' / 'lib' / 'masmc_ros' / 'plant', '--help')
    assert 'control_period' in help_text
    marker = 'share/ament_index/resource_index/packages/masmc_ros'
    assert (folder / 'env' / marker).exists()
