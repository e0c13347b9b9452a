# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
How nodes are started: `masmc run`, where the `ros2` command is not installed.

Nothing of weight is imported before signals are taken care of.
"""

from __future__ import annotations

from collections.abc import Sequence
import importlib
from itertools import takewhile
import os
import sys
from types import FrameType

from masmc_ros.cli.endings import end_with_parent
from masmc_ros.cli.ros import require_rclpy
from masmc_ros.errors import suggestion, UserError
from masmc_ros.nodes.process.ending import on_end
from masmc_ros.optional import explained

NODES = ('plant', 'trajectory', 'controller', 'recorder', 'live', 'composed')


def run_node(name: str, arguments: Sequence[str]) -> int:
    """Run a node in this process until it ends; return its exit status."""
    if name not in NODES:
        print(f"masmc run: no node '{name}'; {suggestion(name, NODES)}", file=sys.stderr)
        return 2
    if not {'-h', '--help'}.isdisjoint(takewhile(lambda each: each != '--ros-args', arguments)):
        from masmc_ros.cli.node_help import node_help

        print(node_help(name), end='')
        return 0
    end_with_parent()
    # Imports take a second: a traceback of them is not what SIGINT asks for, and nothing is
    # to be completed yet. A node that has begun takes the signals itself.
    on_end(_end)
    try:
        require_rclpy()
        status: int = importlib.import_module(f'masmc_ros.nodes.{name}.node').main(list(arguments))
    except ModuleNotFoundError as missing:
        print(f'masmc run: {explained(missing)}', file=sys.stderr)
        return 2
    except UserError as error:
        print(f'masmc run: {error}', file=sys.stderr)
        return error.exit_status
    return status


def _end(number: int, frame: FrameType | None) -> None:
    os._exit(0)
