# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Topics of the controller: commands, and the signals of a tick."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from geometry_msgs.msg import Twist, TwistStamped
from masmc_ros.aliases import Array
from masmc_ros.law.command_interface import ENABLE_STAMPED_CMD_VEL
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.signals import PUBLISHED
from masmc_ros.messages import topics
from masmc_ros.messages.commands import ARM_VELOCITY, CommandWriter, EFFORT
from masmc_ros.messages.platform_messages import TwistCdr, TwistStampedCdr
from masmc_ros.messages.telemetry import TelemetryCdr
from masmc_ros.params.declaration import Values
from masmc_ros.robot.mechanisms import check_frame_prefix, FRAME_PREFIX
import numpy as np
from rclpy.publisher import Publisher
from std_msgs.msg import Float64MultiArray

Advertise = Callable[[type, str], Publisher]
"""Function that creates a publisher for a message type and a topic."""


class CommandOutput(Protocol):
    """
    Commands that respond to states.

    Attributes
    ----------
    publishers
        Publishers of the command topics.

    """

    publishers: list[Publisher]

    def connect(self, advertise: Advertise) -> None:
        """Create the publishers."""

    def send(self, stamp: int) -> None:
        """Send the controller's result as the response to the state of a stamp in ns."""

    def send_void(self, stamp: int) -> None:
        """Send a void command as the response to the state of a stamp in ns."""

    def repeat(self) -> None:
        """Send the last command again."""

    def figures(self) -> dict[str, str]:
        """Return figures of the command for /diagnostics."""


def _largest(torque: Array) -> dict[str, str]:
    return {'largest torque (N·m)': f'{float(np.abs(torque).max()):.6g}'}


class TorqueOutput:
    """Torques (N·m) on effort_commands, and those of wheels that share them on wheel_commands."""

    def __init__(self, controller: Controller, joints: Sequence[str]) -> None:
        """Initialise with the controller, whose torque is sent, and the names of the joints."""
        self.publishers: list[Publisher] = []
        self._torque = controller.torque
        kind = EFFORT.named(joints)
        self._effort = CommandWriter(kind, self._torque)
        self._void = CommandWriter(kind, np.zeros(len(joints)), is_void=True)
        self._sent = b''
        self._shared: _SharedOutput | None = None
        if controller.mechanism.sharing_drives:
            self._shared = _SharedOutput(controller)

    def connect(self, advertise: Advertise) -> None:
        """Create the publisher."""
        self.publishers = [advertise(Float64MultiArray, topics.COMMAND_TOPIC)]
        if self._shared is not None:
            self._shared.connect(advertise)

    def send(self, stamp: int) -> None:
        """Send the torques as the response to the state of a stamp in ns."""
        self._send(self._effort.to_bytes(stamp))
        if self._shared is not None:
            self._shared.send(stamp)

    def send_void(self, stamp: int) -> None:
        """Send a void command as the response to a state; drives then hold zero velocity."""
        self._send(self._void.to_bytes(stamp))
        if self._shared is not None:
            self._shared.send_void(stamp)

    def repeat(self) -> None:
        """Send the last command again."""
        self.publishers[0].publish(self._sent)
        if self._shared is not None:
            self._shared.repeat()

    def figures(self) -> dict[str, str]:
        """Return the largest torque."""
        return _largest(self._torque)

    def _send(self, raw: bytes) -> None:
        self._sent = raw
        self.publishers[0].publish(raw)


class _SharedOutput:
    """Torques (N·m) of all wheels, which share the torques or forces of the base."""

    def __init__(self, controller: Controller) -> None:
        """Initialise with the controller, whose torque is distributed."""
        mechanism = controller.mechanism
        self._torque, self._distributed = controller.torque, mechanism.shared_torques
        self._numbers = np.zeros(len(mechanism.sharing_drives))
        kind = EFFORT.named(mechanism.sharing_drives)
        self._writer = CommandWriter(kind, self._numbers)
        self._void = CommandWriter(kind, np.zeros(len(self._numbers)), is_void=True)
        self._sent = b''

    def connect(self, advertise: Advertise) -> None:
        """Create the publisher."""
        self._publisher = advertise(Float64MultiArray, topics.SHARED_TOPIC)

    def send(self, stamp: int) -> None:
        """Send the torques as the response to the state of a stamp in ns."""
        self._numbers[:] = self._distributed(self._torque[None])[0]
        self._sent = self._writer.to_bytes(stamp)
        self.repeat()

    def send_void(self, stamp: int) -> None:
        """Send a void command as the response to the state of a stamp in ns."""
        self._sent = self._void.to_bytes(stamp)
        self.repeat()

    def repeat(self) -> None:
        """Send the last torques again."""
        self._publisher.publish(self._sent)


