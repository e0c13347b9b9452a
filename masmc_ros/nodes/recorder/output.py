# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""File of a recording: its name, its data other than messages, log lines about its disk."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from datetime import datetime
from itertools import chain, count
from pathlib import Path

from masmc_ros.errors import InputError
from masmc_ros.log import recorder_parameters
from masmc_ros.log.read.gaps import MISSING
from masmc_ros.log.write.provenance import write_origin, write_parameters
from masmc_ros.log.write.recording import clear_recording, Options, Recording
from masmc_ros.log.write.writer import LogWriter
from masmc_ros.messages.cdr_layout import NANOSECONDS
from masmc_ros.messages.parameter_record import ParameterRecord
from masmc_ros.params.declaration import MutableValues, Values
from rclpy.impl.rcutils_logger import RcutilsLogger


class Attachments:
    """
    Files, parameters with their changes, the robot's description and gaps of topics.

    Attributes
    ----------
    parameters
        parameters at the start of each node that published them.
    description
        description of the robot; None before its arrival.

    """

    def __init__(self, files: Mapping[str, bytes], missing: Callable[[], dict[str, str]]) -> None:
        """
        Initialise the data.

        Parameters
        ----------
        files
            files by name.
        missing
            function that describes the gaps of each topic at the end.

        """
        self._files, self._missing = files, missing
        self.parameters: MutableValues = {}
        self._changes: list[ParameterRecord] = []
        self.description: str | None = None

    def add_parameters(self, node: str, record: ParameterRecord) -> None:
        """Note a record of a node: first its parameters, then their changes."""
        if node in self.parameters:
            # Its other values, over a hundred, are not needed and would fill the memory.
            self._changes.append(record._replace(parameters=record.changes))
        else:
            self.parameters[node] = record.parameters

    def write_opening(self, log: LogWriter) -> None:
        """Write the data known at the start."""
        write_origin(log, self._files)

    def write_closing(self, log: LogWriter) -> None:
        """Write the data known at the end; called from the writing thread."""
        write_parameters(log, dict(self.parameters), tuple(self._changes))
        missing = self._missing()
        if missing:
            log.metadata(MISSING, missing)
        if self.description is not None:
            log.attach('robot.urdf', 'application/xml', self.description.encode())


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
        compression=recorder_parameters.COMPRESSION.of(values),
        flush_period=recorder_parameters.FLUSH_PERIOD.of(values),
        max_size=round(recorder_parameters.MAX_SIZE.of(values) * MEGABYTE),
        max_duration=round(recorder_parameters.MAX_DURATION.of(values) * NANOSECONDS),
        max_parts=recorder_parameters.MAX_PARTS.of(values),
        queue_size=round(recorder_parameters.QUEUE_SIZE.of(values) * MEGABYTE),
    )
    output = Path(recorder_parameters.OUTPUT.of(values))
    if output.suffix != '.mcap':
        return _open_new(output, namespace, options, attachments)
    place = output.with_suffix('') if options.is_split else output
    if place.exists():
        if not recorder_parameters.OVERWRITE.of(values):
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


class DiskWatch:
    """Log lines when the disk fails, when it recovers, and when messages are lost."""

    def __init__(self, recording: Recording, queue_size: float, log: RcutilsLogger) -> None:
        """
        Initialise the watch.

        Parameters
        ----------
        recording
            the recording.
        queue_size
            maximum size in MB of the messages that wait for the disk.
        log
            logger of the node.

        """
        self._recording, self._queue_size, self._log = recording, queue_size, log
        self._logged_trouble: str | None = None
        self._logged_lost = 0

    def look(self) -> None:
        """Log a failure of the disk, its end, and lost messages, once per change."""
        recording, log = self._recording, self._log
        trouble = recording.trouble
        if trouble != self._logged_trouble:
            self._logged_trouble = trouble
            if trouble is not None:
                log.error(
                    f'{recording.path}: {trouble}; up to {self._queue_size:g} MB of'
                    ' messages are kept until there is space again'
                )
            else:
                log.info(f'{recording.path}: the disk takes messages again')
        lost = sum(recording.lost.values())
        if lost > self._logged_lost:
            self._logged_lost = lost
            log.error(
                f'{lost} messages lost so far: the disk does not keep up with them',
                throttle_duration_sec=1.0,
            )
