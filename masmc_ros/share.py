# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Files that are installed with the package."""

from __future__ import annotations

from difflib import get_close_matches
import os
from pathlib import Path
import sys

from masmc_ros.errors import InputError, suggestion

_OTHER = 'ros2_control'
"""Start of the names of parameter files for the nodes of other packages."""


def shared_file(*parts: str) -> Path:
    """
    Return a file such as `config/paper.yaml`; InputError if it is not installed.

    The folders are those of the sources, of a pip installation and of colcon.
    """
    for folder in _folders():
        path = folder.joinpath(*parts)
        if path.is_file():
            return path
    raise InputError(f'{"/".join(parts)}: not installed with masmc_ros; reinstall the package')


def scenarios() -> dict[str, Path]:
    """Return the parameter files that are installed with the package, by name."""
    files = (sorted(folder.glob('config/*.yaml')) for folder in _folders())
    first = next(filter(None, files), [])
    return {path.stem: path for path in first if not path.stem.startswith(_OTHER)}


def scenario_file(name: str) -> str:
    """Return the path of a parameter file: an existing one, or that of an installed name."""
    if name.startswith('~'):
        name = os.path.expanduser(name)
    if Path(name).exists() or Path(name).name != name:
        return name
    installed = scenarios()
    if name in installed:
        return str(installed[name])
    if Path(name).suffix or not installed:
        return name
    if get_close_matches(name, installed):
        raise InputError(f'{name}: no such file; {suggestion(name, installed)}')
    raise InputError(
        f'{name}: no such file; give the path of a parameter file or of a log, or the name of an '
        f'installed one: {", ".join(installed)}'
    )


def _folders() -> tuple[Path, ...]:
    package = Path(__file__).resolve().parent
    # colcon: PREFIX/lib/pythonX.Y/site-packages/masmc_ros, and PREFIX/share/masmc_ros.
    prefixes = [Path(sys.prefix), *package.parents[:5]]
    return (package.parent, *(p / 'share' / 'masmc_ros' for p in prefixes))
