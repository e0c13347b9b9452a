# SPDX-License-Identifier: Apache-2.0
"""`masmc run`: a node where the `ros2` command is not installed."""

from __future__ import annotations

from collections.abc import Sequence
import importlib
import sys

from masmc_ros.cli.ros import require_rclpy
from masmc_ros.errors import suggestion, UserError

NODES = ('plant', 'trajectory', 'controller', 'recorder', 'live', 'composed')


def run_node(name: str, arguments: Sequence[str]) -> int:
    """Run a node in this process until it ends; return its exit status."""
    if name not in NODES:
        print(f"masmc run: no node '{name}'; {suggestion(name, NODES)}", file=sys.stderr)
        return 2
    try:
        require_rclpy()
    except UserError as error:
        print(f'masmc run: {error}', file=sys.stderr)
        return error.exit_status
    status: int = importlib.import_module(f'masmc_ros.nodes.{name}').main(list(arguments))
    return status
