# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The report as one page without external resources."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from markupsafe import Markup
from masmc_ros.report.measure.differences import run_order
from masmc_ros.report.measure.table import notes
from masmc_ros.report.measure.verdict import verdict
from masmc_ros.report.page.header import facts
from masmc_ros.report.page.interactive import adaptation_plots, comparison_plots, NAMED
from masmc_ros.report.page.metrics_table import (
    adaptation_table,
    hidden_differences,
    metrics_table,
)
from masmc_ros.report.page.packed_samples import COMPLETE
from masmc_ros.report.page.section import as_script, compressed, MANY, plots_of
from masmc_ros.report.page.template import rendered
from masmc_ros.report.page.trends import trends
from plotly.offline import get_plotlyjs

if TYPE_CHECKING:
    from masmc_ros.report.digest import Digest

_SOURCES = Path(__file__).parent
_PAGE = _SOURCES / 'page.html'
_SCRIPTS = (
    'library.js', 'lines.js', 'replay.js', 'cursor.js', 'table.js', 'trends.js', 'page.js',
)  # fmt: skip
_NAMED = 3
"""Maximum number of runs in the title of the page."""


def report_page(
    names: Sequence[str], digests: Sequence[Digest], compared: Sequence[int]
) -> str:
    """
    Return the report of runs as HTML, identical for identical runs.

    Scripts, styles and data are in the page; its content security policy prevents the browser
    from loading other resources.

    Parameters
    ----------
    names, digests
        Names and digests of the runs.
    compared
        Indices of the runs in the plots of all runs.

    """
    order = run_order([entry.run for entry in digests])
    chosen = set(compared)
    drawn = [(names[i], digests[i]) for i in order if i in chosen]
    of_all = [(names[i], digests[i]) for i in order]
    rows = {name: entry.metrics for name, entry in of_all}
    runs = [entry.run for _, entry in of_all]
    sections = [entry.section for _, entry in of_all]
    adapted = [(name, entry.adapted) for name, entry in of_all]
    span = 0.0, max(float(run.times[-1] - run.times[0]) for run in runs)
    is_deferred = len(runs) >= MANY
    trend = trends(runs, list(rows), list(rows.values()), sections) if is_deferred else None
    further = len(runs) - _NAMED
    return rendered(
        _PAGE,
        title=' · '.join([*names[:_NAMED], *([f'{further} others'] if further > 0 else [])]),
        verdict=verdict(rows),
        facts=facts(runs),
        table=metrics_table(rows, runs, [section.id for section in sections]),
        hidden=hidden_differences(runs),
        notes=notes(rows),
        comparison=plots_of(
            'all', comparison_plots([(name, entry.distances) for name, entry in drawn], span)
        ),
        errors=adaptation_table(adapted, [section.id for section in sections]),
        is_true=all(entry.is_true for _, entry in adapted if entry is not None),
        adaptation=plots_of(
            'all', adaptation_plots([(name, entry.adapted) for name, entry in drawn], span)
        ),
        runs=[
            {'id': section.id, 'label': name, 'content': section.content}
            for name, section in zip(rows, sections, strict=True)
        ],
        compared=len(drawn),
        span=span[1],
        trends=None if trend is None else as_script(trend),
        is_deferred=is_deferred,
        is_complete=len(runs) <= COMPLETE,
        has_legends=len(drawn) <= NAMED,
        plotly=compressed(get_plotlyjs()),
        scripts=_script(''.join((_SOURCES / n).read_text(encoding='utf-8') for n in _SCRIPTS)),
    )


def _script(text: str) -> Markup:
    """Return a script without end tags in its text."""
    return Markup(text.replace('</script', '<\\/script'))
