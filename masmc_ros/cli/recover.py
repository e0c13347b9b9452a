# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc recover`: completion of logs that were truncated or damaged."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
import sys

from masmc_ros.errors import InputError
from masmc_ros.log.read.gaps import state_gaps
from masmc_ros.log.recover.recover import recover as recover_file
from masmc_ros.messages.layout import NANOSECONDS


def recover(logs: Sequence[str]) -> int:
    """Complete each log in its place and say what is in it; status 2 where one cannot be."""
    status = 0
    for log in logs:
        try:
            found = recover_file(Path(log))
        except InputError as error:
            print(f'masmc recover: {error}', file=sys.stderr)
            status = error.exit_status
            continue
        if found is None:
            print(f'{log}: is complete')
            continue
        length = (found.end - found.start) / NANOSECONDS
        print(
            f'{log}: completed with {found.messages} messages over {length:.3f} s;'
            f' {found.dropped} bytes of it could not be read'
        )
        for first, last in found.damaged:
            print(
                f'{log}: a damaged chunk was skipped, with its messages from'
                f' {first / NANOSECONDS:.3f} to {last / NANOSECONDS:.3f} s'
            )
        for topic, gaps in state_gaps(Path(log)).items():
            print(f'{log}: {topic}: {gaps.text()}, by its stamps')
    return status
