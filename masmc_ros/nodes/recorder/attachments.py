# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Data of a run in its log other than messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from masmc_ros.log.read.gaps import MISSING
from masmc_ros.log.write.provenance import write_origin, write_parameters
from masmc_ros.log.write.writer import LogWriter
from masmc_ros.messages.parameter_record import ParameterRecord
from masmc_ros.params.declaration import MutableValues


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
