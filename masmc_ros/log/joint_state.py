# SPDX-License-Identifier: Apache-2.0
"""The state of the robot: sensor_msgs/JointState."""

from __future__ import annotations

from functools import cache
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from masmc_ros.errors import InputError
from masmc_ros.log.layout import Layout, NANOSECONDS, StampedMessage
from masmc_ros.log.names import JOINTS


class JointStateLayout(NamedTuple):
    """The layout of a joint state of this robot, and where its arrays start in bytes."""

    layout: Layout
    position: int
    velocity: int
    effort: int


@cache
def joint_state_layout() -> JointStateLayout:
    """Return the layout of a joint state with an empty frame and the joints in order."""
    layout = Layout()
    layout.stamp()
    layout.string('')
    layout.uint32(len(JOINTS))
    for name in JOINTS:
        layout.string(name)
    return JointStateLayout(layout, *(layout.sequence(len(JOINTS)) for _ in range(3)))


class JointStateCdr(StampedMessage):
    """A joint state whose arrays are views into the message.

    Attributes:
        position: (7) x_O, y_O (m), yaw, right and left wheel, arm joints 1 and 2 (rad).
        velocity: (7) their rates in m/s and rad/s.
        effort: (7) zeros for the base joints, then the four torques in N m.
    """

    def __init__(self) -> None:
        """Make a state of zeros at time 0."""
        layout, position, velocity, effort = joint_state_layout()
        super().__init__(layout)
        self.position = self._view(position, len(JOINTS))
        self.velocity = self._view(velocity, len(JOINTS))
        self.effort = self._view(effort, len(JOINTS))
        self._names: list[str] = []
        self._order: list[int] = []

    def is_finite(self) -> bool:
        """Tell whether every position and velocity is a finite number."""
        return all(map(isfinite, self.position.tolist() + self.velocity.tolist()))

    def load_message(self, message: Any) -> None:
        """Take over a joint state of any sender, joint by joint by name.

        Joints of other names are left out; efforts that are absent or NaN become zero.

        Args:
            message: sensor_msgs/JointState as any deserialiser gives it.

        Raises:
            InputError: for missing or repeated joints, sizes that do not go with the names,
                numbers that are not finite; nothing is changed then.
        """
        names = list(message.name)
        if names != self._names:
            self._order = _order(names)
            self._names = names
        position = self._pick(message.position, 'position')
        velocity = self._pick(message.velocity, 'velocity')
        effort = np.zeros(len(JOINTS))
        if len(message.effort):
            given = _doubles(message.effort)
            effort = self._pick(np.where(np.isnan(given), 0.0, given), 'effort')
        stamp = message.header.stamp
        self.position[:] = position
        self.velocity[:] = velocity
        self.effort[:] = effort
        self.set_stamp(stamp.sec * NANOSECONDS + stamp.nanosec)

    def _pick(self, values: ArrayLike, field: str) -> NDArray[np.float64]:
        array = _doubles(values)
        if len(array) != len(self._names):
            raise InputError(
                f'joint state: {field} has {len(array)} numbers for {len(self._names)} joints;'
                ' it takes one for each name'
            )
        picked = array[self._order]
        if not np.isfinite(picked).all():
            joint = JOINTS[int(np.argmin(np.isfinite(picked)))]
            raise InputError(f"joint state: {field} of '{joint}' is not a finite number")
        return picked


def _doubles(values: ArrayLike) -> NDArray[np.float64]:
    return np.asarray(values, dtype=np.float64)


def _order(names: list[str]) -> list[int]:
    """Return where each joint of ours stands in `names`."""
    for joint in JOINTS:
        count = names.count(joint)
        if count != 1:
            fault = 'is missing' if count == 0 else f'is given {count} times'
            raise InputError(
                f"joint state: joint '{joint}' {fault}; it takes each of {', '.join(JOINTS)} once"
            )
    return [names.index(joint) for joint in JOINTS]
