# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Facts at the top of the page: scenario, assumed model, date and version of the runs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from datetime import datetime, UTC

from masmc_ros.log.read.reader import Run
from masmc_ros.report.measure.adaptation import assumed_model
from masmc_ros.report.measure.labels import as_line

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
        scale = run.parameters.get('controller', {}).get('model_scale')
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
