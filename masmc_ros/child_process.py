# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Command of a Python process that this process starts."""

from __future__ import annotations

import sys


def module_command(module: str, *arguments: str) -> list[str]:
    """
    Return the command that runs a module as `python -m` does, without imports from the folder.

    `-m` alone imports from the working folder first. A file `yaml.py` or `random.py` of the user
    would replace the package of this name. Installed packages and PYTHONPATH are used.
    """
    return [sys.executable, '-P', '-m', module, *arguments]
