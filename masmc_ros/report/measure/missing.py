# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Descriptions of data that a log lacks, with the reason."""

from __future__ import annotations

from collections.abc import Iterator

from masmc_ros.log.read.gaps import gaps_in
from masmc_ros.log.read.reader import Run
from masmc_ros.loop.signals import PUBLISHED
from masmc_ros.messages.cdr_layout import NANOSECONDS
from masmc_ros.messages.topics import (
    ARM_VELOCITY_TOPIC,
    CMD_VEL_TOPIC,
    COMMAND_TOPIC,
    REFERENCE_TOPIC,
    STATE_TOPIC,
    telemetry_topic,
)
from masmc_ros.report.measure.parameters import run_robot
from masmc_ros.report.measure.tracking import Tracking
from masmc_ros.robot.declaration import symbols_of
import numpy as np


def missing(run: Run, tracked: Tracking) -> list[str]:
    """Return a sentence for each part that a report lacks, because the log lacks its data."""
    return list(_sentences(run, tracked))


def unread(run: Run) -> list[str]:
    """Return a sentence about renamed topics, if the log lacks topics of a run."""
    is_known = {
        REFERENCE_TOPIC: run.reference is not None,
        **{
            telemetry_topic(signal.label): signal.name in run.telemetry
            for signal in PUBLISHED
            if not signal.of_torques
        },
    }
    if not len(run.torque):
        is_known[CMD_VEL_TOPIC] = bool(len(run.cmd_vel))
        is_known[ARM_VELOCITY_TOPIC] = bool(len(run.arm_rates))
        if not run.commands_rates:
            is_known[COMMAND_TOPIC] = False
    lacking = [name for name, known in is_known.items() if not known]
    if not (lacking and run.elsewhere):
        return []
    states = next(name for name in run.topics if f'/{name}'.endswith(f'/{STATE_TOPIC}'))
    return [
        f'Not read are {", ".join(run.elsewhere)}: the topics of a run are identified by their'
        f' names; the missing ones would be {", ".join(lacking)} next to {states}.'
    ]


def _sentences(run: Run, tracked: Tracking) -> Iterator[str]:
    yield from unread(run)
    gaps = gaps_in(np.rint(run.times * NANOSECONDS))
    if gaps.count:
        yield f'{STATE_TOPIC}: {gaps.text()}, by its stamps.'
    points = symbols_of(run.mechanism.points)
    if not run.parameters:
        yield 'No parameters: law, gains and robot are not known.'
    elif run_robot(run) is None:
        yield f'No parameters of the robot: {points} cannot be computed from the joints.'
    if run.reference is None:
        yield f'No {REFERENCE_TOPIC}: the reference follows from the errors only.'
    if 'error' not in run.telemetry and len(tracked.error):
        yield (
            f'No {telemetry_topic("tracking_error")}: the errors are computed from the states and'
            ' the reference.'
        )
    elif not len(tracked.error):
        yield (
            f'No errors: neither {telemetry_topic("tracking_error")}, nor both the reference and'
            ' the parameters of the robot.'
        )
    if tracked.actual is None:
        yield f'No positions of {points}: the path is that of the {run.mechanism.origin}.'
    if run.commands_rates:
        for topic, rates in ((CMD_VEL_TOPIC, run.cmd_vel), (ARM_VELOCITY_TOPIC, run.arm_rates)):
            if not len(rates):
                yield f'No {topic}.'
    elif not len(run.torque):
        yield f'No {COMMAND_TOPIC}: the torques are those that the robot says were applied.'
    for signal in PUBLISHED:
        if signal.title and signal.name not in run.telemetry:
            yield f'No {telemetry_topic(signal.label)}.'
