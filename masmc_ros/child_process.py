# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Python processes that this process starts: their command, and how many are useful."""

from __future__ import annotations

import os
import sys


def module_command(module: str, *arguments: str) -> list[str]:
    """
    Return the command that runs a module as `python -m` does, without imports from the folder.

    `-m` alone imports from the working folder first. A file `yaml.py` or `random.py` of the user
    would replace the package of this name. Installed packages and PYTHONPATH are used.
    """
    return [sys.executable, '-P', '-m', module, *arguments]


def processors() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, 'sched_getaffinity'):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
