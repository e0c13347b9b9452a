# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Files of URIs: `package://NAME/path`, `file:///path`, and plain paths.

The search for packages uses the conventions of ROS 2, ROS 1 and Python, and requires none of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from importlib.util import find_spec
import os
from pathlib import Path
import sys
from urllib.parse import unquote

from masmc_ros.errors import InputError

_INDEX = Path('share/ament_index/resource_index/packages')
"""Of a prefix: a file for each package, which then is in share/."""


_OF_PIP = {'example-robot-data': 'example-robot-data', 'stretch_urdf': 'hello-robot-stretch-urdf'}
"""Packages of robots that pip installs, by the name in URIs: those of the installed files."""


def resource_path(uri: str, folder: Path | None = None) -> Path:
    """
    Return the path of a URI, which need not exist.

    Parameters
    ----------
    uri
        `package://NAME/path`, `file:///path`, or a path, which may start with `~`.
    folder
        Folder of relative paths; None for the current one. For a mesh it is the folder of the
        description.

    Raises
    ------
    InputError
        If there is no such package, or the scheme is not supported.

    """
    scheme, separator, relative = uri.partition('://')
    if not separator:
        return (folder or Path()) / os.path.expanduser(uri)
    if scheme == 'file':
        return Path(unquote(relative))
    name, _, path = relative.partition('/')
    if scheme != 'package' or not name:
        raise InputError(f'{uri}: expected package://NAME/PATH, file:///PATH or a path')
    package_folder = next(_folders(name), None)
    if package_folder is None and name in _OF_PIP:
        raise InputError(f"{uri}: no package '{name}'; pip install {_OF_PIP[name]}")
    if package_folder is None:
        raise InputError(
            f"{uri}: no package '{name}' in the ament indices of AMENT_PREFIX_PATH"
            f" ({_value_of('AMENT_PREFIX_PATH')}) and {sys.prefix}, in ROS_PACKAGE_PATH"
            f" ({_value_of('ROS_PACKAGE_PATH')}), or among Python's; source the workspace that has"
            ' it, or give a path'
        )
    return package_folder / path


def _folders(name: str) -> Iterator[Path]:
    """Yield the folders of a package of a name."""
    # Python wheels may have a separate prefix next to Python's packages.
    own = [Path(sys.prefix), *(Path(place, 'cmeel.prefix') for place in sys.path if place)]
    for prefix in [*_listed('AMENT_PREFIX_PATH'), *own]:
        if (prefix / _INDEX / name).is_file():
            yield prefix / 'share' / name
    for folder in _listed('ROS_PACKAGE_PATH'):
        for place in (folder / name, folder):
            if place.name == name and place.is_dir():
                yield place
    # What has no specification, such as __main__, is a ValueError.
    with suppress(ValueError):
        spec = find_spec(name) if name.isidentifier() else None
        if spec is not None:
            yield from map(Path, spec.submodule_search_locations or ())


def _listed(variable: str) -> list[Path]:
    return [Path(path) for path in os.environ.get(variable, '').split(os.pathsep) if path]


def _value_of(variable: str) -> str:
    return os.environ.get(variable) or 'not set'
