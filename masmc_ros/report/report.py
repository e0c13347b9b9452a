# SPDX-License-Identifier: Apache-2.0
"""A folder with everything there is to say about some runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from masmc_ros.errors import InputError
from masmc_ros.log.reader import Run
from masmc_ros.report.comparison_figure import Compared
from masmc_ros.report.figures import draw_figures
from masmc_ros.report.files import make_folder, whole_file
from masmc_ros.report.labels import labels
from masmc_ros.report.metrics import metrics
from masmc_ros.report.page import report_page
from masmc_ros.report.table import csv_table, markdown_table, text_table
from masmc_ros.report.tracking import tracking


def write_report(runs: Sequence[Run], directory: str | Path) -> list[Path]:
    """Write metrics and figures of runs, and of all of them together, into a folder.

    The folder is made if need be; files of an earlier report in it are replaced.

    Args:
        runs: at least one run.
        directory: the folder.

    Returns:
        The files: report.html, table.txt, table.md, metrics.csv, then the figures.

    Raises:
        InputError: for a run without what a report needs and for a folder that cannot be
            written. Nothing is written unless everything could be computed.
    """
    if not runs:
        raise InputError('no runs to report; expected at least one log')
    compared = [
        Compared(label, run, tracking(run)) for label, run in zip(labels(runs), runs, strict=True)
    ]
    reached = [metrics(each.run, tracked=each.tracked) for each in compared]
    rows = {each.label: row for each, row in zip(compared, reached, strict=True)}
    directory = Path(directory)
    make_folder(directory)
    files = {
        'report.html': report_page(compared, reached).encode(),
        'table.txt': text_table(rows).encode(),
        'table.md': markdown_table(rows).encode(),
        'metrics.csv': csv_table(rows).encode(),
        **dict(draw_figures(compared, reached)),
    }
    written = []
    for name, content in files.items():
        with whole_file(directory / name) as stream:
            stream.write(content)
        written.append(directory / name)
    return written
