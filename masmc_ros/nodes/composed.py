# SPDX-License-Identifier: Apache-2.0
"""All nodes of a run in one process: the same nodes, the same topics, faster."""

from __future__ import annotations

import sys

from masmc_ros.nodes.controller import ControllerNode
from masmc_ros.nodes.plant import PlantNode
from masmc_ros.nodes.runtime import Factory, run
from masmc_ros.nodes.trajectory import TrajectoryNode


def main(arguments: list[str] | None = None) -> int:
    """Run plant, trajectory and controller, and with `--record` the recorder."""
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    nodes: list[Factory] = [TrajectoryNode, ControllerNode, PlantNode]
    if '--record' in arguments:
        from masmc_ros.nodes.recorder import RecorderNode

        arguments.remove('--record')
        nodes.append(RecorderNode)
    return run(nodes, arguments)


if __name__ == '__main__':
    sys.exit(main())
