# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Load of a recorder with 20 topics and 10 000 messages per second in total."""

from __future__ import annotations

from collections.abc import Iterator
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import time

from benchmarks.measure import compared, Measure
from masmc_ros.cli.node_processes import private_domain
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.nodes.middleware.ros_topics import publisher_qos
from masmc_ros.nodes.process.ending import child_environment
from mcap.reader import make_reader
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

TOPICS = 20
RATE = 500
"""Messages per second on every topic."""

SECONDS = 10.0
_BURSTS = 100
"""Number of bursts per second."""

_TIMEOUT = 30.0
_KIB_PER_MIB = 1024
_TICKS = os.sysconf('SC_CLK_TCK')


def measures(seconds: float = SECONDS) -> Iterator[Measure]:
    """Send and record messages, and yield numbers, load and memory."""
    with tempfile.TemporaryDirectory() as folder, private_domain() as domain:
        os.environ.update(domain)
        log = Path(folder) / 'run.mcap'
        names = [f'/bench/topic_{number}' for number in range(TOPICS)]
        recorder = subprocess.Popen(
            [
                *(sys.executable, '-m', 'masmc_ros.cli.main', 'run', 'recorder', '--ros-args'),
                *('-p', f'output:={log}', '-p', f'extra_topics:=[{", ".join(names)}]'),
            ],
            stderr=subprocess.DEVNULL,
            env={**os.environ, **child_environment()},
        )
        try:
            sent, wall, share, memory, grown = _send(names, seconds, recorder.pid)
            recorder.send_signal(signal.SIGINT)
            recorder.wait(_TIMEOUT)
        finally:
            recorder.kill()
            recorder.wait()
        recorded = _recorded(log)
        reference = Measure(f'messages sent, {TOPICS} topics', TOPICS * sent, '')
        yield reference
        yield compared('messages recorded', sum(recorded.values()), '', reference, 1.0)
        yield Measure('messages sent a second', TOPICS * sent / wall, '/s')
        yield Measure('the recorder, of a core', 100.0 * share, '%')
        yield Measure('the recorder, resident memory', memory, 'MiB')
        yield Measure('the same, since the first message', grown, 'MiB')
        yield Measure('file', log.stat().st_size / 1e6, 'MB')


def _send(
    names: list[str], seconds: float, recorder: int
) -> tuple[int, float, float, float, float]:
    """
    Send on all topics; return messages per topic, duration, and load of the recorder.

    The load consists of its share of a core, its memory in MiB, and the growth of this memory.
    """
    context = Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    node = Node('bench', context=context)
    try:
        publishers = [node.create_publisher(JointState, n, publisher_qos()) for n in names]
        limit = time.monotonic() + _TIMEOUT
        while not all(p.get_subscription_count() for p in publishers):
            if time.monotonic() > limit:
                raise RuntimeError('the recorder does not find the topics')
            time.sleep(0.05)
        before, start = _usage(recorder), time.monotonic()
        sent = _send_at_rate(publishers, start, seconds)
        wall = time.monotonic() - start
        after = _usage(recorder)
        for publisher in publishers:
            publisher.wait_for_all_acked()
        share = (after[0] - before[0]) / wall
        return sent, wall, share, after[1], after[1] - before[1]
    finally:
        node.destroy_node()
        context.try_shutdown()


def _send_at_rate(publishers: list[Publisher], start: float, seconds: float) -> int:
    message = JointStateCdr()
    sent, messages_per_burst = 0, RATE // _BURSTS
    for burst in range(round(seconds * _BURSTS)):
        time.sleep(max(0.0, start + burst / _BURSTS - time.monotonic()))
        for _ in range(messages_per_burst):
            message.set_stamp(sent * 10**9 // RATE)
            raw = message.to_bytes()
            for publisher in publishers:
                publisher.publish(raw)
            sent += 1
    return sent


def _usage(pid: int) -> tuple[float, float]:
    """Return the CPU time in s and the resident memory in MiB of a process."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    status = Path(f'/proc/{pid}/status').read_text()
    resident = next(line for line in status.splitlines() if line.startswith('VmRSS'))
    return (int(fields[11]) + int(fields[12])) / _TICKS, int(resident.split()[1]) / _KIB_PER_MIB


def _recorded(log: Path) -> dict[str, int]:
    with log.open('rb') as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    return {
        summary.channels[number].topic: count
        for number, count in summary.statistics.channel_message_counts.items()
        if summary.channels[number].topic.startswith('/bench/')
    }


if __name__ == '__main__':
    for measure in measures(*(float(argument) for argument in sys.argv[1:2])):
        print(measure)
