# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc report`: metrics and figures from logged runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
import sys

from masmc_ros.log.read.reader import read_run, Run
from masmc_ros.report.measure.missing import unread
from masmc_ros.report.report import check_report, write_report
from tqdm import tqdm


def report(logs: Sequence[str], output: str) -> list[Run]:
    """Read logs, write the report into a folder, print its table and files; return the runs."""
    check_report(logs, output)
    runs = [read_run(log) for log in tqdm(logs, unit='log', desc='reading', disable=None)]
    files = write_report(runs, output)
    for run in runs:
        for line in unread(run):
            print(f'{run.path}: {line}', file=sys.stderr)
    table = next(file for file in files if file.name == 'table.txt')
    print(table.read_text(encoding='utf-8'))
    print(f'report: {Path(output)}/ ({", ".join(file.name for file in files)})')
    return runs
