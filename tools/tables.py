# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Generator of the tables in README.md and docs/: `python tools/tables.py [--check]`.

A table stands between the lines `<!-- table: NAME -->` and `<!-- end -->`.
"""

from __future__ import annotations

from pathlib import Path
import re
import sys
from unittest.mock import patch

from masmc_ros.law import registry
from masmc_ros.law.reaching.reaching import BOUNDARY_LAYER
from masmc_ros.messages.topics import SYSTEM_TOPICS, TOPICS
from masmc_ros.params import plug_ins
from masmc_ros.params.documentation import markdown_table
from masmc_ros.params.node_parameters import declared, NODES, shared

ROOT = Path(__file__).resolve().parent.parent
PAPER_LAWS = ('smc', 'rasmc')
PUBLISHERS = ('plant', 'trajectory', 'controller')

COMMON = {BOUNDARY_LAYER.name}
"""Parameters of switching terms that some laws read, too."""

_BLOCK = re.compile(r'(<!-- table: ([a-z_ ]+) -->\n).*?(<!-- end -->)', re.DOTALL)


def tables() -> dict[str, str]:
    """Return every table in Markdown by its name, without plug-ins of this machine."""
    with patch.object(plug_ins, 'entry_points', lambda **_: ()):
        return _tables()


def _tables() -> dict[str, str]:
    names = {parameter.name for parameter in shared()}
    # Parameters of the other laws are in docs/reference/laws/.
    paper = {p.name for name in PAPER_LAWS for p in registry.LAWS[name].parameters}
    of_laws = {
        law.name: {p.name for p in law.parameters} - paper for law in registry.LAWS.values()
    }
    hidden = names.union(*of_laws.values()) - COMMON
    own = {
        node: tuple(p for p in declared(node) if p.name not in hidden) for node in NODES
    }
    controller = declared('controller')
    return {
        'topics': _topics(),
        'shared parameters': markdown_table(shared()),
        **{f'{node} parameters': markdown_table(own[node]) for node in NODES},
        **{f'{node} publications': _publications(node) for node in PUBLISHERS},
        **{
            f'{name} law': markdown_table(tuple(p for p in controller if p.name in of_law))
            for name, of_law in of_laws.items()
            if name not in PAPER_LAWS
        },
        'laws': _laws(),
    }


def _laws() -> str:
    lines = ['| law | summary | source |', '|---|---|---|']
    for name, law in registry.LAWS.items():
        lines.append(f'| [`{name}`]({name}.md) | {law.summary} | {law.source} |')
    return '\n'.join(lines) + '\n'


def _topics() -> str:
    lines = ['| topic | type | from → to |', '|---|---|---|']
    for topic in (*TOPICS, *SYSTEM_TOPICS):
        kind = topic.type_name.replace('/msg/', '/')
        lines.append(f'| `{topic.name}` | {kind} | {topic.direction} |')
    return '\n'.join(lines) + '\n'


def _publications(node: str) -> str:
    """Return the topics that a node publishes, without those of every ROS 2 node."""
    lines = ['| topic | type | content |', '|---|---|---|']
    for topic in TOPICS:
        if node in topic.direction.split('→')[0].replace(' ', '').split(','):
            kind = topic.type_name.replace('/msg/', '/')
            lines.append(f'| `{topic.name}` | {kind} | {topic.content} |')
    return '\n'.join(lines) + '\n'


def renewed(text: str) -> str:
    """Return a document with current tables; raise KeyError for an unknown one."""
    known = tables()
    return _BLOCK.sub(lambda match: match[1] + known[match[2]] + match[3], text)


def documents() -> list[Path]:
    """Return the documents that may contain tables."""
    return [ROOT / 'README.md', *sorted((ROOT / 'docs').rglob('*.md'))]


def main() -> int:
    """Update all documents; with --check print the outdated ones."""
    stale = []
    for path in documents():
        text = path.read_text(encoding='utf-8')
        new = renewed(text)
        if new != text:
            stale.append(str(path.relative_to(ROOT)))
            if '--check' not in sys.argv:
                path.write_text(new, encoding='utf-8')
    if stale:
        print(('not current: ' if '--check' in sys.argv else 'renewed: ') + ', '.join(stale))
    return 1 if stale and '--check' in sys.argv else 0


if __name__ == '__main__':
    sys.exit(main())
