# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Recording by the parameters of a recorder."""

from __future__ import annotations

from datetime import datetime
from itertools import chain, count
from pathlib import Path

from masmc_ros.errors import InputError
from masmc_ros.log.write.recording import clear_recording, Options, Recording
from masmc_ros.messages.cdr_layout import NANOSECONDS
from masmc_ros.nodes.recorder.attachments import Attachments
from masmc_ros.params.declaration import Values

MEGABYTE = 1_000_000
"""Bytes; sizes among the parameters are in MB."""


def open_recording(
    values: Values, attachments: Attachments, namespace: str = '/'
) -> Recording:
    """
    Start the recording that checked parameters describe.

    Parameters
    ----------
    values
        parameters of the recorder.
    attachments
        further data for the log.
    namespace
        namespace of the recorder, for the name of its file.

    Raises
    ------
    InputError
        if the file exists or cannot be written.

    """
    options = Options(
        compression=values['compression'],
        flush_period=values['flush_period'],
        max_size=round(values['max_size'] * MEGABYTE),
        max_duration=round(values['max_duration'] * NANOSECONDS),
        queue_size=round(values['queue_size'] * MEGABYTE),
    )
    output = Path(values['output'])
    if output.suffix != '.mcap':
        return _open_new(output, namespace, options, attachments)
    place = output.with_suffix('') if options.is_split else output
    if place.exists():
        if not values['overwrite']:
            raise InputError(
                f'output = {place}: exists already; name another, or set overwrite to true'
            )
        if options.is_split:
            clear_recording(place)
    return _open(output, options, attachments)


def _open(path: Path, options: Options, attachments: Attachments) -> Recording:
    return Recording(path, options, attachments.write_opening, attachments.write_closing)


def _open_new(
    folder: Path, namespace: str, options: Options, attachments: Attachments
) -> Recording:
    """Start a recording with a new name in a folder, from the namespace and the time."""
    robot = namespace.strip('/').replace('/', '_')
    stem = '_'.join(filter(None, ('masmc', robot, f'{datetime.now():%Y-%m-%d_%H-%M-%S}')))
    numbered = (f'{stem}_{number}' for number in count(2))
    paths = (folder / f'{name}.mcap' for name in chain([stem], numbered))
    path = next(path for path in paths if _is_created(path, options))
    return _open(path, options, attachments)


def _is_created(path: Path, options: Options) -> bool:
    """Create the file, or the folder of its parts; return False if it exists."""
    try:
        if options.is_split:
            path.with_suffix('').mkdir()
        else:
            path.touch(exist_ok=False)
    except FileExistsError:
        return False
    except OSError:
        # The recording reports what is wrong with the folder.
        pass
    return True
