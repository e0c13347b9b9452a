# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Distinct names of runs in a table or a legend."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
import os
from pathlib import Path

from masmc_ros.errors import InputError
from masmc_ros.law import registry
from masmc_ros.law.command_interface import COMMAND_INTERFACE
from masmc_ros.law.reaching.implicit import OBSERVER_GAIN
from masmc_ros.law.reaching.reaching import BOUNDARY_LAYER
from masmc_ros.law.registry import LAW, SWITCHING_TERM
from masmc_ros.log.read.reader import Run
from masmc_ros.params.declaration import Values

_WITH_BOUNDARY_LAYER = frozenset(('saturation', 'tanh', 'sigmoid'))

_LONGEST = 40

OBSERVER = ' + observer'
"""Suffix of laws with a disturbance estimate that their source lacks."""

RATES = 'rates'
"""Suffix of runs with commanded velocities in place of torques."""


def labels(runs: Sequence[Run]) -> list[str]:
    """
    Return one label per run, such as 'smc, tanh δ 0.2', all different.

    'changed' follows if parameters were changed while the robot ran. Runs with the same law, or
    without a known law, are distinguished by their files.
    """
    plain = law_labels(runs)
    files = _different(
        [_short(log_name(run)) for run in runs], [_short(str(run.path)) for run in runs]
    )
    count = Counter(plain)
    named = [
        file if not label else f'{label} ({file})' if count[label] > 1 else label
        for label, file in zip(plain, files, strict=True)
    ]
    return _numbered(named)


def law_labels(runs: Sequence[Run]) -> list[str]:
    """Return the label of the law of each run, empty without a known law."""
    return [_law_label(run) for run in runs]


def log_name(run: Run) -> str:
    """Return the name of a log without its suffix, also of the current folder."""
    return Path(os.path.abspath(run.path)).stem


def law_of(run: Run) -> str | None:
    """
    Return the law that a run started with, None if the log lacks it.

    For commanded velocities, which follow from no law, it is RATES.
    """
    controller = run.parameters.get('controller', {})
    law = controller.get(LAW.name)
    if not isinstance(law, str):
        return None
    return RATES if _commands_rates(controller) else law


def _law_label(run: Run) -> str:
    if law_of(run) is None:
        return ''
    label = law_label(run.parameters['controller'])
    return f'{label}, changed' if any(change.changed for change in run.changes) else label


def law_label(controller: Values) -> str:
    """Return a label such as 'smc, tanh δ 0.2' for a controller's parameter values."""
    if _commands_rates(controller):
        return RATES
    return ', '.join([LAW.of(controller), *_switching(controller)])


def _commands_rates(controller: Values) -> bool:
    return controller.get(COMMAND_INTERFACE.name) == 'velocity'


def _switching(controller: Values) -> list[str]:
    name = controller.get(SWITCHING_TERM.name)
    if not isinstance(name, str) or not _uses_switching(LAW.of(controller)):
        return []
    layer, gain = (controller.get(p.name) for p in (BOUNDARY_LAYER, OBSERVER_GAIN))
    if name in _WITH_BOUNDARY_LAYER and isinstance(layer, int | float):
        return [f'{name} δ {layer:g}']
    if name == 'implicit' and isinstance(gain, int | float) and gain > 0.0:
        return [f'{name}{OBSERVER}', f'β {gain:g}']
    return [name]


def _uses_switching(name: str) -> bool:
    """Return True for a law with a reaching term, and for one that is not installed."""
    try:
        return registry.uses_switching(name)
    except InputError:
        return True


def as_text(name: str) -> str:
    """Return a file name with '?' for bytes that are no text, which no page can contain."""
    return name.encode(errors='replace').decode()


def as_line(text: str) -> str:
    """Return a text of a log as one line that every page can contain."""
    return ' '.join(as_text(text).split())


def _short(name: str) -> str:
    """Return a name as text on one line, of a long one the end."""
    name = as_line(name)
    return name if len(name) <= _LONGEST else f'…{name[1 - _LONGEST :]}'


def _different(short: Sequence[str], long: Sequence[str]) -> list[str]:
    """Return the short names if unique, otherwise the long ones."""
    count = Counter(short)
    return [s if count[s] == 1 else full for s, full in zip(short, long, strict=True)]


def _numbered(names: Sequence[str]) -> list[str]:
    """Add numbers to equal names."""
    total, seen = Counter(names), Counter[str]()
    numbered = []
    for name in names:
        seen[name] += 1
        numbered.append(f'{name} #{seen[name]}' if total[name] > 1 else name)
    return numbered
