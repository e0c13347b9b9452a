# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""All nodes of a run in one process: the same nodes, the same topics, faster."""

from __future__ import annotations

import sys
from typing import Any

from masmc_ros.law.command_interface import check_agreement
from masmc_ros.nodes.controller.node import ControllerNode
from masmc_ros.nodes.plant.node import PlantNode
from masmc_ros.nodes.process.runtime import Factory, run
from masmc_ros.nodes.trajectory.node import TrajectoryNode


def main(arguments: list[str] | None = None) -> int:
    """Run plant, trajectory and controller, and with `--record` the recorder."""
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    made: list[ControllerNode] = []

    def controller(**process: Any) -> ControllerNode:
        made.append(ControllerNode(**process))
        return made[0]

    def plant(**process: Any) -> PlantNode:
        # Apart they wait for each other; in one process no topic can have two types.
        node = PlantNode(**process)
        check_agreement(node.values, made[0].values)
        return node

    nodes: list[Factory] = [TrajectoryNode, controller, plant]
    if '--record' in arguments:
        from masmc_ros.nodes.recorder.node import RecorderNode

        arguments.remove('--record')
        nodes.append(RecorderNode)
    return run(nodes, arguments)


if __name__ == '__main__':
    sys.exit(main())
