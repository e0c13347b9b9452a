# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Findings of a report in sentences: its result, and the data that logs lack, with the reason."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import math

from masmc_ros.log.read.gaps import gaps_in
from masmc_ros.log.read.reader import Run
from masmc_ros.loop.signals import PUBLISHED
from masmc_ros.messages import topics
from masmc_ros.messages.cdr_layout import NANOSECONDS
from masmc_ros.report.measure.metrics import Metrics
from masmc_ros.report.measure.parameters import run_robot
from masmc_ros.report.measure.table import DIGITS, number, points_of
from masmc_ros.report.measure.tracking import SMALL, Tracking
from masmc_ros.robot.declaration import listed, Point, symbols_of
import numpy as np

_EQUAL = 1.05
"""Ratio of two errors up to which runs track equally well."""

_PERCENT = 100.0


def verdict(rows: Mapping[str, Metrics]) -> str:
    """
    Return a sentence about the errors of the runs, by their names.

    Several runs are compared by the RMS error of their first common point, and by their torque
    variation. Empty if no run has errors.
    """
    if len(rows) == 1:
        ((name, row),) = rows.items()
        return _alone(name, row)
    for point in points_of(rows.values()):
        ranked = sorted(
            ((_rms(row, point), name) for name, row in rows.items()), key=lambda pair: pair[0]
        )
        known = [(rms, name) for rms, name in ranked if math.isfinite(rms)]
        if len(known) > 1:
            return _compared(point, known, rows)
    return ''


def _alone(name: str, row: Metrics) -> str:
    errors = [
        f'{_small(reached.rms, point)} at the {_plain(point)}'
        for point, reached in row.points.items()
        if reached.rms is not None and math.isfinite(reached.rms)
    ]
    if not errors:
        return ''
    window = f'from {row.start:g} s to {row.end:g} s'
    return f'{name} tracks with an RMS error of {listed(errors)} {window}.'


def _compared(
    point: Point, known: list[tuple[float, str]], rows: Mapping[str, Metrics]
) -> str:
    (best, first), (second, following), *_ = known
    last, worst = known[-1]
    of_all = f'Of {len(rows)} runs, ' if len(rows) > 2 else ''
    sentence = f'{of_all}{first} tracks the {_plain(point)}'
    if len(known) > 2 and last <= _EQUAL * best:
        all_runs = 'all' if len(known) == len(rows) else f'the {len(known)} with errors'
        return (
            f'{of_all}{all_runs} track the {_plain(point)} equally well: '
            f'{_small(best, point)} ({first}) to {_small(last, point)} RMS.'
        )
    if second <= _EQUAL * best:
        if len(known) == 2:
            also = f'{first} and {following} track the {_plain(point)} equally well'
            return f'{also}: {_small(best, point)} and {_small(second, point)} RMS.'
        sentence += f' best ({_small(best, point)} RMS), as well as {following}'
    else:
        sentence += f' {_times(second, best)} times better than {following}'
        sentence += f' ({_small(best, point)} and {_small(second, point)} RMS)'
    if len(known) > 2:
        sentence += f' and {_times(last, best)} times better than {worst}'
    return f'{sentence}{_variation(rows[first], rows[following], following, len(known))}.'


def _variation(row: Metrics, other: Metrics, name: str, count: int) -> str:
    """Return the torque variation relative to that of another run; empty without both."""
    mine, theirs = row.torque_variation, other.torque_variation
    if mine is None or not theirs or not math.isfinite(mine) or not math.isfinite(theirs):
        return ''
    change = _PERCENT * (mine / theirs - 1.0)
    than = f' than {name}' if count > 2 else ''
    if abs(change) < 1.0:
        return f', at the same torque variation{f" as {name}" if count > 2 else ""}'
    if mine > 2.0 * theirs:
        return f', at {number(mine / theirs, DIGITS)} times the torque variation'
    return f', at {abs(change):.0f} % {"less" if change < 0.0 else "more"} torque variation{than}'


def _rms(row: Metrics, point: Point) -> float:
    """Return the RMS error of a point; infinity without it."""
    reached = row.points.get(point)
    return math.inf if reached is None or reached.rms is None else reached.rms


def _plain(point: Point) -> str:
    return point.title.removeprefix('the ')


def _small(value: float | None, point: Point) -> str:
    return f'{number((value or 0.0) * SMALL, DIGITS)} {point.small_unit}'


def _times(larger: float, smaller: float) -> str:
    """Return a ratio with two digits."""
    return number(larger / smaller, 2) if smaller > 0.0 else 'infinitely many'


def missing(run: Run, tracked: Tracking) -> list[str]:
    """Return a sentence for each part that a report lacks, because the log lacks its data."""
    return list(_sentences(run, tracked))


def unread(run: Run) -> list[str]:
    """Return a sentence about renamed topics, if the log lacks topics of a run."""
    is_known = {
        topics.REFERENCE_TOPIC: run.reference is not None,
        **{
            topics.telemetry_topic(signal.label): signal.name in run.telemetry
            for signal in PUBLISHED
            if not signal.of_torques
        },
    }
    if not len(run.torque):
        is_known[topics.CMD_VEL_TOPIC] = bool(len(run.cmd_vel))
        is_known[topics.ARM_VELOCITY_TOPIC] = bool(len(run.arm_rates))
        if not run.commands_rates:
            is_known[topics.COMMAND_TOPIC] = False
    lacking = [name for name, known in is_known.items() if not known]
    if not (lacking and run.elsewhere):
        return []
    states = next(name for name in run.topics if f'/{name}'.endswith(f'/{topics.STATE_TOPIC}'))
    return [
        f'Not read are {", ".join(run.elsewhere)}: the topics of a run are identified by their'
        f' names; the missing ones would be {", ".join(lacking)} next to {states}.'
    ]


def _sentences(run: Run, tracked: Tracking) -> Iterator[str]:
    yield from unread(run)
    gaps = gaps_in(np.rint(run.times * NANOSECONDS))
    if gaps.count:
        yield f'{topics.STATE_TOPIC}: {gaps.text()}, by its stamps.'
    points = symbols_of(run.mechanism.points)
    if not run.parameters:
        yield 'No parameters: law, gains and robot are not known.'
    elif run_robot(run) is None:
        yield f'No parameters of the robot: {points} cannot be computed from the joints.'
    if run.reference is None:
        yield f'No {topics.REFERENCE_TOPIC}: the reference follows from the errors only.'
    if 'error' not in run.telemetry and len(tracked.error):
        yield (
            f'No {topics.telemetry_topic("tracking_error")}: the errors are computed from the'
            ' states and the reference.'
        )
    elif not len(tracked.error):
        yield (
            f'No errors: neither {topics.telemetry_topic("tracking_error")}, nor both the'
            ' reference and the parameters of the robot.'
        )
    if tracked.actual is None:
        yield f'No positions of {points}: the path is that of the {run.mechanism.origin}.'
    if run.commands_rates:
        of_topics = {topics.CMD_VEL_TOPIC: run.cmd_vel, topics.ARM_VELOCITY_TOPIC: run.arm_rates}
        for topic, rates in of_topics.items():
            if not len(rates):
                yield f'No {topic}.'
    elif not len(run.torque):
        yield f'No {topics.COMMAND_TOPIC}: the torques are those that the robot says were applied.'
    for signal in PUBLISHED:
        if signal.title and signal.name not in run.telemetry:
            yield f'No {topics.telemetry_topic(signal.label)}.'
