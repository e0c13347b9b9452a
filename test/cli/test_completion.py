# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Completion of `masmc` as a shell asks for it."""

from __future__ import annotations

from pathlib import Path
import subprocess
import sys

from helpers.child_environment import child_environment
import pytest

pytest.importorskip('argcomplete')


def completions(line: str, folder: Path) -> set[str]:
    """Return the completions of the last word of a line."""
    out = folder / 'completions'
    done = subprocess.run(
        [sys.executable, '-m', 'masmc_ros.cli.main'],
        env={
            **child_environment(), '_ARGCOMPLETE': '1', '_ARGCOMPLETE_IFS': '\n',
            '_ARGCOMPLETE_STDOUT_FILENAME': str(out), 'COMP_LINE': line,
            'COMP_POINT': str(len(line)),
        },
        cwd=folder, capture_output=True, text=True, timeout=120.0, check=False,
    )  # fmt: skip
    assert done.stdout == '', done.stderr
    return {word.strip() for word in out.read_text(encoding='utf-8').split('\n')}


@pytest.mark.parametrize(
    ('line', 'expected'),
    [
        ('masmc mon', 'monte-carlo'),
        ('masmc simulate pap', 'paper'),
        ('masmc simulate my', 'my.yaml'),
        ('masmc simulate paper --outp', '--output'),
        ('masmc run con', 'controller'),
    ],
)
def test_completion_of_a_word_is_the_only_one(
    line: str, expected: str, tmp_path: Path
) -> None:
    (tmp_path / 'my.yaml').touch()
    assert completions(line, tmp_path) == {expected}
