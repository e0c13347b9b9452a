# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The report as one page without external resources: facts, plots, trends and tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from datetime import datetime, UTC
import math
from pathlib import Path
from typing import TYPE_CHECKING

from markupsafe import Markup
from masmc_ros.law.parts.model import MODEL_SCALE
from masmc_ros.log.read.reader import Run
from masmc_ros.report.measure.adaptation import assumed_model
from masmc_ros.report.measure.findings import verdict
from masmc_ros.report.measure.labels import as_line
from masmc_ros.report.measure.metrics import Metrics
from masmc_ros.report.measure.parameters import differences, run_order
from masmc_ros.report.measure.table import notes, shown_columns
from masmc_ros.report.page.interactive import adaptation_plots, comparison_plots, NAMED
from masmc_ros.report.page.metrics_table import adaptation_table, hidden_differences, metrics_table
from masmc_ros.report.page.packed_samples import COMPLETE
from masmc_ros.report.page.section import as_script, compressed, MANY, plots_of, Section
from masmc_ros.report.page.template import rendered
from masmc_ros.report.panels import COLOURS
from plotly.offline import get_plotlyjs

if TYPE_CHECKING:
    from masmc_ros.report.digest import Digest


_FIRST_DATE = 1.0e9
"""Time in s from which a stamp is a date; smaller ones count from the start of a simulation."""

_LISTED = 3
"""Maximum number of different texts of a fact."""

_SUFFIXES = '.yaml', '.yml'


def facts(runs: Sequence[Run]) -> list[tuple[str, str]]:
    """Return names and texts of the facts that the logs contain; differing texts are listed."""
    named = {
        'scenario': (_scenario(run) for run in runs),
        'assumed model': (_assumed(run) for run in runs),
        'date': (_date(run) for run in runs),
        'version': (_version(run) for run in runs),
    }
    texts = ((name, _joined(values)) for name, values in named.items())
    return [(name, text) for name, text in texts if text]


def _joined(texts: Iterable[str]) -> str:
    """Return different texts, of many the first ones and their number."""
    distinct = [text for text in dict.fromkeys(texts) if text]
    further = len(distinct) - _LISTED
    shown = ' or '.join(distinct[:_LISTED])
    return f'{shown} or {further} others' if further > 0 else shown


def _scenario(run: Run) -> str:
    """Return the parameter files and the duration of a run."""
    files = [as_line(name) for name in run.attachments if name.endswith(_SUFFIXES)]
    duration = f'{run.times[-1] - run.times[0]:.4g} s'
    return ', '.join([*files, duration])


def _assumed(run: Run) -> str:
    """Return the nominal parameters relative to the true ones."""
    ends = assumed_model(run)
    if ends is None:
        scale = run.parameters.get('controller', {}).get(MODEL_SCALE.name)
        return f'model_scale {scale:g}' if isinstance(scale, float) else ''
    low, high = (f'{100.0 * end:.3g} %' for end in ends)
    return f'{low if low == high else f"{low} to {high}"} of the true masses and inertias'


def _date(run: Run) -> str:
    """Return the date of the first state, or of the file if the stamps are simulated; UTC."""
    time = float(run.times[0])
    if time < _FIRST_DATE:
        with suppress(OSError):
            time = run.path.stat().st_mtime
    if time < _FIRST_DATE:
        return ''
    return datetime.fromtimestamp(time, UTC).strftime('%Y-%m-%d')


def _version(run: Run) -> str:
    """Return the version of this package that wrote the log."""
    record = next(iter(run.metadata.get('versions', ())), {})
    version, commit = record.get('masmc_ros', ''), record.get('git', '')
    text = f'{version} ({commit})' if version and commit else version
    return as_line(f'masmc_ros {text}') if text else ''


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


def trends(
    runs: Sequence[Run],
    names: Sequence[str],
    rows: Sequence[Metrics],
    sections: Sequence[Section],
) -> dict[str, object] | None:
    """
    Return the numbers of a plot of metrics over parameters; None without a numeric parameter.

    Parameters
    ----------
    runs, names, rows, sections
        Runs with their names, metrics and sections of the page.

    """
    several = differences(runs)
    numbers = {entry.name: [_number(value) for value in entry.values] for entry in several}
    numeric = {
        name: values
        for name, values in numbers.items()
        if len({value for value in values if value is not None}) > 1
    }
    if not numeric:
        return None
    columns = shown_columns(rows)
    return {
        'runs': list(names),
        'links': [section.id for section in sections],
        'parameters': [{'name': name, 'values': values} for name, values in numeric.items()],
        'groups': [{'name': entry.name, 'texts': entry.texts} for entry in several],
        'colours': COLOURS,
        'metrics': [
            {
                'name': f'{column.head} ({column.shown_unit})',
                'values': [_finite(column.value(row), column.factor) for row in rows],
            }
            for column in columns
        ],
    }


def _number(value: object) -> float | None:
    """Return a number, also of a list of equal ones; None for other values."""
    if isinstance(value, list | tuple) and value and all(entry == value[0] for entry in value):
        value = value[0]
    if isinstance(value, bool) or not isinstance(value, float | int):
        return None
    return _finite(value)


def _finite(value: float | None, factor: float = 1.0) -> float | None:
    """Return a value times a factor; None if it is not finite."""
    return None if value is None or not math.isfinite(value) else value * factor
