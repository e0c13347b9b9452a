# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The report as one page without external resources."""

from __future__ import annotations

import base64
from collections.abc import Sequence
import gzip
from pathlib import Path

from markupsafe import Markup
from masmc_ros.report.measure.adaptation import adaptation
from masmc_ros.report.measure.differences import run_order
from masmc_ros.report.measure.labels import as_text
from masmc_ros.report.measure.metrics import Metrics
from masmc_ros.report.measure.missing import missing
from masmc_ros.report.measure.parameters import change_texts, run_changes, value_text
from masmc_ros.report.measure.table import notes, remarks_of
from masmc_ros.report.measure.tracking import Compared
from masmc_ros.report.measure.verdict import verdict
from masmc_ros.report.page.header import facts
from masmc_ros.report.page.interactive import (
    adaptation_plots,
    comparison_plots,
    COMPLETE,
    NAMED,
    Plot,
    ranges_per_line,
    run_plots,
    span_of,
)
from masmc_ros.report.page.metrics_table import (
    adaptation_table,
    hidden_differences,
    metrics_table,
    section_of,
)
from masmc_ros.report.page.template import rendered
from plotly.offline import get_plotlyjs

_SOURCES = Path(__file__).parent
_PAGE = _SOURCES / 'page.html'
_SCRIPTS = ('library.js', 'lines.js', 'cursor.js', 'table.js', 'page.js')
_LISTED = 5
"""Maximum number of later values in a row of the parameters."""

_ESCAPES = {'<': '\\u003c', '>': '\\u003e', '&': '\\u0026'}


def report_page(compared: Sequence[Compared], reached: Sequence[Metrics]) -> str:
    """
    Return the report of runs as HTML, identical for identical runs.

    Scripts, styles and data are in the page; its content security policy prevents the browser
    from loading other resources.
    """
    order = run_order([entry.run for entry in compared])
    compared, reached = [compared[i] for i in order], [reached[i] for i in order]
    rows = {entry.label: row for entry, row in zip(compared, reached, strict=True)}
    runs = [entry.run for entry in compared]
    adapted = [(entry.label, adaptation(entry.run)) for entry in compared]
    span, ranges = span_of(runs), ranges_per_line(len(runs))
    return rendered(
        _PAGE,
        verdict=verdict(rows),
        facts=facts(runs),
        table=metrics_table(rows, runs),
        hidden=hidden_differences(runs),
        notes=notes(rows),
        comparison=_plots('all', comparison_plots(compared, span, ranges)),
        errors=adaptation_table(adapted),
        is_true=all(entry.is_true for _, entry in adapted if entry is not None),
        adaptation=_plots('all', adaptation_plots(adapted, span, ranges)),
        runs=[
            _run(number, entry, row, run_plots(entry, span, ranges, has_estimates=known is None))
            for number, (entry, row, (_, known)) in enumerate(
                zip(compared, reached, adapted, strict=True), start=1
            )
        ],
        is_complete=len(runs) <= COMPLETE,
        has_legends=len(runs) <= NAMED,
        plotly=_compressed(get_plotlyjs()),
        scripts=_script(''.join((_SOURCES / n).read_text(encoding='utf-8') for n in _SCRIPTS)),
    )


def _run(
    number: int, entry: Compared, row: Metrics, plots: Sequence[Plot]
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
        'id': section_of(number),
        'label': entry.label,
        'path': as_text(str(run.path)),
        'states': len(run.times),
        'duration': f'{run.times[-1] - run.times[0]:g}',
        'remarks': remarks_of(row),
        'missing': missing(run, entry.tracked),
        'changes': [
            (f'{c.time:.3f}', c.tick, c.node, c.name, *change_texts(c))
            for c in changes
        ],
        'plots': _plots(section_of(number), plots),
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


def _plots(prefix: str, plots: Sequence[Plot]) -> list[dict[str, object]]:
    return [
        {
            'id': f'{prefix}-{plot.name}',
            'title': plot.title,
            'is_over_time': plot.is_over_time,
            'data': _json(plot),
        }
        for plot in plots
    ]


def _json(plot: Plot) -> Markup:
    """Return a plot as JSON for a script element."""
    text = plot.figure.to_json(engine='json')
    for letter, escape in _ESCAPES.items():
        text = text.replace(letter, escape)
    return Markup(text)


def _compressed(text: str) -> str:
    """Return a text as base64 of gzip, the same for the same text."""
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode()


def _script(text: str) -> Markup:
    """Return a script without end tags in its text."""
    return Markup(text.replace('</script', '<\\/script'))
