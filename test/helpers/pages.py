# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Pages of the documentation and their code blocks, read by sybil."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import re
import shlex

from sybil import Sybil
from sybil.document import Document
from sybil.example import Example
from sybil.parsers.markdown import CodeBlockParser
from sybil.typing import Evaluator

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / 'docs'
PAGES = [
    ROOT / 'README.md',
    ROOT / 'CONTRIBUTING.md',
    *(page for page in sorted(DOCS.rglob('*.md')) if DOCS / 'api' not in page.parents),
]
"""Pages written by hand; docs/api is written by a build of the site."""

_OPTIONAL = re.compile(r'\[(-[^\]]*)\]')
"""Options in brackets, which the user may omit."""

_PLACEHOLDERS = {'CONFIG': 'robust', '=MU': '=0.3', '=LAW': '=smc', '[...]': ''}
"""Words of shell blocks that the user replaces, with an example."""

_END = {'|', '&&', '&', ';'}
_ASSIGNMENT = re.compile(r'[A-Z_]+=.*')


def page_name(page: Path) -> str:
    """Return the name of a page, for the name of a test."""
    return str(page.relative_to(ROOT).with_suffix('')).removeprefix('docs/')


def document(page: Path, evaluators: dict[str, Evaluator]) -> Document:
    """Return a page whose blocks of the given languages are examples."""
    parsers = [CodeBlockParser(*language) for language in evaluators.items()]
    return Sybil(parsers).parse(page)


def blocks(page: Path, *languages: str) -> list[str]:
    """Return the blocks of some languages."""
    return [
        example.parsed for example in document(page, dict.fromkeys(languages, _ignore)).examples()
    ]


def _ignore(example: Example) -> None:
    pass


def commands(block: str) -> Iterator[list[str]]:
    """Yield the commands of a shell block as words, without variables and redirections."""
    block = block.replace('\\\n', ' ')
    for placeholder, value in _PLACEHOLDERS.items():
        block = block.replace(placeholder, value)
    for line in block.splitlines():
        command: list[str] = []
        for word in [*shlex.split(_OPTIONAL.sub(r'\1', line), comments=True), ';']:
            if word in _END:
                if '>' in command:
                    command = command[: command.index('>')]
                if command:
                    yield command
                command = []
            elif command or not _ASSIGNMENT.fullmatch(word):
                command.append(word)


def console(block: str) -> Iterator[tuple[list[str], str]]:
    """Yield the commands of a console block with their output."""
    for entry in re.split(r'^\$ ', block, flags=re.MULTILINE)[1:]:
        line, _, output = entry.partition('\n')
        (command,) = commands(line)
        yield command, output


def all_commands(page: Path) -> Iterator[list[str]]:
    """Yield the commands of all shell and console blocks of a page."""
    for block in blocks(page, 'sh'):
        yield from commands(block)
    for block in blocks(page, 'console'):
        for command, _ in console(block):
            yield command
