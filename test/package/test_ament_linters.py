# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Linters of ROS packages (skipped without ROS), and licence headers."""

from __future__ import annotations

from pathlib import Path
import re
import subprocess

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = [
    str(ROOT / name)
    for name in (
        'masmc_ros', 'test', 'launch', 'benchmarks', 'examples', 'tools', 'scripts', 'setup.py'
    )
    if (ROOT / name).exists()
]


@pytest.mark.parametrize('linter', ['ament_flake8', 'ament_pep257'])
def test_linter_finds_nothing(linter: str) -> None:
    main = pytest.importorskip(f'{linter}.main')
    assert main.main(argv=SOURCES) == 0


HEADER = re.compile(
    r'(#!.*\n)?(#|//) Copyright 20\d\d The masmc_ros authors\n'
    r'\2 SPDX-License-Identifier: Apache-2\.0\n'
)


def test_source_files_have_licence_headers() -> None:
    listed = subprocess.run(
        ['git', '-C', str(ROOT), 'ls-files', '-z'], capture_output=True, check=False
    )
    if listed.returncode:
        pytest.skip('not a git checkout')
    sources = [
        ROOT / name
        for name in listed.stdout.decode().split('\0')
        if name.endswith(('.py', '.mjs', '.c'))
        or (name.startswith('tools/') and not name.endswith('.html'))
    ]
    sources = [path for path in sources if path.exists() and path.stat().st_size]
    assert len(sources) > 500
    assert [path for path in sources if not HEADER.match(path.read_text(encoding='utf-8'))] == []
