# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc report`: metrics and figures from logged runs."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
import sys

from masmc_ros.cli.arguments import add_json, add_logs, add_output
from masmc_ros.report.digest import LogRuns
from masmc_ros.report.draw.figures import FEW
from masmc_ros.report.draw.style import FORMATS
from masmc_ros.report.measure.metrics import Metrics
from masmc_ros.report.measure.table import json_table, text_table
from masmc_ros.report.report import check_report, write_report
from masmc_ros.result_text import json_text, WIDTH
from tqdm import tqdm


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        "Write metrics, an interactive page and the paper's Figures 3-8 of logged runs."
    )
    add_logs(parser)
    add_output(parser, 'report')
    parser.add_argument(
        '--format', choices=FORMATS, default='png', help='format of the figures (default: png)'
    )
    parser.add_argument(
        '--all-figures',
        action='store_true',
        help=f"figures of each run, also of more than {FEW} runs; otherwise these have the paper's"
        ' and those of all runs',
    )
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Read logs, write the report into a folder, and print its table and files."""
    report(
        options.logs,
        options.output,
        options.format,
        has_all_figures=options.all_figures,
        is_json=options.json,
    )
    return 0


def report(
    logs: Sequence[str],
    output: str,
    file_format: str = 'png',
    *,
    has_all_figures: bool = False,
    is_json: bool = False,
) -> Mapping[str, Metrics]:
    """
    Write and print the report of logs; return the metrics of the runs by label.

    Parameters
    ----------
    logs
        Paths of the logs.
    output
        Folder of the report.
    file_format
        Format of the figures.
    has_all_figures
        Whether every run has figures of its own, also of many runs.
    is_json
        Whether the table is printed as JSON.

    """
    check_report(logs, output)
    progress = tqdm(total=len(logs), unit='log', desc='reading', disable=None)
    with progress:
        files, metrics, unread = write_report(
            LogRuns(logs, progress.update), output, file_format, has_all_figures=has_all_figures
        )
    for line in unread:
        print(line, file=sys.stderr)
    if is_json:
        print(json_text({**json_table(metrics), 'logs': logs, 'files': files}))
        return metrics
    print(text_table(metrics, WIDTH))
    print(f'report: {output}/ ({len(files)} files, report.html in a browser)')
    return metrics
