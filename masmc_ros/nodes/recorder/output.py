# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Recording by the parameters of a recorder."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from masmc_ros.errors import InputError
from masmc_ros.log.write.recording import clear_recording, Options, Recording
from masmc_ros.messages.cdr_layout import NANOSECONDS
from masmc_ros.nodes.recorder.attachments import Attachments
from masmc_ros.params.declaration import Values

MEGABYTE = 1_000_000
"""Bytes; sizes among the parameters are in MB."""


def open_recording(values: Values, attachments: Attachments) -> Recording:
    """
    Start the recording that checked parameters describe.

    Raises InputError if its file exists or cannot be written.
    """
    path = log_path(Path(values['output']))
    options = Options(
        compression=values['compression'],
        flush_period=values['flush_period'],
        max_size=round(values['max_size'] * MEGABYTE),
        max_duration=round(values['max_duration'] * NANOSECONDS),
        queue_size=round(values['queue_size'] * MEGABYTE),
    )
    place = path.with_suffix('') if options.is_split else path
    if place.exists():
        if not values['overwrite']:
            raise InputError(
                f'output = {place}: exists already; name another, or set overwrite to true'
            )
        if options.is_split:
            clear_recording(place)
    return Recording(path, options, attachments.write_opening, attachments.write_closing)


def log_path(output: Path) -> Path:
    """Return the file of the recording: `output`, or a file named by the time in this folder."""
    if output.suffix == '.mcap':
        return output
    return output / datetime.now().strftime('masmc_%Y-%m-%d_%H-%M-%S.mcap')
