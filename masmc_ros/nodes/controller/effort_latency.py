# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Latency by the efforts in joint_states, for /diagnostics."""

from __future__ import annotations

from masmc_ros.aliases import Array
from masmc_ros.identification.effort_echo import (
    compile_echo,
    echo_text,
    EchoBuffer,
    fit_echo,
    wrong_latency,
)
from masmc_ros.identification.latency_fit import LatencyFit
from masmc_ros.loop.controller import Controller
from masmc_ros.nodes.controller.background import Background


class EffortEcho:
    """Comparison of the commands with the efforts; the computation has a separate thread."""

    def __init__(self, controller: Controller, background: Background) -> None:
        """Initialise without a state, and compile the comparison."""
        self._controller, self._background = controller, background
        self._torque, self._joints = controller.torque, len(controller.torque)
        self._buffer: EchoBuffer | None = EchoBuffer(self._joints, controller.period)
        if controller.commands_rates:
            self._buffer = None
        # Written by the thread as a whole, and read by the node.
        self._timing: LatencyFit | None = None
        compile_echo()

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
        return {} if timing is None else {'latency by effort (ms)': echo_text(timing)}

    def warning(self) -> str:
        """Return a warning about a wrong latency, else ''."""
        values, timing = self._controller.values, self._total
        if timing is None:
            return ''
        return wrong_latency(
            timing, values['latency'], values['motor_lag'], self._controller.period
        )

    @property
    def _total(self) -> LatencyFit | None:
        """Return the latency from the measurement on, and not from its stamp."""
        timing, age = self._timing, self._controller.stamp_age
        if timing is None:
            return None
        latency, lag, total = timing
        return LatencyFit(
            latency._replace(value=latency.value + age),
            lag,
            total._replace(value=total.value + age),
        )

    def _compare(self, times: Array, effort: Array, torque: Array) -> None:
        self._timing = fit_echo(times, effort, torque)
