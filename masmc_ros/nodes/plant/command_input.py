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

"""What the plant takes: torques on one topic, or rates on two: the base's and other joints'."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import time
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.law.command_interface import COMMAND_INTERFACE, ENABLE_STAMPED_CMD_VEL
from masmc_ros.messages.names import ARM_VELOCITY_TOPIC, CMD_VEL_TOPIC, COMMAND_TOPIC
from masmc_ros.nodes.middleware.past import subscribe_with_past
from masmc_ros.nodes.plant.command_parts import Part, rate_parts, torque_parts
from masmc_ros.nodes.process.refusals import Refusals
from masmc_ros.robot.names import driven_joint_names
from masmc_ros.robot.registry import chosen
import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node

Array = NDArray[np.float64]


class CommandInput:
    """
    Commands as they come, on all topics of a command interface.

    Attributes
    ----------
    interface
        `effort` or `velocity`.
    parts
        of the command, in the order of its numbers.

    """

    def __init__(self, values: Mapping[str, Any], refusals: Refusals) -> None:
        """Take torques or rates, as the plant's checked parameter values say."""
        self.interface: str = values[COMMAND_INTERFACE.name]
        self._is_stamped: bool = values[ENABLE_STAMPED_CMD_VEL.name]
        self._refusals = refusals
        joints = driven_joint_names(values)
        self.parts = (
            rate_parts(
                joints, chosen(values).twist, values['frame_prefix'], is_stamped=self._is_stamped
            )
            if self.interface == 'velocity'
            else torque_parts(joints)
        )

    def subscribe(
        self,
        node: Node,
        is_current: Callable[[Part, int | None], bool],
        arrived: Callable[[], None],
    ) -> None:
        """
        Subscribe to all topics.

        With the past: a controller may answer before it has found a subscription, and in
        lock-step nobody sends that command again. `is_current` tells of a part whether a
        command that answers the state of a stamp in ns is for the present, `arrived` is
        called once it is in force.
        """
        self._is_current, self._arrived = is_current, arrived
        for part in self.parts:

            def take(raw: bytes, part: Part = part) -> None:
                self._take(part, raw)

            subscribe_with_past(node, part.message_type, part.topic, take)

    def _take(self, part: Part, raw: bytes) -> None:
        try:
            taken = part.read(raw)
        except InputError as error:
            self._refusals.add(part.topic, error)
            return
        if self._is_current(part, taken.stamp):
            part.take(taken, time.monotonic())
            self._arrived()

    @property
    def is_complete(self) -> bool:
        """Whether a message of every topic is at hand."""
        # Once a tick: a loop takes a third of what `all` and a generator do.
        for part in self.parts:  # noqa: SIM110
            if not part.is_here:
                return False
        return True

    def take(self) -> Array | None:
        """Return the command at hand, as `held` does, and be done with it."""
        command = self.held()
        self.clear()
        return command

    def held(self) -> Array | None:
        """
        Return the command in force, None where nothing is commanded.

        Of rates, a part that is missing is zero.
        """
        if len(self.parts) == 1:
            return self.parts[0].numbers
        return np.concatenate([part.held() for part in self.parts])

    def answer(self, stamp: int) -> bool:
        """Return True if the active command answers the state of a stamp in ns, or names none."""
        return all(part.answered in (stamp, None) for part in self.parts)

    def clear(self) -> None:
        """Forget what is at hand."""
        for part in self.parts:
            part.clear()

    def touch(self) -> None:
        """Let the command in force be as good as new."""
        for part in self.parts:
            part.time = time.monotonic()

    def drop_old(self, now: float, timeout: float) -> list[str]:
        """Forget what has been in force for too long, in s; return the topics of that."""
        old = [p for p in self.parts if p.numbers is not None and now - p.time > timeout]
        for part in old:
            part.clear()
        return [part.topic for part in old]

    def age(self, now: float) -> float:
        """Return the time in s since the command that has been there for longest came."""
        return now - min(part.time for part in self.parts)

    def missing(self) -> str:
        """Return the topics of which no command is at hand."""
        return ' and '.join(part.topic for part in self.parts if not part.is_here)

    def are_sent_by(self, node: Node, name: str) -> bool:
        """Tell whether a node of this namespace sends on all topics, of the types taken."""
        return all(
            any(
                topic_type == part.type_name
                for topic_type in _sent_types(node, name, part.topic)
            )
            for part in self.parts
        )

    def disagreement(self, node: Node, name: str) -> str | None:
        """Return in words what another node of this namespace sends instead, if it does."""
        if self.are_sent_by(node, name):
            return None
        other = (
            [CMD_VEL_TOPIC, ARM_VELOCITY_TOPIC] if self.interface == 'effort' else [COMMAND_TOPIC]
        )
        sent = [topic for topic in other if _sent_types(node, name, topic)]
        if sent:
            return (
                f'it sends {" and ".join(sent)}, and with {COMMAND_INTERFACE.name} '
                f'{self.interface} the plant takes {" and ".join(p.topic for p in self.parts)}'
            )
        for part in self.parts:
            types = _sent_types(node, name, part.topic)
            if types and part.type_name not in types:
                return (
                    f'its {part.topic} is {types[0]}, and with {ENABLE_STAMPED_CMD_VEL.name} '
                    f'{"true" if self._is_stamped else "false"} the plant takes {part.type_name}'
                )
        return None


def _sent_types(node: Node, name: str, topic: str) -> list[str]:
    """Return the types with which a node of this namespace publishes a topic."""
    return [
        each.topic_type
        for each in node.get_publishers_info_by_topic(node.resolve_topic_name(topic))
        if each.node_name == name and each.node_namespace == node.get_namespace()
    ]
