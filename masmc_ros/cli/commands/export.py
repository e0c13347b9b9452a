# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc export`: logged runs as tables and arrays."""

from __future__ import annotations

import argparse

from masmc_ros.cli.arguments import add_json, add_logs, add_output, add_overwrite
from masmc_ros.log.read.reader import read_run
from masmc_ros.report.export import check_export, FORMATS, write_export
from masmc_ros.result_text import with_sizes
from tqdm import tqdm


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Write logged runs as tables with a row per state, or as arrays, without rounding.'
    )
    add_logs(parser)
    add_output(parser, 'export')
    text = 'csv, parquet (with pyarrow) or npz (NumPy) (%(default)s)'
    parser.add_argument('--format', default='csv', choices=tuple(FORMATS), help=text)
    add_overwrite(parser)
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Read logs, write one file each into a folder, and print names and sizes."""
    arguments = options.output, options.format
    check_export(options.logs, *arguments, overwrite=options.overwrite)
    runs = [read_run(log) for log in tqdm(options.logs, unit='log', desc='reading', disable=None)]
    paths = write_export(runs, *arguments, overwrite=options.overwrite)
    print(with_sizes(paths, as_json=options.json))
    return 0
