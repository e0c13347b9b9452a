# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""State of the robot as sensor_msgs/JointState."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, lru_cache

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.messages import deserialised
from masmc_ros.messages.cdr_layout import checked_stamp, Layout, NANOSECONDS
from masmc_ros.messages.message import StampedMessage
from masmc_ros.messages.topics import JOINTS
import numpy as np
from numpy.typing import ArrayLike

FIELDS = ('position', 'velocity', 'effort')
"""Fields of a joint state with a number for each joint."""

_REMEDY = 'set velocity_source to estimated for a robot that measures positions only'


@lru_cache(maxsize=64)
def joint_state_layout(names: tuple[str, ...] = JOINTS) -> Layout:
    """Return the layout of a joint state with an empty frame and these joints in order."""
    contents = {'name': names, **dict.fromkeys(FIELDS, len(names))}
    return Layout('sensor_msgs/msg/JointState', contents)


class JointStateCdr(StampedMessage):
    """
    A joint state whose arrays are views into the message.

    Attributes
    ----------
    names
        Names (n) of the joints.
    position
        Positions (n) of the base joints, then of the driven joints, in m and rad.
    velocity
        Velocities (n) in m/s and rad/s.
    effort
        Efforts (n): zeros for the base joints, then the torques in N·m.

    """

    def __init__(self, names: tuple[str, ...] = JOINTS) -> None:
        """Initialise a state of zeros at time 0, of joints (n) of these names."""
        layout = joint_state_layout(names)
        super().__init__(layout)
        self.names = names
        self.position, self.velocity, self.effort = (self._record[field] for field in FIELDS)
        # Bytes of the message and words at which positions, velocities and efforts start.
        self._starts = np.array([layout.places[field].start for field in FIELDS])
        self._words = (self._lead + self._starts) // 8
        self._names: list[str] = []
        self._joints: tuple[str, ...] = ()
        self._order: list[int] = []

    def read(self, raw: bytes) -> int:
        """
        Read a received message and return its stamp in ns.

        The result is UNREAD, with nothing changed, for another layout, for positions or velocities
        that are not finite and for an invalid stamp. `load_message` then raises the error.
        """
        stamp: int = self._read(raw, self._layout.forms, self._starts, self._bytes)
        return stamp

    @cached_property
    def _read(self) -> Callable[..., int]:
        from masmc_ros.jit.compiled import bound
        from masmc_ros.messages.kernels import read_state

        return bound(read_state, b'', self._layout.forms, self._starts, self._bytes)

    def writer(
        self,
        position: Array,
        velocity: Array,
        effort: Array,
    ) -> Callable[[int], bytes]:
        """
        Return a function of a stamp in ns that returns the message of these arrays' numbers.

        Parameters
        ----------
        position, velocity
            Arrays (n) that the caller updates.
        effort
            Array of the efforts of the last joints, at most n, that the caller updates.

        """
        from masmc_ros.jit.compiled import bound
        from masmc_ros.messages.kernels import write_state

        arguments = position, velocity, effort, self._words, self.words
        write = bound(write_state, 0, *arguments)

        def to_bytes(stamp_ns: int) -> bytes:
            write(stamp_ns, *arguments)
            return self.to_bytes()

        return to_bytes

    def load_message(
        self,
        message: deserialised.JointState,
        joints: tuple[str, ...] | None = None,
        *,
        unknown_velocity: float | None = None,
    ) -> None:
        """
        Read a deserialised joint state of any sender, by joint names.

        Other joints are ignored; efforts that are absent or NaN become zero.

        Parameters
        ----------
        message
            sensor_msgs/JointState of any deserialiser.
        joints
            Names of the joints to read: all, or the driven ones, which are the last of `names`.
            The values of the other joints stay.
        unknown_velocity
            Value for velocities that are absent or not finite; None rejects them.

        Raises
        ------
        InputError
            For missing or repeated joints, sizes that do not match the names, numbers that are
            not finite, and an invalid stamp; nothing is changed then.

        """
        joints = joints or self.names
        names = list(message.name)
        if names != self._names or joints != self._joints:
            self._order = _order(names, joints)
            self._names, self._joints = names, joints
        position = self._pick(message.position, 'position')
        _check_finite(position, joints, 'position')
        velocity = self._pick_velocity(message.velocity, unknown_velocity)
        effort = np.zeros(len(joints))
        if len(message.effort):
            efforts = _doubles(message.effort)
            effort = self._pick(np.where(np.isnan(efforts), 0.0, efforts), 'effort')
            _check_finite(effort, joints, 'effort')
        stamp = message.header.stamp
        stamp_ns = checked_stamp(stamp.sec * NANOSECONDS + stamp.nanosec)
        first = len(self.names) - len(joints)
        self.position[first:] = position
        self.velocity[first:] = velocity
        self.effort[first:] = effort
        self.set_stamp(stamp_ns)

    def _pick(self, values: ArrayLike, field: str) -> Array:
        array = _doubles(values)
        if len(array) != len(self._names):
            raise InputError(
                f'joint state: {field} has {len(array)} numbers for {len(self._names)} joints;'
                ' expected one for each name'
            )
        return array[self._order]

    def _pick_velocity(
        self, values: ArrayLike, unknown: float | None
    ) -> Array:
        if unknown is None:
            if not len(_doubles(values)):
                raise InputError(f'joint state: velocity is empty; {_REMEDY}')
            velocity = self._pick(values, 'velocity')
            _check_velocity(velocity, self._joints)
            return velocity
        if not len(_doubles(values)):
            return np.full(len(self._joints), unknown)
        velocity = self._pick(values, 'velocity')
        return np.where(np.isfinite(velocity), velocity, unknown)


def _doubles(values: ArrayLike) -> Array:
    return np.asarray(values, dtype=np.float64)


def _check_velocity(values: Array, joints: tuple[str, ...]) -> None:
    try:
        _check_finite(values, joints, 'velocity')
    except InputError as error:
        raise InputError(f'{error}; {_REMEDY}') from None


def _check_finite(values: Array, joints: tuple[str, ...], field: str) -> None:
    finite = np.isfinite(values)
    if not finite.all():
        joint = joints[int(np.argmin(finite))]
        raise InputError(f"joint state: {field} of '{joint}' is not a finite number")


def _order(names: list[str], joints: tuple[str, ...]) -> list[int]:
    """Return the index of each of the package's joints in `names`."""
    for joint in joints:
        count = names.count(joint)
        if count != 1:
            fault = 'is missing' if count == 0 else f'appears {count} times'
            raise InputError(
                f"joint state: joint '{joint}' {fault}; expected each of {', '.join(joints)} once"
            )
    return [names.index(joint) for joint in joints]
