# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc tune`: gains of a scenario for a small error and small effort, over drawn robots."""

from __future__ import annotations

import argparse
import csv
import io
import math
from pathlib import Path

from masmc_ros.campaign.campaign import campaign_of
from masmc_ros.campaign.draws import draw
from masmc_ros.campaign.summary import label, metric_named
from masmc_ros.campaign.threads import processors
from masmc_ros.campaign.tune import (
    Candidate,
    Evaluation,
    FORM,
    Range,
    searched,
    tuned,
    Tuning,
    variables_of,
)
from masmc_ros.campaign.tuned_file import tuned_file
from masmc_ros.cli.arguments import (
    add_file,
    add_output,
    add_seed,
    add_settings,
    add_threads,
    count,
)
from masmc_ros.cli.campaign_options import add_draws
from masmc_ros.errors import InputError
from masmc_ros.report.aligned import aligned, WIDTH
from masmc_ros.report.draw.campaign import front_figure
from masmc_ros.report.draw.style import paper_style, png
from masmc_ros.report.files import check_folder, make_folder, write_file
from masmc_ros.report.measure.table import Column, number
from masmc_ros.share import scenario_file
import numpy as np
from tqdm import tqdm

_SHOWN = 10
"""Number of candidates of the front that are printed; front.csv has all."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Search gains that minimise two metrics, over drawn robots; write the Pareto front and a'
        ' parameter file.'
    )
    add_file(parser)
    parser.add_argument(
        '--tune', action='append', default=[], required=True, metavar='NAME=LOW:HIGH',
        help=f'parameter to search, {FORM}; NAME as in --set; repeatable',
    )  # fmt: skip
    add_settings(parser)
    add_draws(parser, is_required=False)
    parser.add_argument(
        '--runs', type=count, default=16, metavar='N',
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
        '--evaluations', type=count, default=256, metavar='N',
        help='number of candidates (%(default)s)',
    )  # fmt: skip
    add_seed(parser, 'the draws and of the search')
    add_threads(parser)
    add_output(parser, 'tune')


def _percentile(text: str) -> float:
    value = float(text)
    if not 0.0 <= value <= 100.0:
        raise ValueError
    return value


_percentile.__name__ = 'percentile'  # in the messages of argparse


def run(options: argparse.Namespace) -> int:
    """Search, write the front and the parameter file, and print the front."""
    file = scenario_file(options.file)
    draws = [draw(text) for text in options.draw]
    campaign = campaign_of(
        file, options.set, draws=draws, repeats=options.runs if draws else 1, seed=options.seed,
        sobol=options.sobol,
    )  # fmt: skip
    ranges = [searched(text) for text in options.tune]
    variables = variables_of(campaign, ranges)
    names = options.objective or ['', 'torque_variation']
    if len(names) != 2:
        raise InputError(f'--objective: {len(names)} given; expected two')
    first, second = objectives = [metric_named(campaign, name, '--objective') for name in names]
    folder = Path(options.output)
    check_folder(folder)
    evaluate = Evaluation(
        campaign, variables, objectives, options.percentile, options.threads or processors()
    )
    with tqdm(total=options.evaluations, unit='candidate', disable=None) as progress:
        result = tuned(
            evaluate, ranges, evaluations=options.evaluations, seed=options.seed,
            advance=progress.update,
        )  # fmt: skip
    with paper_style():
        everything, front, chosen, start = (
            _scaled(candidates, objectives)
            for candidates in (
                result.candidates, result.front, [result.chosen], [result.start]
            )
        )  # fmt: skip
        figure = png(front_figure(everything, front, chosen, start, label(first), label(second)))
    make_folder(folder)
    contents = {
        'tuned.yaml': tuned_file(file, options.set, variables, result.chosen.values).encode(),
        'front.csv': _table(result.front, ranges, objectives).encode(),
        'front.png': figure,
    }
    for name, content in contents.items():
        write_file(folder / name, content)
    print(_text(result, ranges, objectives))
    print(f'results: {folder}/ ({", ".join(contents)})')
    return 0


def _scaled(candidates: list[Candidate], objectives: list[Column]) -> np.ndarray:
    """Return the objectives (n, 2) in the units of texts."""
    values = np.array([candidate.objectives for candidate in candidates])
    return values * [column.factor for column in objectives]


def _text(result: Tuning, ranges: list[Range], objectives: list[Column]) -> str:
    """Return the front, the chosen candidate and the values of the scenario."""
    names = [entry.name for entry in ranges]

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


def _table(front: list[Candidate], ranges: list[Range], objectives: list[Column]) -> str:
    """Return the front as CSV in SI units."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator='\n')
    names = [entry.name for entry in ranges]
    writer.writerow([*(f'{c.name} ({c.unit})' for c in objectives), *names])
    for candidate in front:
        writer.writerow([*candidate.objectives, *(candidate.values[name] for name in names)])
    return out.getvalue()
