# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Report page of a run while it is being recorded.

`python -m masmc_ros.nodes.play.run_report LOG PAGE` writes it in a separate process at a low
priority, so the node and the control of the robot do not wait for it.
"""

from __future__ import annotations

from contextlib import suppress
import os
from pathlib import Path
import shutil
import sys
from tempfile import TemporaryDirectory

from masmc_ros.errors import InputError, UserError
from masmc_ros.log.bag import part_names
from masmc_ros.log.read.reader import read_run
from masmc_ros.log.recover import is_complete, recover
from masmc_ros.report.report import write_page

_NICENESS = 10
"""
Niceness of the process: nodes of the usual priority interrupt it within a fraction of a tick.

At the lowest priority, 19, it would hardly run on a busy machine: 4 s of computing took 130 s
next to three busy processes on two cores, and more than 15 minutes next to six.
"""


def write_report_so_far(recording: Path, page: Path) -> None:
    """
    Write the report page of a log, or of a folder of its parts, that is being recorded.

    The report is that of a copy, which is completed like the log of a killed recorder.

    Raises
    ------
    InputError
        If there is no recording, or no run in it yet.

    """
    with TemporaryDirectory(dir=page.parent) as folder:
        copy = Path(folder) / recording.name
        try:
            if recording.is_dir():
                copy.mkdir()
                for name in part_names(recording):
                    # The recorder may delete the oldest part meanwhile.
                    with suppress(FileNotFoundError):
                        shutil.copyfile(recording / name, copy / name)
            else:
                shutil.copyfile(recording, copy)
        except OSError as error:
            raise InputError(f'{recording}: {error.strerror}; is the recorder running?') from error
        for part in list(copy.iterdir()) if copy.is_dir() else [copy]:
            if copy.is_dir() and not part.stat().st_size:
                # The recorder has just created it.
                part.unlink()
            elif not is_complete(part):
                recover(part)
        write_page(read_run(copy), page)


def main(arguments: list[str]) -> int:
    """Write the page of a recording: arguments LOG PAGE."""
    os.nice(_NICENESS)
    try:
        write_report_so_far(*map(Path, arguments))
    except UserError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
