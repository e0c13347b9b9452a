# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Choices that installed packages bring: classes named by entry points of a group."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib.metadata import entry_points
import sys
from typing import Any

from masmc_ros.errors import InputError


def plugged_in(group: str) -> tuple[str, ...]:
    """Return the names that installed packages bring to a group, in alphabetical order."""
    return _names(entry_points, group, tuple(sys.path))


@cache
def _names(read: Callable[..., Any], group: str, path: tuple[str, ...]) -> tuple[str, ...]:
    # The metadata of every installed package on the path are read: some 20 ms.
    return tuple(sorted(point.name for point in read(group=group)))


def load_plug_in(group: str, parameter: str, name: str) -> Any:
    """
    Return what a name of a group stands for.

    Raises InputError, naming the parameter that has the name as its value, where it cannot
    be loaded.
    """
    for point in entry_points(group=group, name=name):
        try:
            return point.load()
        except Exception as error:
            raise InputError(
                f'{parameter} = {name}: {point.value} cannot be loaded: {error}'
            ) from error
    raise InputError(f'{parameter} = {name}: no installed package brings it to {group}')
