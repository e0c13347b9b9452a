# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Payload and latency that the controller identifies while it runs, for /diagnostics.

The computations run in a thread of their own (`Background`). The latency follows from the efforts
in joint_states, which repeat the commands of many drives.
"""

from __future__ import annotations

from collections.abc import Callable
import math
from queue import SimpleQueue
import sys
from threading import Thread

from geometry_msgs.msg import InertiaStamped
from masmc_ros.aliases import Array
from masmc_ros.identification import latency_fit
from masmc_ros.identification.live_payload import (
    Block,
    BlockBuffer,
    described,
    PayloadEstimate,
    PayloadEstimator,
)
from masmc_ros.identification.parameter_file import nominal_of
from masmc_ros.law.parts.delay_fields import LATENCY, MOTOR_LAG
from masmc_ros.law.parts.model import MODEL_SCALE, PAYLOAD_MASS
from masmc_ros.law.parts.velocity_estimator import ESTIMATED, SOURCES, VELOCITY_SOURCE
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.controller_parameters import ESTIMATION_TIME
from masmc_ros.messages.cdr_layout import NANOSECONDS
from masmc_ros.messages.topics import PAYLOAD_TOPIC
from masmc_ros.params.declaration import Values
from masmc_ros.robot.mechanisms import FRAME_PREFIX
from rclpy.clock import Clock
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node
from rclpy.publisher import Publisher

_MOST_WAITING = 20
"""Computations that may wait; further ones are skipped."""

_SWITCH_INTERVAL = 2e-4
"""Time in s after which the thread gives way to a tick; 5 ms by default."""


class Background:
    """Thread that calls functions one after another."""

    def __init__(self) -> None:
        """Initialise without a thread; the first function starts it."""
        self._calls: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._thread: Thread | None = None

    def call(self, function: Callable[[], None]) -> bool:
        """Call a function later; return False if too many are waiting."""
        if self._calls.qsize() >= _MOST_WAITING:
            return False
        if self._thread is None:
            sys.setswitchinterval(min(_SWITCH_INTERVAL, sys.getswitchinterval()))
            self._thread = Thread(target=self._run, daemon=True)
            self._thread.start()
        self._calls.put(function)
        return True

    def close(self) -> None:
        """Wait for the current functions, and end the thread."""
        if self._thread is not None:
            self._calls.put(None)
            self._thread.join()

    def _run(self) -> None:
        while (function := self._calls.get()) is not None:
            function()


class EffortEcho:
    """Comparison of the commands with the efforts; the computation has a separate thread."""

    def __init__(self, controller: Controller, background: Background) -> None:
        """Initialise without a state, and compile the comparison."""
        self._controller, self._background = controller, background
        self._torque, self._joints = controller.torque, len(controller.torque)
        self._buffer: latency_fit.EchoBuffer | None = None
        if not controller.commands_rates:
            self._buffer = latency_fit.EchoBuffer(self._joints, controller.period)
        # Written by the thread as a whole, and read by the node.
        self._timing: latency_fit.LatencyFit | None = None
        latency_fit.compile_echo()

    def watch(self, effort: Array) -> None:
        """Set the array of the efforts in the last state, which has the driven joints last."""
        self._effort = effort[-self._joints:]

    def add(self, stamp: int) -> None:
        """Add the answer to the last state, with its stamp in ns."""
        if self._buffer is None:
            return
        part = self._buffer.add(stamp, self._effort, self._torque)
        if part is not None:
            self._background.call(lambda: self._compare(*part))

    def figures(self) -> dict[str, str]:
        """Return latency and motor lag for /diagnostics; nothing if the efforts are no echo."""
        timing = self._total
        return {} if timing is None else {'latency by effort (ms)': latency_fit.echo_text(timing)}

    def warning(self) -> str:
        """Return a warning about a wrong latency, else ''."""
        values, timing = self._controller.values, self._total
        if timing is None:
            return ''
        return latency_fit.wrong_latency(
            timing, LATENCY.of(values), MOTOR_LAG.of(values), self._controller.period
        )

    @property
    def _total(self) -> latency_fit.LatencyFit | None:
        """Return the latency from the measurement on, and not from its stamp."""
        timing, age = self._timing, self._controller.stamp_age
        if timing is None:
            return None
        latency, lag, total = timing
        return latency_fit.LatencyFit(
            latency._replace(value=latency.value + age),
            lag,
            total._replace(value=total.value + age),
        )

    def _compare(self, times: Array, effort: Array, torque: Array) -> None:
        self._timing = latency_fit.fit_echo(times, effort, torque)


_PERIOD = 0.5
"""Time in s between two checks for a new estimate."""

_PRECISE = 1e-3
"""Largest standard error in s of a latency that is reported."""


class PayloadOutput:
    """Estimator of the payload with its publisher; the computation has a separate thread."""

    def __init__(
        self, controller: Controller, values: Values, background: Background, log: RcutilsLogger
    ) -> None:
        """
        Initialise the estimator and compile it.

        Parameters
        ----------
        controller
            Controller whose states and torques are used.
        values
            Checked parameters of the controller node.
        background
            Thread of the computation.
        log
            Logger for changes of the payload.

        Raises
        ------
        InputError
            if the type of robot has no description of payloads.

        """
        self._controller, self._background, self._log = controller, background, log
        mechanism, nominal = controller.mechanism, nominal_of(values)
        span = ESTIMATION_TIME.of(values)
        self._estimator = PayloadEstimator(
            nominal.robot, nominal.theta, nominal.friction, ~controller.by_velocity, span
        )
        self._joints = len(mechanism.joints)
        sizes = mechanism.sizes
        self._buffer = BlockBuffer(sizes['positions'], self._joints, controller.period)
        signals = controller.signals[0]
        self._position = signals['position'][:, 0]
        self._rates = signals['velocity'][-self._joints:, 0]
        self._tip = mechanism.point_frame or mechanism.frames[-1][1]
        self._frame = FRAME_PREFIX.of(values) + self._tip
        # Stamp, latency and estimate, written by the thread as a whole and read by the node.
        self._latest: tuple[int, float, PayloadEstimate | None] = 0, 0.0, None
        self._published, self._text = 0, ''
        self._is_significant = False
        if MODEL_SCALE.of(values) != 1.0:
            log.warning(
                f'model_scale = {MODEL_SCALE.of(values):g}: the estimate of the payload contains '
                'the error of the model; identify the robot and use model_scale = 1'
            )

    def connect(
        self, node: Node, clock: Clock, advertise: Callable[[type, str], Publisher]
    ) -> None:
        """Create the topic and its timer, with a steady clock."""
        self._name = node.get_fully_qualified_name()
        self._publisher = advertise(InertiaStamped, PAYLOAD_TOPIC)
        node.create_timer(_PERIOD, self._publish, clock=clock)

    def add(self, stamp: int) -> None:
        """Add the answer to the state of a stamp in ns."""
        block = self._buffer.add(stamp, self._position, self._rates, self._controller.torque)
        if block is None:
            return
        values = self._controller.values
        latency = LATENCY.of(values) + MOTOR_LAG.of(values)
        uses_rates = VELOCITY_SOURCE.of(values) != SOURCES[ESTIMATED]
        self._background.call(lambda: self._update(stamp, block, latency, uses_rates))

    def figures(self) -> dict[str, str]:
        """Return the payload for /diagnostics."""
        figures = {'payload': self._text or self._describe(None)}
        _, latency, estimate = self._latest
        if estimate is not None and estimate.later.error < _PRECISE:
            latency += estimate.later.value
            text = f'{1e3 * latency:.1f} ± {1e3 * estimate.later.error:.1f}'
            figures['latency by motion, with motor lag (ms)'] = text
        return figures

    def _update(self, stamp: int, block: Block, latency: float, uses_rates: bool) -> None:
        if latency != self._latest[1]:
            # The estimated delay is relative to the latency of the blocks.
            self._estimator.restart()
        self._estimator.add(block, latency, uses_rates=uses_rates)
        self._latest = stamp, latency, self._estimator.estimate()

    def _describe(self, estimate: PayloadEstimate | None) -> str:
        return described(
            estimate, PAYLOAD_MASS.of(self._controller.values), tip=self._tip, node=self._name
        )

    def _publish(self) -> None:
        stamp, _, estimate = self._latest
        if stamp == self._published:
            return
        self._published, self._text = stamp, self._describe(estimate)
        if estimate is None:
            return
        if estimate.is_significant != self._is_significant:
            self._is_significant = estimate.is_significant
            self._log.info(f'payload: {self._text}')
        if estimate.is_significant:
            self._publisher.publish(self._message(stamp, estimate))

    def _message(self, stamp: int, estimate: PayloadEstimate) -> InertiaStamped:
        message = InertiaStamped()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, NANOSECONDS)
        message.header.frame_id = self._frame
        inertia, centre = message.inertia, estimate.centre.tolist()
        inertia.m = estimate.load.mass
        inertia.com.x, inertia.com.y, inertia.com.z = centre
        for name in ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz'):
            setattr(inertia, name, math.nan)
        return message
