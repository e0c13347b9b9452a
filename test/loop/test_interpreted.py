# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Ticks in plain Python, for debuggers: laws, effects and supervision on all kinds of robots."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
import re
import shlex
import subprocess
import sys

from helpers import interpreted_ticks
from helpers.child_environment import child_environment
from helpers.pages import DOCS, ROOT
import pytest

SCRIPT = Path(interpreted_ticks.__file__)


def output_of(*arguments: str, folder: Path, text: str = '') -> str:
    """Return the output of Python without the compiler."""
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**child_environment(), 'NUMBA_DISABLE_JIT': '1'},
        input=text,
        stdout=subprocess.PIPE,
        text=True,
        timeout=300.0,
        check=True,
    ).stdout


@pytest.mark.parametrize(
    'robots',
    [
        ('paper',),
        pytest.param(
            ('ur5', 'tiago', 'franka_on_omni'),
            marks=pytest.mark.skipif(
                find_spec('pinocchio') is None, reason='the URDFs are part of the extra `robots`'
            ),
        ),
    ],
    ids=lambda robots: robots[0],
)
def test_interpreted_laws_effects_and_supervision_run(
    robots: tuple[str, ...], tmp_path: Path
) -> None:
    assert output_of(str(SCRIPT), *robots, folder=tmp_path) == ''


def test_interpreted_law_in_documented_debugger_stops() -> None:
    page = (DOCS / 'development' / 'debugging.md').read_text(encoding='utf-8')
    patterns = r'\n(\S+ python -m pdb .*?)```', r'```pdb\n(.*?)```'
    (command,), (inputs,) = (re.findall(one, page, re.DOTALL) for one in patterns)
    words = shlex.split(command.replace('\\\n', ''))
    assert words[:2] == ['NUMBA_DISABLE_JIT=1', 'python']
    output = output_of(*words[2:], folder=ROOT, text=f'{inputs}quit\n')
    assert 'nu = _requested(settings, tick, memory)' in output  # stops in the torque
    vectors = re.findall(r'^\(Pdb\) (\(.*\))$', output, re.MULTILINE)
    assert [text.count(',') for text in vectors] == [3, 3, 3]  # one number per task axis
    assert re.search(r'^\(Pdb\) s = .*\nw = .*\nk_1 = .*15\.0', output, re.MULTILINE)
    assert 'law.learn(settings, tick, memory, raw, torque)' in output.rpartition('k_1 = ')[2]
