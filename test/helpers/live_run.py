# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Four real nodes by the wall clock, watched at every tick while faults are brought in."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import signal
import time
from typing import Any

from builtin_interfaces.msg import Time
from checked_log import check_log, LIMIT, load_finite
from diagnostic_msgs.msg import DiagnosticArray
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.messages.text import text_of
import numpy as np
from processes import NodeProcess, NODES, PAPER, Peer, peer, Processes, processes, ros_arguments
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String


class LiveRun:
    """
    The nodes of a run, what they say, and whether every torque was fine.

    Attributes
    ----------
    stamp
        the latest stamp of the plant in ns.
    torque
        the torque (4) that the plant applied last, N m.
    torques
        all of them.
    commands
        number of commands so far.
    wrong
        what was wrong with torques so far.
    told
        every state that the controller told.
    recorded
        stamps in ns up to which the recorder has told that it is, every one.
    health
        the latest report of each node.
    reported
        every report, with the node's name.
    injected
        what a test has sent in our own layout, which is not the nodes' doing.

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
        self.told: list[str] = []
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
            # The period and one more until a torque is applied need a thick layer.
            'k_s1': 40.0,
            'k_s2': 40.0,
            'boundary_layer': 0.5,
            # While nobody steers, the robot must not be driven far.
            'plant__disturbance.amplitude': '[0.3, 0.3, 0.2, 0.2]',
            **settings,
        }
        tester.subscribe(JointState, 'joint_states', self._on_state, raw=True)
        tester.subscribe(Float64MultiArray, 'effort_commands', self._on_command, raw=True)
        tester.subscribe(String, 'controller/state', self._on_told, raw=True)
        tester.subscribe(DiagnosticArray, '/diagnostics', self._on_health)
        tester.subscribe(Time, 'recorder/progress', self._on_progress, raw=True)

    @property
    def log(self) -> Path:
        """Return the log of the present recorder."""
        return self.folder / f'run_{self._logs}.mcap'

    def start(self, name: str) -> None:
        """Start a node, once more maybe."""
        self._logs += name == 'recorder'
        shared = ('pacing', 'control_period', 'duration')
        settings = {
            key if '__' in key or key in shared else f'controller__{key}': value
            for key, value in self._settings.items()
        }
        arguments = ros_arguments(PAPER, recorder__output=self.log, **settings)
        self.nodes[name] = self.started.start(name, *arguments)

    def goes_on(self, seconds: float = 0.3) -> None:
        """Wait until the controller is active, and the plant so far moved by its torques."""
        self.tester.until(lambda: self.told and self.told[-1] == 'active', 'an active controller')
        stamp, commands = self.stamp, self.commands

        def has_moved() -> bool:
            # A plant that was started again begins at 0.
            return (
                (self.stamp > stamp + seconds * 1e9 or 0 <= self.stamp < stamp)
                and self.commands > commands + 50
                and bool(np.any(self.torque))
            )

        self.tester.until(has_moved, f'motion under torque\n{self.started.output()}')
        assert self.wrong == []

    def is_told(self, *parts: str) -> None:
        """Wait until the controller has told a state with these parts, from now on."""
        seen = len(self.told)
        self.tester.until(
            lambda: any(all(p in t for p in parts) for t in self.told[max(0, seen - 1):]),
            f'{parts} in {self.told}',
        )

    def reports(self, node: str, key: str, expected: str) -> None:
        """Wait until a node's diagnostics say something of a key."""
        self.tester.until(
            lambda: expected in self.health.get(node, {}).get(key, ''),
            f'{expected} of {key} in {self.health}',
        )

    def has_reported(self, node: str, key: str, expected: str) -> None:
        """Wait until a node's diagnostics have said something of a key once in the run."""
        self.tester.until(
            lambda: any(n == node and expected in v.get(key, '') for n, v in self.reported),
            f'{expected} of {key}',
        )

    def spin(self, seconds: float) -> None:
        """Let time pass: for how long a fault lasts."""
        end = time.monotonic() + seconds
        self.tester.until(lambda: time.monotonic() > end)

    def end(self, *, in_order: bool = True) -> None:
        """
        End all nodes by SIGINT: with status 0, nothing bad said, and a log that is whole.

        States that controllers told are in it `in_order`, unless two told them at once.
        """
        if 'recorder' in self.nodes:
            # One that has just been started may not have been found by the recorder.
            seen, stamp = len(self.recorded), self.stamp
            self.tester.until(
                lambda: any(each >= stamp for each in self.recorded[seen:]),
                f'a recorder that hears all: {self.recorded[-1:]}, {stamp}',
            )
        for node in self.nodes.values():
            node.signal(signal.SIGINT)
        for node in self.nodes.values():
            assert node.wait() == 0, self.started.output()
        assert 'Traceback' not in self.started.output()
        assert self.wrong == []
        if 'recorder' in self.nodes:
            told = self.told if self._logs == 1 else None
            check_log(
                self.log,
                told=told,
                in_order=in_order,
                limit=self._limit,
                injected=self.injected,
            )

    def _on_state(self, raw: bytes) -> None:
        if raw in self.injected or not self._state.load(raw):
            return  # brought in by a test, as those of other layouts are
        torque = self._state.effort[3:]
        if not np.all(np.abs(torque) <= LIMIT):
            self.wrong.append(f'{torque.tolist()} N m applied at {self._state.stamp_ns} ns')
        self.stamp = self._state.stamp_ns
        self.torque = torque.copy()
        self.torques.append(self.torque)

    def _on_command(self, raw: bytes) -> None:
        if raw not in self.injected and load_finite(self._command, raw):
            self.commands += 1
            if not np.all(np.abs(self._command.data) <= self._limit):
                self.wrong.append(f'a command {self._command.data.tolist()}')

    def _on_told(self, raw: bytes) -> None:
        if raw not in self.injected:
            self.told.append(text_of(raw))

    def _on_progress(self, raw: bytes) -> None:
        if raw not in self.injected:
            self.recorded.append(header_stamp(raw))

    def _on_health(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {each.key: each.value for each in status.values}
            name = status.name.lstrip('/')
            self.health[name] = {'message': status.message, **values}
            self.reported.append((name, self.health[name]))


@contextmanager
def live_run(folder: Path, *nodes: str, **settings: Any) -> Iterator[LiveRun]:
    """Yield a run that has begun; `settings` are the controller's or NODE__name=value."""
    with processes(folder) as started, peer(started.domain) as tester:
        run = LiveRun(started, tester, folder, settings)
        for name in nodes or NODES:
            run.start(name)
        yield run
