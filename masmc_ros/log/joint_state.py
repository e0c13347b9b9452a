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
        self._joints: tuple[str, ...] = ()
        self._order: list[int] = []

    def is_finite(self) -> bool:
        """Tell whether every position and velocity is a finite number."""
        position, velocity = self.position, self.velocity
        # A sum of squares is quick, and finite only where every number is; it overflows
        # before the numbers do.
        if isfinite(position.dot(position) + velocity.dot(velocity)):
            return True
        return all(map(isfinite, position.tolist() + velocity.tolist()))

    def check(self, joints: tuple[str, ...] = JOINTS) -> None:
        """Refuse positions and velocities of `joints` that are not finite, by InputError."""
        for field, values in (('position', self.position), ('velocity', self.velocity)):
            _check_finite(values[len(JOINTS) - len(joints) :], joints, field)

    def load_message(self, message: Any, joints: tuple[str, ...] = JOINTS) -> None:
        """Take over a joint state of any sender, joint by joint by name.

        Joints of other names are left out; efforts that are absent or NaN become zero.

        Args:
            message: sensor_msgs/JointState as any deserialiser gives it.
            joints: which joints to take, `JOINTS` or the driven ones, which are its last;
                what is held of the others stays.

        Raises:
            InputError: for missing or repeated joints, sizes that do not go with the names,
                numbers that are not finite; nothing is changed then.
        """
        names = list(message.name)
        if names != self._names or joints != self._joints:
            self._order = _order(names, joints)
            self._names, self._joints = names, joints
        position = self._pick(message.position, 'position')
        velocity = self._pick(message.velocity, 'velocity')
        effort = np.zeros(len(joints))
        if len(message.effort):
            given = _doubles(message.effort)
            effort = self._pick(np.where(np.isnan(given), 0.0, given), 'effort')
        stamp = message.header.stamp
        first = len(JOINTS) - len(joints)
        self.position[first:] = position
        self.velocity[first:] = velocity
        self.effort[first:] = effort
        self.set_stamp(stamp.sec * NANOSECONDS + stamp.nanosec)

    def _pick(self, values: ArrayLike, field: str) -> NDArray[np.float64]:
        array = _doubles(values)
        if len(array) != len(self._names):
            raise InputError(
                f'joint state: {field} has {len(array)} numbers for {len(self._names)} joints;'
                ' it takes one for each name'
            )
        picked = array[self._order]
        _check_finite(picked, self._joints, field)
        return picked


def _doubles(values: ArrayLike) -> NDArray[np.float64]:
    return np.asarray(values, dtype=np.float64)


def _check_finite(values: NDArray[np.float64], joints: tuple[str, ...], field: str) -> None:
    finite = np.isfinite(values)
    if not finite.all():
        joint = joints[int(np.argmin(finite))]
        raise InputError(f"joint state: {field} of '{joint}' is not a finite number")


def _order(names: list[str], joints: tuple[str, ...]) -> list[int]:
    """Return where each of our joints stands in `names`."""
    for joint in joints:
        count = names.count(joint)
        if count != 1:
            fault = 'is missing' if count == 0 else f'is given {count} times'
            raise InputError(
                f"joint state: joint '{joint}' {fault}; it takes each of {', '.join(joints)} once"
            )
    return [names.index(joint) for joint in joints]
