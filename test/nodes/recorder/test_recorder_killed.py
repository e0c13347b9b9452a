# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Recorders killed at random times lose at most 0.6 s of messages.

The time in which a recorder computes, or waits for a processor of a busy machine, is added: it
receives nothing meanwhile.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import random
import signal
from tempfile import TemporaryDirectory

from helpers.command_process import busy
from helpers.processes import PAPER, Peer, peer, Processes, processes, ros_arguments
from masmc_ros.log.read.reader import read_run
from masmc_ros.log.recover import recover
from masmc_ros.messages.stamps import header_stamp
from masmc_ros.nodes.middleware.ros_topics import subscription_qos
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import pytest
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState

ROUNDS, AT_ONCE = 9, 3
MAXIMUM_LOSS = 0.6
"""Maximum robot time in s that a killed recorder may lose."""


ROBOT = ros_arguments(
    PAPER,
    **{
        'control_period': 0.005,
        'duration': 0.0,
        'pacing': 'realtime',
        'wait_for': "['']",
        'disturbance.amplitude': '[0.0, 0.0, 0.0, 0.0]',
    },
)
"""
Robot at rest that sends its state at 200 Hz until it is ended.

It has no controller: on a machine that is busy with recorders, commands would arrive too late for
a stable loop. At 1 kHz recorders that share two cores with 16 other processes fall behind by
seconds, and would lose what they have not received.
"""


@pytest.fixture
def memory(tmp_path: Path) -> Iterator[Path]:
    """
    Yield a folder in memory, where the system has one.

    A killed process ends when its last write does, and writes wait while a slow disk stores what
    other processes have written: up to minutes after an installation.
    """
    shared = Path('/dev/shm')
    if not shared.is_dir():
        yield tmp_path
        return
    with TemporaryDirectory(dir=shared) as folder:
        yield Path(folder)


def recorder(log: Path) -> list[str]:
    """Return the arguments of an endless recorder."""
    return ros_arguments(None, recorder__output=log, duration=0.0)


def recovered_end(log: Path) -> float:
    """Complete a log; return the time in s of its last state."""
    assert recover(log) is not None
    with log.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        count = sum(1 for _ in reader.iter_messages())
        assert count == summary.statistics.message_count > 0
    return float(read_run(log).times[-1])


def check_readers(log: Path) -> None:
    """Decode every message with both readers of ROS 2 messages."""
    with log.open('rb') as stream:
        decoder = make_reader(stream, decoder_factories=[DecoderFactory()])
        decoded = sum(1 for _ in decoder.iter_decoded_messages())
    with AnyReader([log]) as bag:
        assert decoded == sum(1 for _ in bag.messages())


def kill_some(
    started: Processes, tester: Peer, latest: list[int], folder: Path, rng: random.Random
) -> list[tuple[Path, int, int, float]]:
    """
    Kill several recorders.

    Return log, earliest and latest possible last stamp, and maximum loss in s of each.
    """
    logs = [folder / f'{number}.mcap' for number in range(AT_ONCE)]
    recorders = [(started.start('recorder', *recorder(log)), log) for log in logs]
    # The discovery of all nodes takes seconds.
    tester.until(lambda: latest[-1] > 0, 'states')
    tester.until(
        lambda: all(log.exists() and log.stat().st_size > 1000 for log in logs),
        'files of the recorders',
    )
    killed = []
    for process, log in recorders:
        # The file of a recorder grows with every flush.
        size, start, before = log.stat().st_size, latest[-1], busy(process.process.pid)
        tester.until(lambda log=log, size=size: log.stat().st_size > size + 10_000, 'a file grows')
        moment = latest[-1] + rng.randrange(5 * 10**8)
        tester.until(lambda moment=moment: latest[-1] >= moment, 'further states')
        loss = MAXIMUM_LOSS + busy(process.process.pid) - before
        process.signal(signal.SIGKILL)
        killed.append((log, start, latest[-1], loss))
        assert process.wait() == -signal.SIGKILL
    return killed


@pytest.mark.parametrize(
    'number', [0, *(pytest.param(number, marks=pytest.mark.slow) for number in range(1, ROUNDS))]
)
def test_recorder_killed_at_random_loses_little(
    number: int, tmp_path: Path, memory: Path
) -> None:
    """Three per round, in a separate domain, because killed subscribers delay publishers."""
    rng = random.Random(number)
    with processes(tmp_path) as started, peer(started.domain) as tester:
        started.start('plant', *ROBOT)
        latest = [0]

        def store_stamp(raw: bytes) -> None:
            latest[-1] = header_stamp(raw)

        # The newest state only; unprocessed earlier states are dropped.
        tester.node.create_subscription(
            JointState, 'joint_states', store_stamp, subscription_qos(), raw=True
        )
        killed = kill_some(started, tester, latest, memory, rng)
    for log, start, last, loss in killed:
        end = recovered_end(log)
        assert end > start * 1e-9 - loss
        assert last * 1e-9 - end <= loss, log
    if number == 0:
        check_readers(killed[0][0])


@pytest.mark.slow
def test_recorder_start_completes_log_of_killed_recorder(tmp_path: Path) -> None:
    with processes(tmp_path) as started, peer(started.domain) as tester:
        started.start('plant', *ROBOT)
        logs = tmp_path / 'logs'
        logs.mkdir()
        first = started.start('recorder', *recorder(logs / 'first.mcap'))
        path = logs / 'first.mcap'
        tester.until(lambda: path.exists() and path.stat().st_size > 100_000, 'a log')
        first.signal(signal.SIGKILL)
        first.wait()
        second = started.start('recorder', *recorder(logs / 'second.mcap'))
        tester.until(lambda: second.logged('WARN', 'first.mcap'), 'its recovery')
        assert len(read_run(path).times) > 100
        # SIGTERM ends the recording regularly.
        grown = logs / 'second.mcap'
        tester.until(lambda: grown.exists() and grown.stat().st_size > 50_000, 'the second log')
        second.signal(signal.SIGTERM)
        assert second.wait() == 0
        assert recover(grown) is None
        assert len(read_run(grown).times) > 100
