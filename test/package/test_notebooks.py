# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The notebooks of the documentation run, print their stored text, and have stored figures."""

from __future__ import annotations

import json
from pathlib import Path
import re
import subprocess
import sys

from helpers.child_environment import child_environment
import pytest

ROOT = Path(__file__).resolve().parents[2]
RUNNER = ROOT / 'test' / 'helpers' / 'notebook.py'
NOTEBOOKS = sorted((ROOT / 'docs' / 'notebooks').glob('*.ipynb'))
LIMIT = 200_000  # bytes of a notebook in the repository

each_notebook = pytest.mark.parametrize('notebook', NOTEBOOKS, ids=lambda path: path.stem)


def execute(notebook: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    """Execute a notebook in a folder."""
    return subprocess.run(
        [sys.executable, str(RUNNER), str(notebook)],
        cwd=folder,
        env={**child_environment(), 'MPLBACKEND': 'agg'},
        capture_output=True,
        text=True,
        timeout=1800.0,  # s, including the compilation
        check=False,
    )


@pytest.mark.slow
@each_notebook
def test_notebook_prints_its_stored_text(notebook: Path, tmp_path: Path) -> None:
    result = execute(notebook, tmp_path)
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize('source', ['print(1)', 'raise ValueError'])
def test_notebook_other_text_or_error_fails(source: str, tmp_path: Path) -> None:
    output = {'output_type': 'stream', 'name': 'stdout', 'text': ['2\n']}
    cell = {'cell_type': 'code', 'source': [source], 'outputs': [output]}
    notebook = tmp_path / 'wrong.ipynb'
    notebook.write_text(json.dumps({'cells': [cell]}))
    result = execute(notebook, tmp_path)
    assert result.returncode == 1
    assert 'wrong.ipynb, cell 0' in result.stderr


@each_notebook
def test_notebook_stored_outputs_small_and_without_errors(notebook: Path) -> None:
    text = notebook.read_text(encoding='utf-8')
    outputs = [o for cell in json.loads(text)['cells'] for o in cell.get('outputs', ())]
    kinds = {output['output_type'] for output in outputs}
    assert any('image/png' in output.get('data', ()) for output in outputs)
    assert 'error' not in kinds
    assert 'stderr' not in {output.get('name') for output in outputs}
    assert len(text.encode()) < LIMIT


@each_notebook
def test_notebook_links_lead_somewhere(notebook: Path) -> None:
    for target in re.findall(r'\]\((?!https?:|#)([^)#\s]+)', notebook.read_text(encoding='utf-8')):
        assert (notebook.parent / target).exists(), target
