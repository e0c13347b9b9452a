# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc export`: logged runs as tables and arrays."""

from __future__ import annotations

from collections.abc import Sequence

from masmc_ros.log.read.reader import read_run
from masmc_ros.report.export import check_export, write_export
from tqdm import tqdm


def export(logs: Sequence[str], output: str, file_format: str, *, overwrite: bool) -> int:
    """Read logs, write a file for each into a folder, print what is there."""
    check_export(logs, output, file_format, overwrite=overwrite)
    runs = [read_run(log) for log in tqdm(logs, unit='log', desc='reading', disable=None)]
    for path in write_export(runs, output, file_format, overwrite=overwrite):
        print(f'{path}: {path.stat().st_size} bytes')
    return 0
