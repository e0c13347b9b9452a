# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Known laws, and robots and logged runs from files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from masmc_ros.api.scenario import load
from masmc_ros.law import registry
from masmc_ros.law.law import Law
from masmc_ros.robot.robot import Robot

if TYPE_CHECKING:
    from masmc_ros.log.read.reader import Run


def laws() -> dict[str, str]:
    """Return the control laws with their summaries; the names are the values of `law`."""
    known = {name: registry.load(name) for name in registry.names()}
    return {n: law.summary if isinstance(law, Law) else 'plain Python' for n, law in known.items()}


def load_robot(source: str, **values: object) -> Robot:
    """
    Return a robot.

    Parameters
    ----------
    source
        URDF file, parameter file, or name of an installed parameter file. A URDF has the choices
        that `masmc robot` prints.
    values
        Parameters `robot.NAME` by NAME, such as `tip_frame='tool0'`.

    Raises
    ------
    InputError
        if there is no such file, a name is unknown, or the robot is invalid.

    """
    return load(source, {f'robot.{name}': value for name, value in values.items()}).robot


def read(log: str | Path) -> Run:
    """
    Return a logged run, of a recorder or of `masmc simulate --output`.

    Raises
    ------
    InputError
        if the file is missing, or not a log of a run.

    """
    from masmc_ros.log.read.reader import read_run

    return read_run(log)
