# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Commands of the controller: torques on one topic, or velocities on two."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from geometry_msgs.msg import Twist, TwistStamped
from masmc_ros.loop.controller import Controller
from masmc_ros.messages.commands import ARM_VELOCITY, CommandWriter, EFFORT
from masmc_ros.messages.names import ARM_VELOCITY_TOPIC, CMD_VEL_TOPIC, COMMAND_TOPIC
from masmc_ros.messages.platform_motion import TwistCdr, TwistStampedCdr
from masmc_ros.robot.joint_names import check_frame_prefix
import numpy as np
from rclpy.publisher import Publisher
from std_msgs.msg import Float64MultiArray

Advertise = Callable[[Any, str], Publisher]
"""Makes a publisher of a message type and a topic."""


class CommandOutput(Protocol):
    """
    The commands that answer states.

    Attributes
    ----------
    publishers
        of the topics that the robot is commanded on.

    """

    publishers: list[Publisher]

    def connect(self, advertise: Advertise) -> None:
        """Create the publishers."""

    def send(self, stamp: int) -> None:
        """Send what the controller has computed, as the answer to the state of a stamp in ns."""

    def send_none(self, stamp: int) -> None:
        """Send as the answer to a state that nothing is commanded: zeros."""

    def repeat(self) -> None:
        """Send once more what was sent last."""

    def figures(self) -> dict[str, str]:
        """Return figures of the command for /diagnostics."""


class TorqueOutput:
    """Torques (N m) on effort_commands."""

    def __init__(self, controller: Controller, joints: Sequence[str]) -> None:
        """Take the controller, whose torque is sent, and the joints' names."""
        self.publishers: list[Publisher] = []
        self._torque = controller.torque
        kind = EFFORT.named(joints)
        self._effort = CommandWriter(kind, self._torque)
        self._void = CommandWriter(kind, np.zeros(len(joints)), is_void=True)
        self._answered = b''

    def connect(self, advertise: Advertise) -> None:
        """Create the publisher."""
        self.publishers = [advertise(Float64MultiArray, COMMAND_TOPIC)]

    def send(self, stamp: int) -> None:
        """Send the torques as the answer to the state of a stamp in ns."""
        self._send(self._effort.to_bytes(stamp))

    def send_none(self, stamp: int) -> None:
        """Send no torque as the answer to a state: drives that can hold do so."""
        self._send(self._void.to_bytes(stamp))

    def repeat(self) -> None:
        """Send once more what was sent last."""
        self.publishers[0].publish(self._answered)

    def figures(self) -> dict[str, str]:
        """Return the largest torque."""
        return {'largest torque (N m)': f'{float(np.abs(self._torque).max()):.6g}'}

    def _send(self, raw: bytes) -> None:
        self._answered = raw
        self.repeat()


class RateOutput:
    """The base's velocities on cmd_vel, then the other joints' rates on a topic of their own."""

    def __init__(self, controller: Controller, values: Mapping[str, Any]) -> None:
        """Take the controller and its parameter values; InputError for a bad frame prefix."""
        self.publishers: list[Publisher] = []
        prefix = check_frame_prefix(values['frame_prefix'])
        base = controller.mechanism.frames[0][1]
        self._twist: TwistCdr | TwistStampedCdr = TwistCdr()
        self._type: Any = Twist
        if values['enable_stamped_cmd_vel']:
            self._twist, self._type = TwistStampedCdr(prefix, base), TwistStamped
        self._mechanism = controller.mechanism
        own = [joint.name for joint in self._mechanism.own_rates]
        self._own = np.zeros(len(own))
        self._own_writer = CommandWriter(ARM_VELOCITY.named(own), self._own)
        self._command = controller.velocity_command
        self._none = np.zeros(len(self._command))
        self._answered = b'', b''

    def connect(self, advertise: Advertise) -> None:
        """Create the publishers."""
        self.publishers = [
            advertise(self._type, CMD_VEL_TOPIC),
            advertise(Float64MultiArray, ARM_VELOCITY_TOPIC),
        ]

    def send(self, stamp: int) -> None:
        """Send the rates as the answer to the state of a stamp in ns."""
        self._send(self._command, stamp)

    def send_none(self, stamp: int) -> None:
        """Send zero rates as the answer to a state."""
        self._send(self._none, stamp)

    def repeat(self) -> None:
        """Send once more what was sent last; first the twist, which may name no state."""
        for publisher, raw in zip(self.publishers, self._answered, strict=True):
            publisher.publish(raw)

    def figures(self) -> dict[str, str]:
        """Return speed and rates."""
        twist, rates = self._mechanism.twist, self._command.tolist()
        others = rates[len(twist):]
        return {
            **{
                f'{each.name} ({each.unit})': f'{rate:.6g}'
                for each, rate in zip(twist, rates, strict=False)
            },
            f"{self._mechanism.groups[-1].name}'s rates (rad/s)": ', '.join(
                f'{rate:.6g}' for rate in others
            ),
        }

    def _send(self, command: Any, stamp: int) -> None:
        twist = self._twist
        if isinstance(twist, TwistStampedCdr):
            twist.set_stamp(stamp)
        places = self._mechanism.twist
        for velocity, number in zip(places, command, strict=False):
            part, axis = divmod(velocity.place, 3)
            (twist.linear, twist.angular)[part][axis] = number
        self._own[:] = command[len(places):]
        self._answered = twist.to_bytes(), self._own_writer.to_bytes(stamp)
        self.repeat()
