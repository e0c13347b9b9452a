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

"""A topic that commands the robot: how its messages are read, and the latest one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
from typing import Any, NamedTuple

from geometry_msgs.msg import Twist, TwistStamped
from masmc_ros.errors import InputError
from masmc_ros.messages.commands import ArmVelocityCdr, EffortCdr, LabelledCdr
from masmc_ros.messages.hot_path import CommandReader, UNREAD
from masmc_ros.messages.layout import checked_stamp
from masmc_ros.messages.names import ARM_VELOCITY_TOPIC, CMD_VEL_TOPIC, COMMAND_TOPIC
from masmc_ros.messages.platform_motion import twist_numbers, TwistCdr, TwistStampedCdr
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.messages.topics import FLOAT_ARRAY, TWIST, TWIST_STAMPED
from masmc_ros.nodes.middleware.messages import deserialized
from masmc_ros.robot.declaration import Velocity
import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import Float64MultiArray

Array = NDArray[np.float64]

_COMPONENTS = tuple(f'{part}.{c}' for part in ('linear', 'angular') for c in 'xyz')


class Taken(NamedTuple):
    """A message that can be used."""

    numbers: Array | None
    """None where it says that nothing is commanded."""
    stamp: int | None
    """Of the state that it answers, in ns; None where it names none."""


class Part:
    """
    The latest command of one topic.

    Attributes
    ----------
    topic
        relative to the robot.
    type_name
        of its messages.
    names_state
        whether its messages say which state they answer.
    is_here
        whether a message is at hand, be it that nothing is commanded.
    numbers
        of the last command that is in force, None where there is none.
    time
        by the monotonic clock, when that came.
    answered
        stamp in ns of the state that it answers; None if it names none.

    """

    def __init__(
        self,
        topic: str,
        type_name: str,
        message_type: Any,
        width: int,
        read: Callable[[bytes], Taken],
        *,
        names_state: bool = True,
    ) -> None:
        """Read the commands of a topic, `width` numbers each; `read` raises InputError."""
        self.topic, self.type_name, self.message_type = topic, type_name, message_type
        self.names_state = names_state
        self.read = read
        self.is_here = False
        self.numbers: Array | None = None
        self.time = -math.inf
        self.answered: int | None = None
        self._zeros = np.zeros(width)

    def take(self, taken: Taken, now: float) -> None:
        """Let a message be in force from a time of the monotonic clock on."""
        self.is_here, self.time, self.answered = True, now, taken.stamp
        self.numbers = None if taken.numbers is None else taken.numbers.copy()

    def clear(self) -> None:
        """Forget what is at hand."""
        self.is_here, self.numbers = False, None

    def held(self) -> Array:
        """Return the command in force, zeros where there is none."""
        return self._zeros if self.numbers is None else self.numbers


def torque_parts(joints: tuple[str, ...]) -> list[Part]:
    """Return the one part of a command of torques on the driven joints, which is all of it."""
    read = _labelled(EffortCdr(joints))
    return [Part(COMMAND_TOPIC, FLOAT_ARRAY, Float64MultiArray, len(joints), read)]


def rate_parts(
    joints: tuple[str, ...], twist: Sequence[Velocity], frame_prefix: str, *, is_stamped: bool
) -> list[Part]:
    """
    Return the parts of commanded rates: the base's twist, then the rates of the last joints.

    With `is_stamped` twists are TwistStamped, fastest read with our prefix of their frame.
    """
    places = [each.place for each in twist]
    own = joints[len(places):]
    others = _labelled(ArmVelocityCdr(own))
    if is_stamped:
        read = _stamped_twist(frame_prefix, places)
        base = Part(CMD_VEL_TOPIC, TWIST_STAMPED, TwistStamped, len(places), read)
    else:
        read = _twist(places)
        base = Part(CMD_VEL_TOPIC, TWIST, Twist, len(places), read, names_state=False)
    return [base, Part(ARM_VELOCITY_TOPIC, FLOAT_ARRAY, Float64MultiArray, len(own), others)]


def _labelled(command: LabelledCdr) -> Callable[[bytes], Taken]:
    reader = CommandReader(command)

    def read(raw: bytes) -> Taken:
        stamp = reader.read(raw)
        if stamp != UNREAD:
            return Taken(command.data, stamp)
        if not command.load(raw):
            command.load_message(deserialized(raw, Float64MultiArray))
        elif not command.is_finite():
            count = len(command.data)
            raise InputError(f'{command.data.tolist()}, expected {count} finite numbers')
        return Taken(None if command.is_void else command.data, command.stamp_ns)

    return read


def _twist(places: Sequence[int]) -> Callable[[bytes], Taken]:
    ours = TwistCdr()

    def read(raw: bytes) -> Taken:
        twist = ours if ours.load(raw) else deserialized(raw, Twist)
        return Taken(_motion(twist, places), None)

    return read


def _stamped_twist(frame_prefix: str, places: Sequence[int]) -> Callable[[bytes], Taken]:
    ours = TwistStampedCdr(frame_prefix)

    def read(raw: bytes) -> Taken:
        if ours.load(raw):
            return Taken(_motion(ours, places), checked_stamp(ours.stamp_ns))
        message = deserialized(raw, TwistStamped)
        return Taken(_motion(message.twist, places), header_stamp(raw))

    return read


def _motion(twist: Any, places: Sequence[int]) -> Array:
    """Return the numbers of a twist that this base can follow."""
    numbers = twist_numbers(twist)
    for name, number in zip(_COMPONENTS, numbers, strict=True):
        if not math.isfinite(number):
            raise InputError(f'{name} = {number}, expected a finite number')
    return np.array([numbers[place] for place in places])
