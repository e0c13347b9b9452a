# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Choices of installed packages: classes that entry points of a group name.

`add_plug_in` adds choices of this process, such as a controller from a file.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib.metadata import entry_points, EntryPoints
import sys
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.mistakes import place_and_text

_added: dict[str, dict[str, object]] = {}
"""Objects of this process by group and name."""


def add_plug_in(group: str, name: str, choice: object) -> None:
    """Add a choice to a group for this process, or replace it."""
    _added.setdefault(group, {})[name] = choice


def plugged_in(group: str) -> tuple[str, ...]:
    """Return the names of a group: of installed packages in alphabetical order, and added ones."""
    installed = _names(entry_points, group, tuple(sys.path))
    return (*installed, *(name for name in _added.get(group, ()) if name not in installed))


@cache
def _names(read: Callable[..., EntryPoints], group: str, path: tuple[str, ...]) -> tuple[str, ...]:
    # Cached, as reading the metadata of all installed packages takes some 20 ms.
    return tuple(sorted({point.name for point in read(group=group)}))


def load_plug_in(group: str, parameter: str, name: str) -> Any:
    """
    Return the object of a name in a group.

    Raises InputError with the parameter whose value is the name, if it cannot be loaded or if
    two packages bring it.
    """
    if name in _added.get(group, ()):
        return _added[group][name]
    points = {point.value: point for point in entry_points(group=group, name=name)}
    if len(points) > 1:
        raise InputError(
            f'{parameter} = {name}: several installed packages bring it: {", ".join(points)};'
            ' uninstall all of them but one'
        )
    for point in points.values():
        try:
            return point.load()
        except Exception as error:
            raise InputError(
                f'{parameter} = {name}: {point.value} cannot be loaded: {place_and_text(error)}'
            ) from error
    raise InputError(f'{parameter} = {name}: no installed package brings it to {group}')
