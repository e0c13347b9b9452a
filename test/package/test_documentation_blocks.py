# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Fenced blocks of README.md and docs/: they are parsed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import re
import shlex
import shutil
import subprocess

from masmc_ros.cli.main import parser_for
import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
API = ROOT / 'docs' / 'api'
PAGES = [
    page
    for page in [ROOT / 'README.md', *sorted((ROOT / 'docs').rglob('*.md'))]
    if API not in page.parents
]
FENCE = re.compile(r'^( *)```(\w+)\n(.*?)^\1```$', re.DOTALL | re.MULTILINE)
OPTIONAL = re.compile(r'\[(-[^\]]*)\]')
"""Brackets around options that may be left out."""
ENDS_COMMAND = {'|', '>', '>>', '&&', '&', ';'}


def blocks(page: Path, *languages: str) -> list[str]:
    text = page.read_text(encoding='utf-8')
    return [body for _, language, body in FENCE.findall(text) if language in languages]


def commands(page: Path) -> Iterator[list[str]]:
    """Yield the commands of the shell blocks of a page as words."""
    for block in blocks(page, 'sh'):
        for line in block.replace('\\\n', ' ').splitlines():
            line = OPTIONAL.sub(r'\1', line.replace('[...]', ''))
            words = shlex.split(line, comments=True)
            command: list[str] = []
            for word in [*words, ';']:
                if word in ENDS_COMMAND:
                    if command:
                        yield command
                    command = []
                else:
                    command.append(word)


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_python_blocks_compile(page: Path) -> None:
    for block in blocks(page, 'python'):
        if block.startswith('    '):  # a line of a longer statement
            block = f'(\n{block})'
        compile(block, str(page), 'exec')


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_yaml_blocks_are_yaml(page: Path) -> None:
    for block in blocks(page, 'yaml'):
        assert yaml.safe_load(block) is not None


@pytest.mark.skipif(shutil.which('bash') is None, reason='no bash here')
@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_shell_blocks_parse(page: Path) -> None:
    for block in blocks(page, 'sh'):
        result = subprocess.run(['bash', '-n'], input=block, capture_output=True, text=True)
        assert result.returncode == 0, f'{block}\n{result.stderr}'


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_masmc_commands_parse(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words in commands(page):
        if words[0] == 'masmc' and words[1:2] != ['run']:
            try:
                parser_for(words[1:]).parse_args(words[1:])
            except SystemExit as ended:
                if ended.code:  # --list and --help end with status 0
                    pytest.fail(f'{shlex.join(words)}: {capsys.readouterr().err}')


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_make_targets_exist(page: Path) -> None:
    targets = re.findall(r'^([a-z-]+):', (ROOT / 'Makefile').read_text(), re.MULTILINE)
    for words in commands(page):
        if words[0] == 'make':
            for target in (word for word in words[1:] if '=' not in word):
                assert target in targets, shlex.join(words)
