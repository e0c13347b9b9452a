# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Control nodes continue when their subscribers are killed."""

from __future__ import annotations

import os
from pathlib import Path
import random
import signal
import time
from typing import Any

from helpers.processes import BOUNDED, PAPER, Peer, peer, ros_arguments
from helpers.subprocesses import Subprocesses, subprocesses
from masmc_ros.messages.commands import EffortCdr
from masmc_ros.messages.stamps import header_stamp
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

KINDS = ('recorder', 'controller', 'trajectory', 'listener')
AT_ONCE = 4
LONGEST = 1.5
"""Maximum lifetime of a subscriber in s: kills occur before, during and after its setup."""

SETTLED = 10**8
"""Robot time in ns for which the run must continue after each round."""

ENDING = 30.0
"""Maximum time in s from SIGINT to the end of a node on a busy machine."""

ROBOT = ros_arguments(
    PAPER, **{'duration': 0.0, 'pacing': 'realtime', 'plant__wait_for': "['']", **BOUNDED}
)


def listener(started: Subprocesses, kind: str, folder: Path, number: int) -> Any:
    """Start a subscriber of a kind."""
    if kind == 'listener':
        return started.listen('joint_states', 'effort_commands', 'reference')
    settings: dict[str, object] = {'duration': 0.0}
    if kind == 'recorder':
        settings['recorder__output'] = folder / f'{number}.mcap'
    return started.start(kind, *ros_arguments(PAPER, **settings, **BOUNDED))


class Robot:
    """Stamps in ns of the latest state and of the latest command."""

    def __init__(self, tester: Peer) -> None:
        self._tester = tester
        self.state = self.answered = 0
        self._command = EffortCdr()
        tester.subscribe(JointState, 'joint_states', self._on_state, raw=True, past=False)
        tester.subscribe(
            Float64MultiArray, 'effort_commands', self._on_command, raw=True, past=False
        )

    def _on_state(self, raw: bytes) -> None:
        self.state = header_stamp(raw)

    def _on_command(self, raw: bytes) -> None:
        if self._command.load(raw) and self._command.stamp_ns is not None:
            self.answered = self._command.stamp_ns

    def wait_for_progress(self) -> None:
        """Wait until states and their answers have continued for SETTLED."""
        start = self.state
        self._tester.until(
            lambda: min(self.state, self.answered) > start + SETTLED,
            f'states after {start * 1e-9:.3f} s and their answers',
        )


def kill(kinds: tuple[str, ...], count: int, folder: Path) -> None:
    """Kill `count` subscribers of each kind, a few at a time, during a run."""
    rng = random.Random(count)
    with subprocesses(folder) as started, peer(started.domain) as tester:
        nodes = [started.start(name, *ROBOT) for name in ('plant', 'trajectory', 'controller')]
        robot = Robot(tester)
        tester.until(lambda: robot.state and robot.answered, 'a controlled robot')
        for kind in kinds:
            for first in range(0, count, AT_ONCE):
                numbers = range(first, min(first + AT_ONCE, count))
                dying = [
                    (time.monotonic() + rng.uniform(0.0, LONGEST), process)
                    for process in (listener(started, kind, folder, n) for n in numbers)
                ]
                for moment, process in sorted(dying, key=lambda pair: pair[0]):
                    time.sleep(max(0.0, moment - time.monotonic()))
                    process.kill()
                    process.join()
                    assert process.exitcode == -signal.SIGKILL
                robot.wait_for_progress()
                for log in folder.glob('*.mcap'):
                    log.unlink()
        for process in nodes:
            assert process.exitcode is None
            os.kill(process.pid, signal.SIGINT)
        for process in nodes:
            process.join(ENDING)
            assert process.exitcode == 0


@pytest.mark.slow
def test_control_nodes_few_killed_subscribers_continue(tmp_path: Path) -> None:
    kill(KINDS, 4, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(('kind', 'count'), ({**dict.fromkeys(KINDS, 16), 'listener': 60}).items())
def test_control_nodes_many_killed_subscribers_continue(
    kind: str, count: int, tmp_path: Path
) -> None:
    kill((kind,), count, tmp_path)
