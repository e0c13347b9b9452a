# SPDX-License-Identifier: Apache-2.0
"""Files that come with the package, wherever it is installed."""

from __future__ import annotations

from pathlib import Path
import sys

from masmc_ros.errors import InputError


def shared_file(*parts: str) -> Path:
    """Return a file such as `config/paper.yaml`; InputError where it is not installed.

    Looks beside the sources, in the prefix of a pip installation and in that of colcon.
    """
    package = Path(__file__).resolve().parent
    # colcon: PREFIX/lib/pythonX.Y/site-packages/masmc_ros, and PREFIX/share/masmc_ros.
    prefixes = [Path(sys.prefix), *package.parents[:5]]
    for folder in (package.parent, *(p / 'share' / 'masmc_ros' for p in prefixes)):
        path = folder.joinpath(*parts)
        if path.is_file():
            return path
    raise InputError(f'{"/".join(parts)}: not installed with masmc_ros; reinstall the package')
