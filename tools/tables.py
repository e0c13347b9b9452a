# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Generator of the tables in README.md and docs/: `python tools/tables.py [--check]`.

A table stands between the lines `<!-- table: NAME -->` and `<!-- end -->`. The results of the
comparison of the laws are those of `python tools/compare_laws.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
import csv
from itertools import groupby
from pathlib import Path
import re
import sys
from unittest.mock import patch

from claims import BY_SOURCE, Claim, CLAIMS, SHARP, THEORY
from masmc_ros.compare.trials import TRIALS_OF_LAWS
from masmc_ros.law import registry
from masmc_ros.law.reaching.implicit import IMPLICIT
from masmc_ros.law.reaching.reaching import BOUNDARY_LAYER
from masmc_ros.messages.topics import SYSTEM_TOPICS, TOPICS
from masmc_ros.params import plug_ins
from masmc_ros.params.presentation import markdown_table
from masmc_ros.report.measure.labels import OBSERVER
from masmc_ros.report.measure.tracking import SMALL
from masmc_ros.scenario.node_parameters import declared, NODES, shared
import numpy as np

ROOT = Path(__file__).resolve().parent.parent
PAPER_LAWS = ('smc', 'rasmc')
PUBLISHERS = ('plant', 'trajectory', 'controller')

COMMON = {BOUNDARY_LAYER.name}
"""Parameters of switching terms that some laws read, too."""

Result = Mapping[str, str]
"""Row of the results of the comparison by column; an infinite number is empty."""

_OF_LAWS = {
    trial.name: trial.name.replace(', limits', ' L').replace(', observer', ' O')
    for trial in TRIALS_OF_LAWS
}
_CONDITIONS = {
    'as it is': 'half model', 'true model': 'true model', 'noise': 'noise', 'delay': '5 ms delay'
}
"""Heads of columns by names of trials."""

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
        'claims': _claims(),
        **{
            f'{page} claims': _claims_of(page, list(claims))
            for page, claims in groupby((*CLAIMS, *THEORY), key=lambda claim: claim.page)
        },
        **_comparison(),
    }


def _laws() -> str:
    lines = ['| law | summary | source |', '|---|---|---|']
    for name, law in registry.LAWS.items():
        lines.append(f'| [`{name}`]({name}.md) | {law.summary} | {law.source} |')
    return '\n'.join(lines) + '\n'


def _claims() -> str:
    """Return the table of all claims."""
    lines = ['| page | claim | method | range | draws | first counterexample |']
    lines.append('|---|---|---|---|---:|---:|')
    beyond = f'≤ {100.0 * (SHARP - 1.0):.2g} %'
    for claim in (*CLAIMS, *THEORY):
        place = '../../theory/' if claim in THEORY else ''
        cells = (
            f'[`{claim.page}`]({place}{claim.page}.md)', claim.sentence, claim.method,
            claim.range_text, str(claim.draws), beyond,
        )  # fmt: skip
        lines.append(f'| {" | ".join(cells)} |')
    return '\n'.join(lines) + '\n'


def _claims_of(page: str, claims: Sequence[Claim]) -> str:
    """Return the statements of a page."""
    folder = '../reference/laws/' if claims[0] in THEORY else ''
    lines = [f'**Examined** by [searches for counterexamples]({folder}claims.md):', '']
    lines += [f'- {claim.sentence}' for claim in claims]
    if page in BY_SOURCE:
        lines += ['', f'**By the source:** {BY_SOURCE[page]}.']
    return '\n'.join(lines) + '\n'


def _comparison() -> dict[str, str]:
    """Return the tables of the comparison of the laws by name."""
    results = ROOT / 'docs' / 'reference' / 'laws' / 'comparison.csv'
    rows = list(csv.DictReader(results.open(encoding='utf-8')))
    known = {}
    for scenario in ('paper', 'robust'):
        of_scenario = [row for row in rows if row['part'] == scenario]
        known[f'errors {scenario}'] = _by_trials(of_scenario, _OF_LAWS, _error)
        known[f'variations {scenario}'] = _by_trials(of_scenario, _OF_LAWS, _variation)
    conditions = [row for row in rows if row['part'] == 'conditions']
    known['conditions'] = _by_trials(conditions, _CONDITIONS, _error)
    for name in ('robots', 'fast drives'):
        known[name] = _robots([row for row in rows if row['part'].startswith(name)])
    known['tuned'] = _tuned(rows)
    return known


def _by_trials(
    rows: Sequence[Result], heads: Mapping[str, str], cell: Callable[[Result], str]
) -> str:
    """
    Return a table of laws by trials, the smallest error in the first trial first.

    Parameters
    ----------
    rows
        Results.
    heads
        Heads of the columns by names of trials.
    cell
        Function of the text of a result.

    """
    by_law: dict[str, dict[str, Result]] = {}
    for row in rows:
        by_law.setdefault(_label(row), {})[row['trial']] = row
    ranked = sorted(by_law.items(), key=lambda entry: _size(entry[1][next(iter(heads))]))
    lines = [f'| law | {" | ".join(heads.values())} |', f'|---|{"---:|" * len(heads)}']
    for law, trials in ranked:
        lines.append(f'| {law} | {" | ".join(cell(trials[name]) for name in heads)} |')
    return '\n'.join(lines) + '\n'


def _robots(rows: Sequence[Result]) -> str:
    """Return the table of random robots, the smallest error first."""
    lines = ['| law | median | worst | E | F | torque | variation | lost |']
    lines.append('|---|---:|---:|---:|---:|---:|---:|---:|')
    for row in sorted(rows, key=_size):
        is_without = row['part'].endswith('without estimate')
        has_estimate = row['switching'] == IMPLICIT.name and not is_without
        errors = [row[name] for name in ('error', 'worst', 'end_effector_rms', 'platform_rms')]
        efforts = [row[name] for name in ('torque_rms', 'torque_variation')]
        cells = [
            *(_short(SMALL * float(value)) if value else 'lost' for value in errors),
            *(_short(float(value)) if value else '-' for value in efforts),
        ]
        label = f'{_label(row)}{OBSERVER if has_estimate else ""}'
        lines.append(f'| {label} | {" | ".join(cells)} | {row["lost"]} |')
    return '\n'.join(lines) + '\n'


def _tuned(rows: Sequence[Result]) -> str:
    """Return the table of default and tuned gains on the same robots, by the tuned error."""
    parts = ('default gains', 'tuned', 'tuned at 1000 N·m/s')
    by_law = {(row['part'], _label(row)): row for row in rows}
    lines = ['| law | default | worst | variation | tuned | worst | variation '
             '| ≤ 1000 N·m/s | worst | variation |']  # fmt: skip
    lines.append(f'|---|{"---:|" * 3 * len(parts)}')
    for row in sorted((row for row in rows if row['part'] == 'tuned'), key=_size):
        cells = [_label(row)]
        for part in parts:
            known = by_law.get((part, _label(row)))
            cells += (
                [_error(known), _worst(known), _variation(known)] if known else ['-'] * 3
            )
        lines.append(f'| {" | ".join(cells)} |')
    return '\n'.join(lines) + '\n'


def _label(row: Result) -> str:
    name = f'[`{row["law"]}`]({row["law"]}.md)'
    return f'{name}, {row["switching"]}' if row['switching'] else name


def _short(value: float) -> str:
    """Return a number with three significant digits."""
    return np.format_float_positional(value, 3, unique=False, fractional=False, trim='-')


def _size(row: Result) -> float:
    return float(row['error'] or 'inf')


def _error(row: Result) -> str:
    """Return the error in mm, with the number of lost runs."""
    if not row['error']:
        return 'lost'
    text = _short(SMALL * float(row['error']))
    return text if row['lost'] == '0' else f'{text} ({row["lost"]})'


def _worst(row: Result) -> str:
    return _short(SMALL * float(row['worst'])) if row['worst'] else 'lost'


def _variation(row: Result) -> str:
    return _short(float(row['torque_variation'])) if row['torque_variation'] else '-'


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
