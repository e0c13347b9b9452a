# SPDX-License-Identifier: Apache-2.0
"""The controller node: answers every state with a torque."""

from __future__ import annotations

from collections.abc import Mapping
import sys
from typing import Any

import numpy as np
from rclpy.context import Context
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from masmc_ros.control.laws import registry
from masmc_ros.control.laws.update import BUILT_IN
from masmc_ros.errors import InputError
from masmc_ros.log.cdr import EffortCdr, JointStateCdr, ReferenceWindow, TelemetryCdr
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.simulated_robot import diverged
from masmc_ros.loop.simulation import robot_of
from masmc_ros.loop.timing import Timing
from masmc_ros.nodes.base import SuiteNode
from masmc_ros.nodes.command_line import CommandLine
from masmc_ros.nodes.qos import subscribe_with_past
from masmc_ros.nodes.runtime import run
from masmc_ros.reference.windows import ReferenceWindows


class ControllerNode(SuiteNode):
    """Turns joint_states and reference into effort_commands, tick by tick."""

    name = 'controller'

    def __init__(self, *, context: Context, command_line: CommandLine) -> None:
        """Make the controller and compile its tick."""
        super().__init__(context=context, command_line=command_line, check=_check_law)
        self._timing = Timing.from_values(self.values)
        self._controller = Controller(robot_of(self.values), self._timing.period, self.values)
        self._reference = ReferenceWindows()
        self._last_stamp: int | None = None
        self._pending: int | None = None
        self._changes: dict[str, Any] = {}
        self._was_singular = False
        self._state = JointStateCdr()
        self._effort = EffortCdr()
        self._position, self._velocity = self._state.position, self._state.velocity
        # The torque is computed into the message.
        self._controller.torque = self._effort.data
        self._decimation: int = self.values['telemetry_decimation']
        self._compile()

    def connect(self) -> None:
        """Create the topics: commands and telemetry out, reference and states in."""
        super().connect()
        self._commands = self.publisher(Float64MultiArray, 'effort_commands')
        self._telemetry = [
            (
                self.publisher(Float64MultiArray, f'controller/{label}'),
                TelemetryCdr(label, len(values)),
                values,
            )
            for label, values in (
                ('tracking_error', self._controller.error),
                ('sliding_surface', self._controller.surface),
                ('parameter_estimate', self._controller.used_estimate),
            )
            if self._decimation
        ]
        self.parameters.on_change(self._change)
        subscribe_with_past(
            self.node, Float64MultiArray, 'reference', self._on_reference, depth=100
        )
        subscribe_with_past(self.node, JointState, 'joint_states', self._on_state)
        self.wait('the plant (joint_states)')

    def _compile(self) -> None:
        """Compute a tick of no consequence, so that the first real one is not late."""
        self._controller.tick(np.ones(7), np.zeros(7), np.zeros(12))
        self._controller.reset()

    def _change(self, values: dict[str, Any]) -> None:
        self._controller.change(values)
        self._changes.update(values)

    def _on_reference(self, raw: bytes) -> None:
        try:
            window = ReferenceWindow.from_bytes(raw)
            if window is None:
                message = deserialize_message(raw, Float64MultiArray)
                window = ReferenceWindow.from_message(message)
        except InputError as error:
            self.log.error(f'refused: {error}', throttle_duration_sec=1.0)
            return
        samples = window.samples.reshape(-1, 12)
        if window.stamp_ns is None:
            self._reference.set_point(samples[0])
        else:
            self._reference.add(window.stamp_ns, window.period, samples)
        if self._pending is not None:
            self._answer(self._pending)

    def _on_state(self, raw: bytes) -> None:
        if not self._state.load(raw):
            try:
                self._state.load_message(deserialize_message(raw, JointState))
            except InputError as error:
                self.log.error(f'joint_states refused: {error}', throttle_duration_sec=1.0)
                return
        self._answer(self._state.stamp_ns)

    def _answer(self, stamp: int) -> None:
        """Compute and publish the command for the state at hand."""
        last = self._last_stamp
        if last is not None and stamp <= last:
            if stamp == last:
                self._commands.publish(self._effort.to_bytes())
                return
            self.log.info('the robot was set back; the controller starts anew')
            self._controller.reset()
            self._last_stamp = None
        reference = self._reference.at(stamp)
        if reference is None:
            reference = self._reference_beyond(stamp)
            if reference is None:
                self._pending = stamp
                self.wait('the trajectory (reference)')
                return
        self._pending = None
        self.wait(None)
        controller = self._controller
        singular = controller.tick(self._position, self._velocity, reference)
        if not self._effort.is_finite():
            raise diverged(stamp * 1e-9)
        self._effort.set_stamp(stamp)
        self._commands.publish(self._effort.to_bytes())
        self._last_stamp = stamp
        tick = round(stamp / (1e9 * self._timing.period))
        if self._telemetry and tick % self._decimation == 0:
            for publisher, message, values in self._telemetry:
                message.set_stamp(stamp)
                message.values[:] = values
                publisher.publish(message.to_bytes())
        if self._changes:
            self.record_parameters(tick, stamp, self._changes)
            self._changes = {}
        if singular != self._was_singular:
            self._was_singular = singular
            self._say_singular(stamp, singular)
        if self._timing.last is not None and tick >= self._timing.last:
            self.finished = True

    def _reference_beyond(self, stamp: int) -> Any:
        """Return what to follow where no window covers the stamp; None to wait.

        In lock-step the plant waits for the command, and the reference is on its way. A
        newer state while one is unanswered tells that the plant does not wait: then the
        last position is held.
        """
        if self._pending is None or self._pending == stamp:
            return None
        return self._reference.held_after(stamp)

    def _say_singular(self, stamp: int, singular: bool) -> None:
        if singular:
            self.log.warning(
                f'at t = {stamp * 1e-9:.3f} s the arm is close to singular (|sin theta_2| < '
                '0.02); motion along the lost direction is damped'
            )
        else:
            self.log.info(f'at t = {stamp * 1e-9:.3f} s the arm has left the singularity')


def _check_law(values: Mapping[str, Any]) -> None:
    """Refuse a plugged-in law that cannot be loaded."""
    if values['law'] not in BUILT_IN:
        registry.load(values['law'])


def main(arguments: list[str] | None = None) -> int:
    """Run the controller node."""
    return run([ControllerNode], arguments)


if __name__ == '__main__':
    sys.exit(main())
