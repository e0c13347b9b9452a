# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The report as one page without external resources."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from markupsafe import Markup
from masmc_ros.report.measure.labels import as_text
from masmc_ros.report.measure.metrics import Metrics
from masmc_ros.report.measure.missing import missing
from masmc_ros.report.measure.parameters import change_texts, run_changes, value_text
from masmc_ros.report.measure.table import cells, heads, notes
from masmc_ros.report.measure.tracking import Compared
from masmc_ros.report.page.interactive import comparison_plots, Plot, run_plots, span_of
from masmc_ros.report.page.template import rendered
from plotly.offline import get_plotlyjs

_SOURCES = Path(__file__).parent
_PAGE = _SOURCES / 'page.html'
_SCRIPTS = ('lines.js', 'page.js')
_ESCAPES = {'<': '\\u003c', '>': '\\u003e', '&': '\\u0026'}


def report_page(compared: Sequence[Compared], reached: Sequence[Metrics]) -> str:
    """
    Return the report of runs as HTML, identical for identical runs.

    Scripts, styles and data are in the page; its content security policy prevents the browser
    from loading other resources.
    """
    rows = {entry.label: row for entry, row in zip(compared, reached, strict=True)}
    span = span_of([entry.run for entry in compared])
    return rendered(
        _PAGE,
        heads=[f'{name} {unit}'.rstrip() for name, unit in heads(rows)],
        rows=cells(rows),
        notes=notes(rows),
        comparison=_plots('all', comparison_plots(compared, span)),
        runs=[_run(number, entry, span) for number, entry in enumerate(compared, start=1)],
        plotly=_script(get_plotlyjs()),
        scripts=_script(''.join((_SOURCES / n).read_text(encoding='utf-8') for n in _SCRIPTS)),
    )


def _run(number: int, entry: Compared, span: tuple[float, float]) -> dict[str, object]:
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
        'id': f'run-{number}',
        'label': entry.label,
        'path': as_text(str(run.path)),
        'states': len(run.times),
        'duration': f'{run.times[-1] - run.times[0]:g}',
        'missing': missing(run, entry.tracked),
        'changes': [
            (f'{c.time:.3f}', c.tick, c.node, c.name, *change_texts(c))
            for c in changes
        ],
        'plots': _plots(f'run-{number}', run_plots(entry, span)),
        'parameters': {
            node: [
                (name, value_text(value), ', '.join(later.get((node, name), ())))
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


def _script(text: str) -> Markup:
    """Return a script without end tags in its text."""
    return Markup(text.replace('</script', '<\\/script'))
