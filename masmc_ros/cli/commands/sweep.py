# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc sweep`: a scenario at all points of a grid of parameters."""

from __future__ import annotations

import argparse

from masmc_ros.campaign.variable import axis, AXIS_FORM
from masmc_ros.cli.arguments import count
from masmc_ros.cli.campaign_options import add_campaign, add_draws, run_campaign


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Run a scenario at all points of a grid of parameters; write a dataset and a map.'
    )
    add_campaign(parser, 'sweep')
    parser.add_argument(
        '--vary', action='append', default=[], required=True, metavar='NAME=VALUES',
        help=f'axis of the grid, {AXIS_FORM}; NAME as in --set; repeatable',
    )  # fmt: skip
    parser.add_argument(
        '--runs', type=count, default=1, metavar='N',
        help='runs at each point, with different seeds and draws (%(default)s)',
    )  # fmt: skip
    add_draws(parser, is_required=False)


def run(options: argparse.Namespace) -> int:
    """Compute the runs and print their summary."""
    return run_campaign(options, [axis(text) for text in options.vary])
