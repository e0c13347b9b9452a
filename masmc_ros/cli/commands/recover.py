# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc recover`: completion of logs that were truncated or damaged."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
import sys

from masmc_ros.cli.arguments import add_json, add_logs
from masmc_ros.errors import InputError
from masmc_ros.log.read.gaps import Gaps, state_gaps
from masmc_ros.log.recover import recover, Recovered
from masmc_ros.messages.cdr_layout import NANOSECONDS
from masmc_ros.result_text import json_text


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Complete truncated or damaged logs in place. Undamaged parts are kept; a complete log'
        ' is not changed.'
    )
    add_logs(parser)
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Complete each log in place and print its content; status 2 if one cannot be completed."""
    status, rows = 0, []
    for log in options.logs:
        try:
            recovered = recover(Path(log))
        except InputError as error:
            print(f'masmc recover: {error}', file=sys.stderr)
            status = error.exit_status
            continue
        gaps = {} if recovered is None else state_gaps(Path(log))
        rows.append(_row(log, recovered, gaps))
        if options.json:
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
        for topic, missed in gaps.items():
            print(f'{log}: {topic}: {missed.text()}, by its stamps')
    if options.json:
        print(json_text({'logs': rows}))
    return status


def _row(log: str, recovered: Recovered | None, gaps: Mapping[str, Gaps]) -> dict[str, object]:
    """Return the content of a log for JSON; of a complete one only that it was complete."""
    if recovered is None:
        return {'log': log, 'was_complete': True}
    return {
        'log': log,
        'was_complete': False,
        'messages': recovered.messages,
        'duration': (recovered.end - recovered.start) / NANOSECONDS,
        'dropped_bytes': recovered.dropped,
        'damaged': [[t / NANOSECONDS for t in times] for times in recovered.damaged],
        'gaps': [
            {
                'topic': topic,
                'count': missed.count,
                'missing': missed.missing,
                'longest': missed.longest / NANOSECONDS,
                'at': missed.at / NANOSECONDS,
            }
            for topic, missed in gaps.items()
        ],
    }
