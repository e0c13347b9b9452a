# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Logs of random numbers for tests of log readers and writers."""

from pathlib import Path
from typing import NamedTuple

from masmc_ros.log.bag import Qos
from masmc_ros.log.codec import ChannelRows
from masmc_ros.log.write.writer import LogWriter
from masmc_ros.messages.cdr_layout import Messages
from masmc_ros.messages.commands import EFFORT
from masmc_ros.messages.joint_state import joint_state_layout
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.messages.telemetry import telemetry_messages
from masmc_ros.messages.topics import (
    COMMAND_TOPIC,
    REFERENCE_TOPIC,
    STATE_TOPIC,
    TELEMETRY,
    telemetry_topic,
)
import numpy as np
from numpy.typing import NDArray

STATE = 'sensor_msgs/msg/JointState'
ARRAY = 'std_msgs/msg/Float64MultiArray'


class Numbers(NamedTuple):
    """A run of n ticks."""

    stamps: NDArray[np.int64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    effort: NDArray[np.float64]
    torque: NDArray[np.float64]
    telemetry: dict[str, NDArray[np.float64]]
    reference: NDArray[np.float64]

    def states(self) -> Messages:
        """Return the joint states as serialised messages."""
        return joint_state_layout().messages(
            header_stamp=self.stamps,
            position=self.position,
            velocity=self.velocity,
            effort=self.effort,
        )


def numbers(count: int, period_ns: int = 1_000_000, start: int = 0) -> Numbers:
    """Return `count` ticks of random numbers."""
    random = np.random.default_rng(count)
    effort = random.standard_normal((count, 7))
    effort[:, :3] = 0.0
    return Numbers(
        start + period_ns * np.arange(count),
        random.standard_normal((count, 7)),
        random.standard_normal((count, 7)),
        effort,
        random.standard_normal((count, 4)),
        {label: random.standard_normal((count, size)) for label, size in TELEMETRY.items()},
        random.standard_normal((count, 12)),
    )


def part(run: Numbers, first: int, end: int) -> Numbers:
    """Return the ticks `first` <= k < `end` of a run."""
    *arrays, telemetry, reference = run
    return Numbers(
        *(array[first:end] for array in arrays),
        {label: values[first:end] for label, values in telemetry.items()},
        reference[first:end],
    )


def write_run(
    path: Path, run: Numbers, namespace: str = '/', *, window: int = 50, everything: bool = True
) -> None:
    """Write a run as `masmc simulate` does, with the reference in windows of `window` samples."""
    with LogWriter(path) as log:
        write_numbers(log, run, namespace, window=window, everything=everything)
        log.metadata('origin', {'law': 'smc'})
        log.attach('paper.yaml', 'application/yaml', b'plant: {}')


def write_numbers(
    log: LogWriter, run: Numbers, namespace: str = '/', *, window: int, everything: bool
) -> None:
    """Write a run into an open log."""
    states = log.channel(namespace + STATE_TOPIC, STATE, Qos(durability='transient_local'))
    sources = [ChannelRows(states, run.stamps, run.states())]
    if everything:
        commands = log.channel(namespace + COMMAND_TOPIC, ARRAY, Qos())
        for group in EFFORT.messages(run.stamps, run.torque):
            sources.append(ChannelRows(commands, run.stamps[group.indices], group.messages))
        for label, values in run.telemetry.items():
            channel = log.channel(namespace + telemetry_topic(label), ARRAY, Qos())
            rows = telemetry_messages(label, run.stamps, values)
            sources.append(ChannelRows(channel, run.stamps, rows))
        period = float(run.stamps[1] - run.stamps[0]) / 1e9
        channel = log.channel(namespace + REFERENCE_TOPIC, ARRAY, Qos())
        for first in range(0, len(run.stamps), window):
            stamp = int(run.stamps[first])
            samples = run.reference[first:first + window].reshape(-1, 3, 4)
            log.write(channel, stamp, ReferenceWindow(stamp, period, samples).to_bytes())
    log.write_rows(sources)
