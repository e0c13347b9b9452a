# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
