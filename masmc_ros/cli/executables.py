# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Entry points of `ros2 run masmc_ros NODE`, which call `masmc run NODE`."""

from __future__ import annotations

from functools import partial
import sys

from masmc_ros.cli.endings import final
from masmc_ros.cli.main import main
from masmc_ros.cli.run import NODES


def _executable(name: str) -> int:
    return final(main(['run', name, *sys.argv[1:]]))


plant, trajectory, controller, recorder, live, composed = (
    partial(_executable, name) for name in NODES
)
