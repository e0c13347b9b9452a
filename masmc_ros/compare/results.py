# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Results of a comparison as a JSON file, which other comparisons add to their tables.

Results are comparable if plant, path, trials, seeds and version are equal. The file has them, and
their SHA-256. Gains of controllers are not among them: each entry has its own. An entry of both
comparisons must have equal results, which checks the machine and the code.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
import hashlib
import json
import math
from pathlib import Path
from typing import Any

from masmc_ros import __version__
from masmc_ros.compare.contenders import Contender
from masmc_ros.compare.law_comparison import COMPARED, Comparison, Ranked, Row
from masmc_ros.errors import InputError
from masmc_ros.result_text import json_text
from masmc_ros.robot.declaration import units_of, URDF

OPTION = '--add'
"""Option that names a file of results."""

FILE = 'results.json'
"""Name of the file in the output folder."""

_TOLERANCE = 1e-6
"""Relative difference of results of the same entry, for which they are equal."""

_PARTS = ('scenario', 'trials')
"""Parts of the conditions with a digest."""


def as_json(comparison: Comparison, ranked: Sequence[Ranked]) -> str:
    """Return the conditions of a comparison and the results of all entries as text."""
    conditions = _conditions(comparison)
    entries = [
        {
            **entry.contender._asdict(),
            'summary': entry.summary,
            'rows': {name: asdict(row) for name, row in entry.rows.items()},
        }
        for entry in ranked
    ]
    return json_text({**conditions, 'sha256': _digests(conditions), 'entries': entries})


def loaded(file: str, comparison: Comparison) -> list[Ranked]:
    """
    Return the contenders of a file of results.

    Parameters
    ----------
    file
        Path of a file of `as_json`.
    comparison
        Comparison to which they are added.

    Raises
    ------
    InputError
        If the file cannot be read or was changed, or if its conditions differ. The line has the
        difference.

    """
    place = f'{OPTION} {file}'
    try:
        content = json.loads(Path(file).read_text(encoding='utf-8'))
    except OSError as error:
        raise InputError(f'{place}: cannot be read ({error.strerror})') from None
    except ValueError as error:
        raise InputError(f'{place}: no JSON ({error}); expected a {FILE} of compare') from None
    conditions = json.loads(json_text(_conditions(comparison)))
    try:
        there = {name: content[name] for name in conditions}
        digests = dict(content['sha256'])
        entries = [_entry(entry, comparison) for entry in content['entries']]
        difference = _difference(there, conditions)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        text = f'{type(error).__name__}: {error}'
        raise InputError(f'{place}: {text}; expected a {FILE} of compare') from None
    for name, digest in _digests(there).items():
        if digests.get(name) != digest:
            raise InputError(f'{place}: its {name} was changed: SHA-256 {digest[:12]} instead of '
                             f'{str(digests.get(name))[:12]}; expected an unmodified file')
    if difference:
        raise InputError(f'{place}: {difference}; expected results of the same conditions')
    return entries


def joined(file: str, entries: Sequence[Ranked], ranked: Sequence[Ranked]) -> list[Ranked]:
    """
    Return contenders with those of a file that are not among them.

    Raises InputError with the difference if an entry of both has other results.
    """
    known = {entry.contender.label: entry for entry in ranked}
    for entry in entries:
        _check_equal(f'{OPTION} {file}', entry, known.get(entry.contender.label, entry))
    return [*ranked, *(entry for entry in entries if entry.contender.label not in known)]


def _conditions(comparison: Comparison) -> dict[str, Any]:
    """Return the conditions, with the digest of a URDF in place of its text."""
    scenario = {name: dict(comparison.scenario[name]) for name in ('plant', 'trajectory')}
    for values in scenario.values():
        if values.get(URDF):
            values[URDF] = hashlib.sha256(str(values[URDF]).encode()).hexdigest()
    return {
        'masmc_ros': __version__,
        'scenario': scenario,
        'trials': [asdict(trial) for trial in comparison.trials],
        'seeds': comparison.seeds,
    }


def _digests(conditions: Mapping[str, Any]) -> dict[str, str]:
    return {
        name: hashlib.sha256(
            json.dumps(json.loads(json_text(conditions[name])), sort_keys=True).encode()
        ).hexdigest()
        for name in _PARTS
    }


def _difference(there: Any, here: Any, name: str = '') -> str:
    """Return the first difference of two values with its place; empty if they are equal."""
    if isinstance(there, dict) and isinstance(here, dict):
        for key in (*here, *(key for key in there if key not in here)):
            if key not in there or key not in here:
                return f'{name}{key} is only {"here" if key in here else "there"}'
            text = _difference(there[key], here[key], f'{name}{key}.')
            if text:
                return text
        return ''
    if name == 'trials.' and isinstance(there, list):
        by_name = [{trial['name']: trial for trial in trials} for trials in (there, here)]
        return _difference(by_name[0], by_name[1], name)
    return '' if there == here else f'{name[:-1]} is {there} there and {here} here'


def _entry(entry: Any, comparison: Comparison) -> Ranked:
    """Return an entry of a file; KeyError, TypeError or ValueError for another form."""
    points = comparison.mechanism.points
    units, keys = units_of(points), [point.key for point in points]
    known = entry['rows']
    rows = {
        trial.name: Row(
            together={unit: float(row['together'][unit]) for unit in units},
            errors={key: float(row['errors'][key]) for key in keys},
            worst=float(row['worst']),
            largest=float(row['largest']),
            efforts={metric: float(row['efforts'][metric]) for metric in COMPARED},
            runs=int(row['runs']),
            lost=int(row['lost']),
        )
        for trial in comparison.trials
        if (row := known.get(trial.name)) is not None
    }
    if not rows:
        raise ValueError('an entry without a trial of this comparison')
    contender = Contender(str(entry['law']), str(entry['switching']), bool(entry['observes']))
    return Ranked(contender, rows, str(entry['summary']))


def _check_equal(place: str, entry: Ranked, known: Ranked) -> None:
    """Raise InputError if the results of an entry differ from those of this comparison."""
    for trial, row in known.rows.items():
        other = entry.rows.get(trial)
        if other is None or not _are_equal(other.error, row.error):
            there = 'missing' if other is None else f'{other.error:g}'
            raise InputError(
                f'{place}: {entry.contender.label} in {trial}: error {there} there, '
                f'{row.error:g} m here; expected equal gains and results'
            )


def _are_equal(one: float, other: float) -> bool:
    return one == other or math.isclose(one, other, rel_tol=_TOLERANCE)
