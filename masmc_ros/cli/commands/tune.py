# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc tune`: gains of a scenario for a small error and small effort, over drawn robots."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import csv
import io
import math
from pathlib import Path

from masmc_ros.api.tuning import search
from masmc_ros.campaign.summary import label
from masmc_ros.campaign.tune import Candidate, FORM, Tuning
from masmc_ros.cli import arguments
from masmc_ros.cli.arguments import print_choices
from masmc_ros.cli.campaign_options import add_draws
from masmc_ros.files import check_folder, make_folder, scenario_file, write_file
from masmc_ros.report.draw.campaign_figures import front_figure
from masmc_ros.report.draw.style import figure_file, paper_style
from masmc_ros.report.measure.table import Column, number
from masmc_ros.result_text import aligned, json_text, WIDTH
from masmc_ros.scenario.scenario import source_of
import numpy as np

_SHOWN = 10
"""Number of candidates of the front that are printed; front.csv has all."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Search gains that minimise two metrics, over drawn robots; write the Pareto front and a'
        ' parameter file.'
    )
    arguments.add_file(parser)
    parser.add_argument(
        '--tune', action='append', default=[], required=True, metavar='NAME=LOW:HIGH',
        help=f'parameter to search, {FORM}; NAME as in --set; repeatable',
    )  # fmt: skip
    arguments.add_settings(parser)
    arguments.add_path(parser)
    add_draws(parser, is_required=False)
    parser.add_argument(
        '--runs', type=arguments.count, default=16, metavar='N',
        help='runs of each candidate, one without --draw (%(default)s)',
    )  # fmt: skip
    parser.add_argument(
        '--objective', action='append', default=[], metavar='NAME',
        help='metric to minimise, a column of the datasets of campaigns; twice (RMS error of the '
        'first point, torque_variation)',
    )  # fmt: skip
    parser.add_argument(
        '--percentile', type=_percentile, default=100.0, metavar='P',
        help='percentile of the metrics over the runs; 100: the worst run (%(default)g)',
    )  # fmt: skip
    parser.add_argument(
        '--evaluations', type=arguments.count, default=256, metavar='N',
        help='number of candidates (%(default)s)',
    )  # fmt: skip
    arguments.add_seed(parser, 'the draws and of the search')
    arguments.add_threads(parser)
    arguments.add_device(parser)
    arguments.add_output(parser, 'tune')
    arguments.add_json(parser)


def _percentile(text: str) -> float:
    value = float(text)
    if not 0.0 <= value <= 100.0:
        raise ValueError
    return value


_percentile.__name__ = 'percentile'  # in the messages of argparse


def run(options: argparse.Namespace) -> int:
    """Search, write the front and the parameter file, and print the front."""
    folder = Path(options.output)
    check_folder(folder)
    file = scenario_file(options.file)
    source = source_of(file, options.set)
    print_choices(source)
    tuned = search(
        source.scenario(),
        options.tune,
        options.draw,
        runs=options.runs,
        objectives=options.objective or ('', 'torque_variation'),
        percentile=options.percentile,
        evaluations=options.evaluations,
        seed=options.seed,
        sobol=options.sobol,
        threads=options.threads,
        device=options.device,
    )
    result, objectives = tuned.search, tuned.columns
    names = [variable.name for variable in tuned.variables]
    first, second = objectives
    with paper_style():
        everything, front, chosen, start = (
            _scaled(candidates, objectives)
            for candidates in (
                result.candidates, result.front, [result.chosen], [result.start]
            )
        )  # fmt: skip
        figure = figure_file(
            front_figure(everything, front, chosen, start, label(first), label(second))
        )
    contents = {
        'tuned.yaml': tuned.text.encode(),
        'front.csv': _table(result.front, names, objectives).encode(),
        'front.png': figure,
    }
    try:
        make_folder(folder)
        for name, content in contents.items():
            write_file(folder / name, content)
    finally:
        # The gains are not lost if they cannot be written, such as on a full disk.
        if options.json:
            files = [folder / name for name in contents]
            print(json_text({**_summary(result, objectives), 'files': files}))
        else:
            print(_text(result, names, objectives))
    if not options.json:
        print(f'results: {folder}/ ({", ".join(contents)})')
    return 0


def _scaled(candidates: list[Candidate], objectives: Sequence[Column]) -> np.ndarray:
    """Return the objectives (n, 2) in the units of texts."""
    values = np.array([candidate.objectives for candidate in candidates])
    return values * [column.factor for column in objectives]


def _text(result: Tuning, names: Sequence[str], objectives: Sequence[Column]) -> str:
    """Return the front, the chosen candidate and the values of the scenario."""

    def cells(name: str, candidate: Candidate) -> list[str]:
        reached = _scaled([candidate], objectives)[0].tolist()
        values = [number(candidate.values[n]) if n in candidate.values else '' for n in names]
        return [name, *(number(v) if math.isfinite(v) else 'lost' for v in reached), *values]

    step = max(1, -(-len(result.front) // _SHOWN))
    rows = [cells('front', candidate) for candidate in result.front[::step]]
    rows += [cells('chosen', result.chosen), cells('scenario', result.start)]
    head = ['', *map(label, objectives), *names]
    count = f'{len(result.candidates)} candidates, {len(result.front)} of them on the front:'
    return '\n'.join([count, '', *aligned([head, *rows], (0,), rule=1, width=WIDTH)]) + '\n'


def _summary(result: Tuning, objectives: Sequence[Column]) -> dict[str, object]:
    """Return the front, the chosen candidate and the scenario for JSON, in SI units."""

    def row(candidate: Candidate) -> dict[str, object]:
        reached = zip((c.name for c in objectives), candidate.objectives, strict=True)
        return {'objectives': dict(reached), 'values': candidate.values}

    return {
        'objectives': [{'name': c.name, 'unit': c.unit} for c in objectives],
        'candidates': len(result.candidates),
        'front': [row(candidate) for candidate in result.front],
        'chosen': row(result.chosen),
        'scenario': row(result.start),
    }


def _table(
    front: list[Candidate], names: Sequence[str], objectives: Sequence[Column]
) -> str:
    """Return the front as CSV in SI units."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator='\n')
    writer.writerow([*(f'{c.name} ({c.unit})' for c in objectives), *names])
    for candidate in front:
        writer.writerow([*candidate.objectives, *(candidate.values[name] for name in names)])
    return out.getvalue()
