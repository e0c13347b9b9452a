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
    controllers: list[ControllerNode] = []

    def create_controller(**options: Any) -> ControllerNode:
        controllers.append(ControllerNode(**options))
        return controllers[0]

    def create_plant(**options: Any) -> PlantNode:
        # In one process no topic can have two types. Separate processes wait for each other.
        node = PlantNode(**options)
        check_agreement(node.values, controllers[0].values)
        return node

    nodes: list[Factory] = [TrajectoryNode, create_controller, create_plant]
    if '--record' in arguments:
        from masmc_ros.nodes.recorder.node import RecorderNode

        arguments.remove('--record')
        nodes.append(RecorderNode)
    return run(nodes, arguments)


if __name__ == '__main__':
    sys.exit(main())