class BaseOutput:
    """Velocities of the base on cmd_vel, and commands of the other joints on a separate topic."""

    def __init__(
        self, controller: Controller, values: Values, joints: Sequence[str]
    ) -> None:
        """
        Initialise with the controller, its parameters and the names of the driven joints.

        The other joints receive torques with `command_interface` hybrid, otherwise velocities.
        Raises InputError for a bad frame prefix.
        """
        self.publishers: list[Publisher] = []
        prefix = check_frame_prefix(FRAME_PREFIX.of(values))
        base = controller.mechanism.frames[0][1]
        self._twist: TwistCdr | TwistStampedCdr = TwistCdr()
        self._type: type = Twist
        if ENABLE_STAMPED_CMD_VEL.of(values):
            self._twist, self._type = TwistStampedCdr(prefix, base), TwistStamped
        self._mechanism = controller.mechanism
        self._base = len(self._mechanism.twist)
        joints = joints[self._base:]
        self._is_hybrid = controller.is_hybrid
        kind = (EFFORT if self._is_hybrid else ARM_VELOCITY).named(joints)
        self._topic = topics.COMMAND_TOPIC if self._is_hybrid else topics.ARM_VELOCITY_TOPIC
        self._velocities = controller.velocity_command[:self._base]
        source = controller.torque if self._is_hybrid else controller.velocity_command
        self._joint_command = source[self._base:]
        zeros = np.zeros(len(joints))
        self._writer = CommandWriter(kind, self._joint_command)
        self._void = CommandWriter(kind, zeros, is_void=self._is_hybrid)
        self._sent = b'', b''

    def connect(self, advertise: Advertise) -> None:
        """Create the publishers."""
        self.publishers = [
            advertise(self._type, topics.CMD_VEL_TOPIC),
            advertise(Float64MultiArray, self._topic),
        ]

    def send(self, stamp: int) -> None:
        """Send the command as the response to the state of a stamp in ns."""
        self._send(self._velocities, self._writer, stamp)

    def send_void(self, stamp: int) -> None:
        """Send zero velocities, or void torques, as the response to the state of a stamp in ns."""
        self._send(np.zeros(self._base), self._void, stamp)

    def repeat(self) -> None:
        """Send the last command again, first the twist, which may have no stamp."""
        for publisher, raw in zip(self.publishers, self._sent, strict=True):
            publisher.publish(raw)

    def figures(self) -> dict[str, str]:
        """Return the commanded velocities, and with hybrid the largest torque."""
        figures = {
            f'{velocity.name} ({velocity.unit})': f'{rate:.6g}'
            for velocity, rate in zip(self._mechanism.twist, self._velocities, strict=True)
        }
        if self._is_hybrid:
            return {**figures, **_largest(self._joint_command)}
        rates = ', '.join(f'{rate:.6g}' for rate in self._joint_command.tolist())
        return {**figures, f"{self._mechanism.groups[-1].name}'s rates (rad/s)": rates}

    def _send(self, velocities: Array, writer: CommandWriter, stamp: int) -> None:
        twist = self._twist
        if isinstance(twist, TwistStampedCdr):
            twist.set_stamp(stamp)
        for velocity, number in zip(self._mechanism.twist, velocities, strict=True):
            part, axis = divmod(velocity.place, 3)
            (twist.linear, twist.angular)[part][axis] = number
        self._sent = twist.to_bytes(), writer.to_bytes(stamp)
        self.repeat()


class ControllerTelemetry:
    """Publishers of the signals."""

    def __init__(
        self, controller: Controller, decimation: int, advertise: Callable[[type, str], Publisher]
    ) -> None:
        """Create the topics by `advertise`; none if the decimation is 0."""
        signals = (
            (signal.label, controller.signals[signal.name].reshape(-1))
            for signal in PUBLISHED
            if not (signal.of_torques and controller.commands_rates)
        )
        self._topics = [
            (
                advertise(Float64MultiArray, topics.telemetry_topic(label)),
                TelemetryCdr(label, len(values)).writer(values),
            )
            for label, values in signals
            if decimation
        ]

    def send(self, stamp: int) -> None:
        """Publish the signals of the tick whose state has a stamp in ns."""
        for publisher, to_bytes in self._topics:
            publisher.publish(to_bytes(stamp))
