# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Report of runs as a folder of files; a manifest lists them for the next report to remove."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
import hashlib
from operator import itemgetter
from pathlib import Path
from typing import NamedTuple

from masmc_ros.errors import InputError
from masmc_ros.files import check_folder, make_folder, write_file
from masmc_ros.log.bag import check_apart
from masmc_ros.log.read.reader import Run
from masmc_ros.report.digest import compared_runs, digests_of
from masmc_ros.report.draw.figures import draw_figures
from masmc_ros.report.draw.style import FORMATS
from masmc_ros.report.measure.labels import labels
from masmc_ros.report.measure.metrics import Metrics
from masmc_ros.report.measure.parameters import run_names
from masmc_ros.report.measure.table import csv_table, markdown_table, text_table
from masmc_ros.report.page.page import report_page
import numpy as np

MANIFEST = 'report.sha256'
"""Checksums in the form of `sha256sum`."""

Entry = tuple[str, str]
"""Checksum and name of a file."""


def entry(name: str, content: bytes) -> Entry:
    """Return the entry of a file in the manifest."""
    return hashlib.sha256(content).hexdigest(), name


def read_manifest(folder: Path) -> set[Entry]:
    """Return the entries of an earlier report; empty without one."""
    with suppress(OSError, UnicodeDecodeError):
        lines = (folder / MANIFEST).read_text(encoding='utf-8').splitlines()
        entries = (line.partition('  ') for line in lines)
        return {(digest, name) for digest, _, name in entries if Path(name).name == name}
    return set()


def write_manifest(folder: Path, entries: Iterable[Entry]) -> Path:
    """Write the manifest; return its path."""
    path = folder / MANIFEST
    lines = (f'{digest}  {name}\n' for digest, name in sorted(entries, key=itemgetter(1)))
    write_file(path, ''.join(lines).encode())
    return path


def remove_stale(folder: Path, earlier: Iterable[Entry], names: Iterable[str]) -> None:
    """
    Remove files of an earlier report whose names this report does not have.

    Files with a different content are kept.
    """
    kept = set(names)
    for digest, name in earlier:
        path = folder / name
        with suppress(OSError):
            if name not in kept and entry(name, path.read_bytes()) == (digest, name):
                path.unlink()


_PAGE = 'report.html'
_TABLES = {'table.txt': text_table, 'table.md': markdown_table, 'metrics.csv': csv_table}


class Report(NamedTuple):
    """Files of a report, the metrics of its runs by label, and sentences about their logs."""

    files: list[Path]
    metrics: Mapping[str, Metrics]
    unread: list[str]


@np.errstate(over='ignore', invalid='ignore')  # distances of a diverged run may be infinite
def write_report(
    runs: Sequence[Run],
    directory: str | Path,
    file_format: str = 'png',
    *,
    has_all_figures: bool = True,
) -> Report:
    """
    Write metrics and figures of runs, and of all of them together, into a folder.

    The folder is created if necessary. Files of an earlier report in it are replaced, or removed
    if this report does not have them.

    Parameters
    ----------
    runs
        at least one run; each is used once, and those with figures twice.
    directory
        the folder.
    file_format
        format of the figures, one of FORMATS.
    has_all_figures
        whether every run has figures of its own, also of many runs.

    Returns
    -------
        report.html, table.txt, table.md, metrics.csv, the figures, the manifest; the metrics.

    Raises
    ------
    InputError
        if a run lacks data that a report needs, or if the folder cannot be written. Nothing
        is written unless everything could be computed.

    """
    if not runs:
        raise InputError('no runs to report; expected at least one log')
    digests = digests_of(runs)
    light = [entry.run for entry in digests]
    names = run_names(light)
    # Files with numbers name runs by law and file, as their readers expect.
    rows = {
        label: entry.metrics for label, entry in zip(labels(light), digests, strict=True)
    }
    directory = Path(directory)
    make_folder(directory)
    tables = {name: table(rows).encode() for name, table in _TABLES.items()}
    figures = dict(draw_figures(runs, names, digests, file_format, has_all=has_all_figures))
    page = report_page(names, digests, compared_runs(digests))
    files = {_PAGE: page.encode(), **tables, **figures}
    earlier = read_manifest(directory)
    written: list[Entry] = []
    try:
        for name, content in files.items():
            write_file(directory / name, content)
            written.append(entry(name, content))
    except BaseException:
        if written:
            with suppress(InputError):
                write_manifest(directory, {*earlier, *written})
        raise
    remove_stale(directory, earlier, files)
    paths = [*(directory / name for name in files), write_manifest(directory, written)]
    lines = [f'{entry.run.path}: {line}' for entry in digests for line in entry.unread]
    return Report(paths, rows, lines)


@np.errstate(over='ignore', invalid='ignore')  # as above
def write_page(run: Run, path: Path) -> None:
    """Write the page of a run alone, without figures; InputError as for `write_report`."""
    digests = digests_of([run])
    write_file(path, report_page(run_names([run]), digests, [0]).encode())


def check_report(logs: Sequence[str], directory: str | Path) -> None:
    """Raise InputError if a report of logs cannot be written there, before they are read."""
    directory = Path(directory)
    check_apart([directory], logs)
    check_folder(directory)
    figures = (path for suffix in FORMATS for path in directory.glob(f'*.{suffix}'))
    check_apart([*(directory / name for name in (_PAGE, *_TABLES, MANIFEST)), *figures], logs)
