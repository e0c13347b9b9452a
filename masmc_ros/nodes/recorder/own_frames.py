# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Selection of the recorded robot's transforms on /tf, a topic that robots share."""

from __future__ import annotations

from masmc_ros.messages.topics import TRANSFORMS, transforms_topic
from masmc_ros.messages.transforms import first_frames, first_names, is_of_robot
from rclpy.node import Node


class OwnFrames:
    """Frames of the robot, which have its prefix."""

    def __init__(self, node: Node, prefix: str) -> None:
        """Initialise the frames for a node in the robot's namespace and the prefix of names."""
        self._node, self._log = node, node.get_logger()
        self._prefix = prefix
        self._names = first_names(prefix)

    @property
    def topic(self) -> str:
        """Return the full name of their topic."""
        return transforms_topic(self._node.get_namespace(), self._prefix)

    def are_in(self, raw: bytes) -> bool:
        """Return True if a TFMessage is from this robot; log the first one that is not."""
        if raw.startswith(*self._names) or is_of_robot(raw, self._prefix):
            return True
        parent, child = first_frames(raw)
        self._log.info(
            f'{TRANSFORMS.name}: frames of others, such as {parent} to {child}, are not recorded',
            once=True,
        )
        return False

    def go_by(self, prefix: object) -> None:
        """Use the prefix of the plant."""
        if not isinstance(prefix, str) or prefix == self._prefix:
            return
        recorded = self.topic
        self._prefix, self._names = prefix, first_names(prefix)
        if recorded != self.topic:
            self._log.warning(
                f'the plant sends its frames on {self.topic} (frame_prefix {prefix!r}), and what '
                f'is recorded is {recorded}; give the recorder the same frame_prefix'
            )
