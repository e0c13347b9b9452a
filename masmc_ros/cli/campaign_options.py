# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Arguments and results that the commands of campaigns share."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys

from masmc_ros.campaign.campaign import campaign_of
from masmc_ros.campaign.engine import carry_out
from masmc_ros.campaign.runs import CPU
from masmc_ros.campaign.summary import (
    grid_lines,
    label,
    metric_named,
    summary,
    text,
    values_by_point,
)
from masmc_ros.campaign.variable import Axis, draw
from masmc_ros.cli import arguments
from masmc_ros.cli.arguments import print_choices
from masmc_ros.files import scenario_file, write_file
from masmc_ros.native.device import device_option
from masmc_ros.report.draw.campaign_figures import draws_figure, map_figure, MapAxis
from masmc_ros.report.draw.style import figure_file, paper_style
from masmc_ros.result_text import json_text, WIDTH
from masmc_ros.scenario.scenario import source_of
from tqdm import tqdm

RUNS = 'runs'
"""Folder of the dataset within the output folder."""


def add_campaign(parser: argparse.ArgumentParser, folder: str) -> None:
    """Add the arguments that all campaigns have; `folder` is the default output."""
    arguments.add_file(parser)
    arguments.add_settings(parser)
    arguments.add_seed(parser, 'the draws')
    parser.add_argument(
        '--metric', default='', metavar='NAME', help='metric of figures and correlations, a '
        'column of the dataset (RMS error of the first point)',
    )  # fmt: skip
    arguments.add_output(parser, folder)
    arguments.add_workers(parser)
    arguments.add_device(parser)
    arguments.add_json(parser)


def add_draws(parser: argparse.ArgumentParser, *, is_required: bool) -> None:
    """Add `--draw` and `--sobol`."""
    parser.add_argument(
        '--draw', action='append', default=[], required=is_required, metavar='NAME=DIST:...',
        help='random values of a parameter: uniform:LOW:HIGH, loguniform:LOW:HIGH, '
        'normal:MEAN:STD, truncnormal:MEAN:STD:LOW:HIGH or integers:LOW:HIGH; NAME as in --set, '
        'with [INDEX] an entry of an array; repeatable',
    )  # fmt: skip
    parser.add_argument(
        '--sobol', action='store_true', help='draw points of a Sobol sequence'
    )


def run_campaign(options: argparse.Namespace, axes: Sequence[Axis] = ()) -> int:
    """Compute a campaign, write its dataset, summary and figures, and print the summary."""
    file = scenario_file(options.file)
    print_choices(source_of(file, options.set))
    campaign = campaign_of(
        file,
        options.set,
        axes=axes,
        draws=[draw(text) for text in options.draw],
        repeats=options.runs,
        seed=options.seed,
        sobol=options.sobol,
    )
    metric = metric_named(campaign, options.metric)
    folder = Path(options.output)
    if campaign.notice and options.device == CPU:
        print(campaign.notice, file=sys.stderr, flush=True)
    for line in grid_lines(campaign):
        print(line, file=sys.stderr, flush=True)
    progress = tqdm(total=campaign.total, unit='run', disable=None)
    with progress:
        dataset = carry_out(
            campaign, folder / RUNS, threads=options.threads, scheduler=options.scheduler,
            device=device_option(options.device), advance=progress.update,
        )  # fmt: skip
    columns = dataset.columns()
    values = columns[metric.name]
    contents = {'campaign.txt': text(campaign, columns, metric).encode()}
    with paper_style():
        if campaign.axes:
            map_axes = [MapAxis(*axis) for axis in campaign.axes]
            medians = values_by_point(campaign, values) * metric.factor
            contents['map.png'] = figure_file(map_figure(map_axes, medians, label(metric)))
        if campaign.draws:
            drawn = {draw.name: columns[draw.name] for draw in campaign.draws}
            figure = draws_figure(drawn, values * metric.factor, columns['lost'], label(metric))
            contents['draws.png'] = figure_file(figure)
    for name, content in contents.items():
        write_file(folder / name, content)
    if options.json:
        files = [folder / name for name in (RUNS, *contents)]
        print(json_text({**summary(campaign, columns, metric), 'files': files}))
        return 0
    print(text(campaign, columns, metric, WIDTH))
    print(f'dataset and report: {folder}/ ({", ".join([f"{RUNS}/", *contents])})')
    return 0
