# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc report`: metrics and figures from logged runs."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
import sys

from masmc_ros.cli.arguments import add_logs, add_output
from masmc_ros.log.read.reader import read_run
from masmc_ros.report.aligned import WIDTH
from masmc_ros.report.measure.metrics import Metrics
from masmc_ros.report.measure.missing import unread
from masmc_ros.report.measure.table import text_table
from masmc_ros.report.report import check_report, write_report
from tqdm import tqdm


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        "Write metrics, an interactive page and the paper's Figures 3-8 of logged runs."
    )
    add_logs(parser)
    add_output(parser, 'report')


def run(options: argparse.Namespace) -> int:
    """Read logs, write the report into a folder, and print its table and files."""
    report(options.logs, options.output)
    return 0


def report(logs: Sequence[str], output: str) -> Mapping[str, Metrics]:
    """Write and print the report of logs; return the metrics of the runs by label."""
    check_report(logs, output)
    runs = [read_run(log) for log in tqdm(logs, unit='log', desc='reading', disable=None)]
    files, metrics = write_report(runs, output)
    for logged in runs:
        for line in unread(logged):
            print(f'{logged.path}: {line}', file=sys.stderr)
    print(text_table(metrics, WIDTH))
    print(f'report: {output}/ ({len(files)} files, report.html in a browser)')
    return metrics
