# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc monte-carlo`: a scenario with random parameters."""

from __future__ import annotations

import argparse

from masmc_ros.cli.arguments import count
from masmc_ros.cli.campaign_options import add_campaign, add_draws, run_campaign


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Run a scenario with random parameters; write a dataset, percentiles and a figure.'
    )
    add_campaign(parser, 'monte-carlo')
    parser.add_argument(
        '--runs', type=count, default=1000, metavar='N', help='number of runs (%(default)s)'
    )
    add_draws(parser, is_required=True)


def run(options: argparse.Namespace) -> int:
    """Compute the runs and print their summary."""
    return run_campaign(options)
