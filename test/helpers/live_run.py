# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Four nodes in real-time mode, with a check of every torque during injected faults."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import signal
import time
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from helpers.checked_log import check_log, LIMIT, load_finite
from helpers.processes import (
    NodeProcess,
    NODES,
    PAPER,
    Peer,
    peer,
    Processes,
    processes,
    ros_arguments,
)
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.message import text_of
from masmc_ros.messages.stamps import header_stamp
import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String


class LiveRun:
    """
    Nodes of a run, their messages, and a check of every torque.

    Attributes
    ----------
    stamp
        latest stamp of the plant in ns.
    torque
        latest torque (4) applied by the plant, N·m.
    torques
        all applied torques.
    commands
        number of commands so far.
    wrong
        descriptions of all invalid torques so far.
    states
        all texts of `controller/state`.
    recorded
        all stamps in ns of `recorder/progress`.
    health
        latest report of each node.
    reported
        all reports, each with the node's name.
    injected
        messages in the nodes' own layout that the test has published.

    """

    def __init__(
        self, started: Processes, tester: Peer, folder: Path, settings: dict[str, Any]
    ) -> None:
        self.started = started
        self.tester = tester
        self.folder = folder
        self.stamp = -1
        self.torque = np.zeros(4)
        self.torques: list[np.ndarray] = []
        self.commands = 0
        self.wrong: list[str] = []
        self.states: list[str] = []
        self.injected: set[bytes] = set()
        self.recorded: list[int] = []
        self.health: dict[str, dict[str, str]] = {}
        self.reported: list[tuple[str, dict[str, str]]] = []
        self.nodes: dict[str, NodeProcess] = {}
        self._state, self._command = JointStateCdr(), EffortCdr()
        self._limit = np.full(4, np.inf) if 'torque_limit' in settings else LIMIT
        self._logs = 0
        self._settings: dict[str, Any] = {
            'pacing': 'realtime',
            'control_period': 0.002,
            'duration': 0.0,
            'plant__wait_for': '[controller, trajectory, recorder, peer]',
            'plant__torque_limit': str(LIMIT.tolist()),
            'plant__command_timeout': 0.2,
            'state_timeout': 0.2,
            'torque_limit': str(LIMIT.tolist()),
            # The delay of two periods until a torque acts requires a thick boundary layer.
            'k_s1': 40.0,
            'k_s2': 40.0,
            'boundary_layer': 0.5,
            # Without a controller, the disturbance must not move the robot far.
            'plant__disturbance.amplitude': '[0.3, 0.3, 0.2, 0.2]',
            **settings,
        }
        tester.subscribe(JointState, 'joint_states', self._on_state, raw=True)
        tester.subscribe(Float64MultiArray, 'effort_commands', self._on_command, raw=True)
        tester.subscribe(String, 'controller/state', self._on_controller_state, raw=True)
        tester.subscribe(DiagnosticArray, '/diagnostics', self._on_health)
        tester.subscribe(Time, 'recorder/progress', self._on_progress, raw=True)

    @property
    def log(self) -> Path:
        """Return the log of the current recorder."""
        return self.folder / f'run_{self._logs}.mcap'

    def start(self, name: str) -> None:
        """Start or restart a node."""
        self._logs += name == 'recorder'
        shared = ('pacing', 'control_period', 'duration')
        settings = {
            key if '__' in key or key in shared else f'controller__{key}': value
            for key, value in self._settings.items()
        }
        arguments = ros_arguments(PAPER, recorder__output=self.log, **settings)
        self.nodes[name] = self.started.start(name, *arguments)

    def wait_for_progress(self, seconds: float = 0.3) -> None:
        """Wait until the controller is active and its torques have moved the plant for a time."""
        self.tester.until(
            lambda: self.states and self.states[-1] == 'active', 'an active controller'
        )
        stamp, commands = self.stamp, self.commands

        def has_moved() -> bool:
            # A restarted plant starts at 0.
            return (
                (self.stamp > stamp + seconds * 1e9 or 0 <= self.stamp < stamp)
                and self.commands > commands + 50
                and bool(np.any(self.torque))
            )

        self.tester.until(has_moved, f'motion under torque\n{self.started.output()}')
        assert self.wrong == []

    def wait_for_state(self, *parts: str) -> None:
        """Wait until the controller publishes a state with all these parts."""
        seen = len(self.states)
        self.tester.until(
            lambda: any(all(p in t for p in parts) for t in self.states[max(0, seen - 1):]),
            f'{parts} in {self.states}',
        )

    def wait_for_recorder(self) -> None:
        """Wait until the recorder, which gets the latest state only, subscribes to it."""
        topic = 'controller/state'
        self.tester.until(
            lambda: self.tester.node.count_subscribers(topic) > 1, f'the recorder on {topic}'
        )

    def wait_for_report(self, node: str, key: str, expected: str) -> None:
        """Wait until a node's diagnostics have an expected value of a key."""
        self.tester.until(
            lambda: expected in self.health.get(node, {}).get(key, ''),
            f'{expected} of {key} in {self.health}',
        )

    def wait_for_earlier_report(self, node: str, key: str, expected: str) -> None:
        """Wait until any report of a node in this run has an expected value of a key."""
        self.tester.until(
            lambda: any(n == node and expected in v.get(key, '') for n, v in self.reported),
            f'{expected} of {key}',
        )

    def spin(self, seconds: float) -> None:
        """Spin for a duration in s, the duration of a fault."""
        end = time.monotonic() + seconds
        self.tester.until(lambda: time.monotonic() > end)

    def end(self, *, in_order: bool = True) -> None:
        """
        End all nodes by SIGINT; they must exit with status 0 and leave a complete log.

        The controller's states are logged `in_order`, unless two controllers published them.
        """
        if 'recorder' in self.nodes:
            # The recorder may not have discovered a node that has just been started.
            seen, stamp = len(self.recorded), self.stamp
            self.tester.until(
                lambda: any(time >= stamp for time in self.recorded[seen:]),
                f'progress of the recorder: {self.recorded[-1:]}, {stamp}',
            )
        for node in self.nodes.values():
            node.signal(signal.SIGINT)
        for node in self.nodes.values():
            assert node.wait() == 0, self.started.output()
        assert 'Traceback' not in self.started.output()
        assert self.wrong == []
        if 'recorder' in self.nodes:
            states = self.states if self._logs == 1 else None
            check_log(
                self.log,
                states=states,
                in_order=in_order,
                limit=self._limit,
                injected=self.injected,
            )

    def _on_state(self, raw: bytes) -> None:
        if raw in self.injected or not self._state.load(raw):
            return  # published by a test, in this layout or in another
        torque = self._state.effort[3:]
        if not np.all(np.abs(torque) <= LIMIT):
            self.wrong.append(f'{torque.tolist()} N·m applied at {self._state.stamp_ns} ns')
        self.stamp = self._state.stamp_ns
        self.torque = torque.copy()
        self.torques.append(self.torque)

    def _on_command(self, raw: bytes) -> None:
        if raw not in self.injected and load_finite(self._command, raw):
            self.commands += 1
            if not np.all(np.abs(self._command.data) <= self._limit):
                self.wrong.append(f'a command {self._command.data.tolist()}')

    def _on_controller_state(self, raw: bytes) -> None:
        if raw not in self.injected:
            self.states.append(text_of(raw))

    def _on_progress(self, raw: bytes) -> None:
        if raw not in self.injected:
            self.recorded.append(header_stamp(raw))

    def _on_health(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {pair.key: pair.value for pair in status.values}
            name = status.name.lstrip('/')
            self.health[name] = {'message': status.message, **values}
            self.reported.append((name, self.health[name]))


@contextmanager
def live_run(folder: Path, *nodes: str, **settings: Any) -> Iterator[LiveRun]:
    """Yield a started run; `settings` are the controller's, or NODE__name=value."""
    with processes(folder) as started, peer(started.domain) as tester:
        run = LiveRun(started, tester, folder, settings)
        for name in nodes or NODES:
            run.start(name)
        yield run
