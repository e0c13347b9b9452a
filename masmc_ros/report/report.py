# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""A folder with everything there is to say about some runs."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
import os
from pathlib import Path

from masmc_ros.errors import InputError
from masmc_ros.log.read.reader import Run
from masmc_ros.log.recover.overlap import check_apart
from masmc_ros.report.draw.figures import draw_figures
from masmc_ros.report.files import check_folder, make_folder, whole_file
from masmc_ros.report.manifest import (
    Entry,
    entry,
    MANIFEST,
    read_manifest,
    remove_stale,
    write_manifest,
)
from masmc_ros.report.measure.labels import labels
from masmc_ros.report.measure.metrics import metrics
from masmc_ros.report.measure.table import csv_table, markdown_table, text_table
from masmc_ros.report.measure.tracking import Compared, tracking
from masmc_ros.report.page.page import report_page

_TEXTS = ('report.html', 'table.txt', 'table.md', 'metrics.csv')


def write_report(runs: Sequence[Run], directory: str | Path) -> list[Path]:
    """
    Write metrics and figures of runs, and of all of them together, into a folder.

    The folder is made if need be. Files of an earlier report in it are replaced, and those
    removed that this one does not have.

    Parameters
    ----------
    runs
        at least one run.
    directory
        the folder.

    Returns
    -------
        The files: report.html, table.txt, table.md, metrics.csv, the figures, the manifest.

    Raises
    ------
    InputError
        for a run without what a report needs and for a folder that cannot be
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
    texts = (
        report_page(compared, reached),
        text_table(rows),
        markdown_table(rows),
        csv_table(rows),
    )
    files = {
        **{name: text.encode() for name, text in zip(_TEXTS, texts, strict=True)},
        **dict(draw_figures(compared, reached)),
    }
    earlier = read_manifest(directory)
    written: list[Entry] = []
    try:
        for name, content in files.items():
            with whole_file(directory / name) as stream:
                stream.write(content)
            written.append(entry(name, content))
    except BaseException:
        if written:
            with suppress(InputError):
                write_manifest(directory, {*earlier, *written})
        raise
    remove_stale(directory, earlier, files)
    return [*(directory / name for name in files), write_manifest(directory, written)]


def check_report(logs: Sequence[str], directory: str | Path) -> None:
    """Raise InputError where a report of logs cannot be written there, before they are read."""
    directory = Path(directory)
    check_apart([directory], logs)
    check_folder(directory)
    there = [directory / name for name in os.listdir(directory)] if directory.exists() else []
    figures = [path for path in there if path.suffix == '.png']
    check_apart([*(directory / name for name in (*_TEXTS, MANIFEST)), *figures], logs)
