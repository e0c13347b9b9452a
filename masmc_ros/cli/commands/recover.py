# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc recover`: completion of logs that were truncated or damaged."""

from __future__ import annotations

import argparse
from pathlib import Path
import sys

from masmc_ros.cli.arguments import add_logs
from masmc_ros.errors import InputError
from masmc_ros.log.read.gaps import state_gaps
from masmc_ros.log.recover.recover import recover
from masmc_ros.messages.cdr_layout import NANOSECONDS


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Complete truncated or damaged logs in place. Undamaged parts are kept; a complete log'
        ' is not changed.'
    )
    add_logs(parser)


def run(options: argparse.Namespace) -> int:
    """Complete each log in place and print its content; status 2 if one cannot be completed."""
    status = 0
    for log in options.logs:
        try:
            recovered = recover(Path(log))
        except InputError as error:
            print(f'masmc recover: {error}', file=sys.stderr)
            status = error.exit_status
            continue
        if recovered is None:
            print(f'{log}: is complete')
            continue
        length = (recovered.end - recovered.start) / NANOSECONDS
        print(
            f'{log}: completed with {recovered.messages} messages over {length:.3f} s;'
            f' {recovered.dropped} bytes of it could not be read'
        )
        for first, last in recovered.damaged:
            print(
                f'{log}: a damaged chunk was skipped, with its messages from'
                f' {first / NANOSECONDS:.3f} to {last / NANOSECONDS:.3f} s'
            )
        for topic, gaps in state_gaps(Path(log)).items():
            print(f'{log}: {topic}: {gaps.text()}, by its stamps')
    return status
