# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Section of a run on the page: its plots, changes, parameters and origin."""

from __future__ import annotations

import base64
from collections.abc import Sequence
import gzip
import json
from pathlib import Path
from typing import NamedTuple

from markupsafe import Markup
from masmc_ros.report.measure.findings import missing
from masmc_ros.report.measure.labels import as_text
from masmc_ros.report.measure.metrics import Metrics
from masmc_ros.report.measure.parameters import change_texts, run_changes, value_text
from masmc_ros.report.measure.table import remarks_of
from masmc_ros.report.measure.tracking import Compared
from masmc_ros.report.page.interactive import Plot, run_plots
from masmc_ros.report.page.metrics_table import section_of
from masmc_ros.report.page.packed_samples import ranges_per_line
from masmc_ros.report.page.template import rendered

MANY = 6
"""Minimum number of runs whose sections are drawn when they are opened."""

_TEMPLATE = Path(__file__).with_name('run.html')

_LISTED = 5
"""Maximum number of later values in a row of the parameters."""

_ESCAPES = {'<': '\u003c', '>': '\u003e', '&': '\u0026'}


class Section(NamedTuple):
    """Section of a run: its identifier, and its content, compressed if it is opened later."""

    id: str
    content: str


def run_section(
    place: int, entry: Compared, row: Metrics, *, count: int, has_estimates: bool
) -> Section:
    """
    Return the section of a run.

    Parameters
    ----------
    place
        Place of its log, from 1.
    entry, row
        Run and its metrics.
    count
        Number of runs of the page.
    has_estimates
        Whether the section has the estimates; the plots of the adaptation have them otherwise.

    """
    name = section_of(place)
    plots = run_plots(entry, ranges_per_line(count), has_estimates=has_estimates)
    content = rendered(_TEMPLATE, run=_values(name, entry, row, plots))
    return Section(name, compressed(content) if count >= MANY else Markup(content))


def _values(
    name: str, entry: Compared, row: Metrics, plots: Sequence[Plot]
) -> dict[str, object]:
    """Return the values of a run for the template."""
    run = entry.run
    changes = run_changes(run)
    later: dict[tuple[str, str], list[str]] = {}
    for change in changes:
        if change.is_event:
            continue
        text = f'{value_text(change.new)} from {change.time:.3f} s'
        later.setdefault((change.node, change.name), []).append(text)
    return {
        'path': as_text(str(run.path)),
        'states': len(run.times),
        'duration': f'{run.times[-1] - run.times[0]:g}',
        'remarks': remarks_of(row),
        'missing': missing(run, entry.tracked),
        'changes': [
            (f'{c.time:.3f}', c.tick, c.node, c.name, *change_texts(c))
            for c in changes
        ],
        'plots': plots_of(name, plots),
        'parameters': {
            node: [
                (name, value_text(value), _later(later.get((node, name), [])))
                for name, value in sorted(values.items())
            ]
            for node, values in run.parameters.items()
        },
        'versions': [
            item for record in run.metadata.get('versions', ()) for item in record.items()
        ],
        'topics': sorted(run.topics.items()),
        'attachments': [(name, len(content)) for name, content in run.attachments.items()],
    }


def _later(texts: Sequence[str]) -> str:
    """Return the later values of a parameter; of many the last one and their number."""
    if len(texts) <= _LISTED:
        return ', '.join(texts)
    return f'{texts[-1]}, after {len(texts) - 1} other changes'


def plots_of(prefix: str, plots: Sequence[Plot]) -> list[dict[str, object]]:
    """Return plots for the template, with identifiers that start with a prefix."""
    return [
        {
            'id': f'{prefix}-{plot.name}',
            'title': plot.title,
            'is_over_time': plot.is_over_time,
            'data': as_script(plot.figure),
        }
        for plot in plots
    ]


def as_script(value: object) -> Markup:
    """Return a value as JSON for a script element."""
    text = json.dumps(value, separators=(',', ':'))
    for letter, escape in _ESCAPES.items():
        text = text.replace(letter, escape)
    return Markup(text)


def compressed(text: str) -> str:
    """Return a text as base64 of gzip, the same for the same text."""
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode()
