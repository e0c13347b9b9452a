# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Runs of all laws for docs/reference/laws/comparison.md: `python tools/compare_laws.py [NAME ...]`.

A name is a part of PARTS; without names all parts are computed. The results replace those in
docs/reference/laws/comparison.csv, from which `python tools/tables.py` writes the tables.
"""

from __future__ import annotations

from collections.abc import Mapping
import csv
from itertools import islice
import os
from pathlib import Path
import sys
from typing import Any, NamedTuple

from masmc_ros import compare_laws
from masmc_ros.law import registry

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / 'docs' / 'reference' / 'laws' / 'comparison.csv'
COLUMNS = ('part', 'law', 'switching', 'trial', 'runs', 'lost', 'error', 'worst',
           'end_effector_rms', 'platform_rms', 'torque_rms', 'torque_variation')  # fmt: skip

_SAME = 'input_output_decoupling'
"""Law with the torque of `nonlinear_feedback`, which is not computed again."""

LAWS = tuple(
    name if not switching else f'{name}:{switching}'
    for name, law in registry.LAWS.items()
    for switching in (('tanh', 'implicit') if law.uses_switching else ('',))
    if name != _SAME
)
"""Laws of the comparison, those with a reaching term with a smooth and a sampled one."""


class Part(NamedTuple):
    """Runs of laws on a scenario."""

    scenario: str
    trials: str
    seeds: int
    settings: Mapping[str, object] = {}
    laws: tuple[str, ...] = LAWS


_ROBOTS = {
    'duration': 12.0,
    'plant.velocity_noise': 0.02,
    'plant.encoder_resolution': 0.0001,
    'controller.torque_limit': [8.0, 8.0, 20.0, 10.0],
    'controller.torque_rate_limit': [400.0, 400.0, 1000.0, 500.0],
}

PARTS = {
    'paper': Part('paper', 'laws', 100),
    'robust': Part('robust', 'laws', 100),
    'conditions': Part(
        'paper', 'true model,noise,delay', 100, {'controller.observer_gain': 0.5}
    ),
    'robots': Part('robust', 'as it is', 1000, _ROBOTS),
    'robots without estimate': Part(
        'robust',
        'as it is',
        1000,
        {**_ROBOTS, 'controller.observer_gain': 0.0},
        tuple(name for name in LAWS if name.endswith(':implicit')),
    ),
}
"""Parts of the comparison by name."""


def main() -> None:
    """Compute the parts, and write their results after every few laws."""
    for name in sys.argv[1:] or PARTS:
        part, laws = PARTS[name], iter(PARTS[name].laws)
        while group := tuple(islice(laws, os.cpu_count() or 1)):
            table = compare_laws(
                part.scenario,
                group,
                trials=part.trials,
                seeds=part.seeds,
                settings=part.settings,
            )
            _write([{'part': name, **row} for row in table.to_pylist()])
    print('run: python tools/tables.py')


def _write(rows: list[dict[str, Any]]) -> None:
    """Add rows to the results, and remove those of the same law and part."""
    kept = list(csv.DictReader(RESULTS.open(encoding='utf-8'))) if RESULTS.exists() else []
    new = {_key(row) for row in rows}
    kept = [row for row in kept if _key(row) not in new]
    for row in rows:
        row.update({n: '' if v is None else f'{v:.6g}' for n, v in row.items() if n in _NUMBERS})
    with RESULTS.open('w', encoding='utf-8', newline='') as file:
        writer = csv.DictWriter(file, COLUMNS, extrasaction='ignore', lineterminator='\n')
        writer.writeheader()
        writer.writerows(sorted([*kept, *rows], key=_place))


_NUMBERS = frozenset(COLUMNS[6:])


def _key(row: Mapping[str, Any]) -> tuple[str, ...]:
    return row['part'], row['law'], row['switching']


def _place(row: Mapping[str, Any]) -> tuple[int, int]:
    name = f'{row["law"]}:{row["switching"]}'.rstrip(':')
    return list(PARTS).index(row['part']), LAWS.index(name)


if __name__ == '__main__':
    main()
