# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Compiled laws of other packages."""

from __future__ import annotations

import json
import os
from pathlib import Path
import re
import subprocess
import sys

import pytest

ROOT = Path(__file__).parents[2]

TIMEOUT = 300.0

SCRIPT = """
import json
import numpy as np
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.simulation import Simulation
from masmc_ros.scenario.scenario import load_scenario

names = 'controller.law=explicit_twisting', 'duration=2.0', 'controller.model_scale=1.0'
whole, single = (Simulation(load_scenario('config/paper.yaml', names)) for _ in range(2))
(run,) = whole.run()
plant, controller = single.plant, single.controller
for k in range(len(run.torque)):
    controller.tick(plant.position, plant.velocity, run.reference[k])
    assert (controller.torque == run.torque[k]).all(), k
    if k + 1 < len(run.torque):
        plant.advance(controller.torque)
controller.change({'explicit_twisting.k_1': 0.0, 'explicit_twisting.k_2': 0.0})
controller.reset_adaptation()
controller.tick(plant.position, plant.velocity, run.reference[-1])
without = controller.torque.copy()
controller.change({'law': 'smc', 'k_s1': (0.0,) * 4, 'k_s2': (0.0,) * 4})
controller.tick(plant.position, plant.velocity, run.reference[-1])
print(json.dumps({
    'is compiled': whole.controller.is_compiled,
    'model alone': bool((without == controller.torque).all()),
    'error': float(np.abs(run.error[-200:]).max()),
}))
"""


def example() -> str:
    """Return the source of the law in the documentation."""
    text = (ROOT / 'docs' / 'getting_started' / 'own_law.md').read_text(encoding='utf-8')
    match = re.search(r'```python\n# explicit_twisting\.py\n(.*?)```', text, re.DOTALL)
    assert match is not None
    return match.group(1)


@pytest.fixture(scope='module')
def installed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return the environment of a process with the installed law of the documentation."""
    folder = tmp_path_factory.mktemp('site')
    (folder / 'explicit_twisting.py').write_text(example(), encoding='utf-8')
    distribution = folder / 'explicit_twisting-1.0.dist-info'
    distribution.mkdir()
    (distribution / 'METADATA').write_text('Name: explicit_twisting\nVersion: 1.0\n')
    (distribution / 'entry_points.txt').write_text(
        '[masmc_ros.laws]\nexplicit_twisting = explicit_twisting:EXPLICIT_TWISTING\n'
    )
    path = os.pathsep.join([str(folder), str(ROOT), *filter(None, sys.path)])
    return {**os.environ, 'PYTHONPATH': path}


@pytest.mark.slow
def test_documented_law_installed_is_compiled_and_tuned(installed: dict[str, str]) -> None:
    done = subprocess.run(
        [sys.executable, '-c', SCRIPT],
        cwd=ROOT,
        env=installed,
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    results = json.loads(done.stdout)
    assert results['is compiled']
    assert results['model alone']
    assert results['error'] < 0.3
