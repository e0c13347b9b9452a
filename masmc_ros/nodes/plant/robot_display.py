# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Topics of the plant for viewers: description, frames and path of the robot."""

from __future__ import annotations

from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import bound
from masmc_ros.log.traced_paths import ActualPath
from masmc_ros.loop.timing import Timing
from masmc_ros.messages.names import ACTUAL_PATH_TOPIC, DESCRIPTION_TOPIC
from masmc_ros.messages.string_message import string_message
from masmc_ros.messages.topics import TRANSFORMS, transforms_topic
from masmc_ros.messages.transforms import TransformsCdr
from masmc_ros.nodes.middleware.raw_types import raw_class
from masmc_ros.nodes.process.base import SuiteNode
from masmc_ros.params.declaration import MutableValues
from masmc_ros.robot.joint_names import check_frame_prefix
from masmc_ros.robot.robot import robot_description, robot_of
from nav_msgs.msg import Path
import numpy as np
from numpy.typing import NDArray
from rclpy.publisher import Publisher
from std_msgs.msg import String


class RobotDisplay:
    """Publishers of a robot's description, frames and path."""

    def __init__(self, values: MutableValues) -> None:
        """
        Initialise with the checked values of the plant, and compile the kernels.

        Raises InputError for an invalid prefix of frame names.
        """
        robot, prefix = robot_of(values), check_frame_prefix(values['frame_prefix'])
        self._timing = Timing.from_values(values)
        self._decimation: int = values['tf_decimation']
        self._description = string_message(robot_description(values, prefix))
        self._prefix = prefix
        self._message = TransformsCdr(prefix, robot.mechanism.frames)
        self._path = ActualPath(self._timing, robot, prefix)
        self._position = np.zeros((1, len(robot.mechanism.positions)))
        if self._path.takes(0):
            self._path.add(0, self._position[0])
        self._origins = robot.frame_origins
        transforms = robot.mechanism.formulas.frame_transforms
        self._frames = bound(transforms, self._origins, self._position)

    def connect(self, node: SuiteNode) -> None:
        """Create the topics and publish the description."""
        self._transforms: Publisher | None = None
        if self._decimation:
            try:
                message_type = raw_class(TRANSFORMS.type_name)
            except InputError as error:
                node.log.warning(f'no {TRANSFORMS.name}: {error}')
            else:
                topic = transforms_topic(node.node.get_namespace(), self._prefix)
                self._transforms = node.publisher(message_type, topic)
        self._paths = node.latched(Path, ACTUAL_PATH_TOPIC)
        description = node.latched(String, DESCRIPTION_TOPIC)
        description.publish(self._description)

    def show(self, tick: int, position: NDArray[np.float64]) -> None:
        """Publish frames and path if they are due; `position` is in the order of joint_states."""
        if self._transforms is not None and (
            tick % self._decimation == 0 or tick == self._timing.last
        ):
            self._position[:] = position
            transforms = self._frames(self._origins, self._position)[0]
            self._transforms.publish(self._message.fill(self._timing.stamp(tick), transforms))
        if self._path.takes(tick):
            path = self._path.add(tick, position)
            if path is not None:
                self._paths.publish(path)
