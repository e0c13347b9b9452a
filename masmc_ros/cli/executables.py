# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Entry points of `ros2 run masmc_ros NODE`, which call `masmc run NODE`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
import sys

from masmc_ros.cli.commands.run import NODES
from masmc_ros.cli.main import main, prepare_streams
from masmc_ros.nodes.process.ending import final


def _run(name: str) -> int:
    prepare_streams()
    return final(main(['run', name, *sys.argv[1:]]))


def __getattr__(name: str) -> Callable[[], int]:
    """Return the entry point of a node."""
    if name not in NODES:
        raise AttributeError(name)
    return partial(_run, name)
