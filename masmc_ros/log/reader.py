# SPDX-License-Identifier: Apache-2.0
"""Reads a run back out of its log, whoever recorded it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from masmc_ros.errors import InputError
from masmc_ros.log.bag import METADATA_FILE
from masmc_ros.log.decode import (
    commands,
    decode,
    decode_references,
    joint_states,
    Series,
    telemetry,
    Topical,
)
from masmc_ros.log.layout import NANOSECONDS
from masmc_ros.log.names import (
    BASE_JOINTS,
    COMMAND_TOPIC,
    JOINTS,
    REFERENCE_TOPIC,
    STATE_TOPIC,
    TELEMETRY,
    telemetry_topic,
)
from masmc_ros.log.parameter_history import parameter_history
from masmc_ros.log.parameter_record import ParameterRecord
from masmc_ros.log.scan import Records, scan, Topic
from masmc_ros.log.timeline import last_pass, sample_reference

Floats = NDArray[np.float64]

_STATE_TYPE = 'sensor_msgs/msg/JointState'
_ARRAY_TYPE = 'std_msgs/msg/Float64MultiArray'


@dataclass(frozen=True)
class Run:
    """One robot's run, N states long. Times are in s and ascend strictly.

    After a reset, only what the last pass wrote is kept.

    Attributes:
        path: the log.
        times: (N) stamps of the states.
        position: (N, 7) x_O, y_O (m), yaw, right and left wheel, arm joints 1 and 2 (rad).
        velocity: (N, 7) their rates in m/s and rad/s.
        applied_effort: (N, 4) torques applied over the interval that ends with the state, N m.
        torque: (M, 4) commanded torques in N m.
        torque_times: (M) stamps of the states that they answer.
        reference: (N, 12) position (m), velocity (m/s) and acceleration (m/s^2) of x_E, y_E,
            x_F, y_F at the time of each state; None where the log has none, NaN before it
            begins.
        tracking_error: (K, 4) e in m; None where the log has none.
        tracking_error_times: (K) of these; None likewise.
        sliding_surface: (K, 4) s in m/s; None where the log has none.
        sliding_surface_times: (K) of these; None likewise.
        parameter_estimate: (K, 7) base inertial parameters used; None where the log has none.
        parameter_estimate_times: (K) of these; None likewise.
        parameters: with which every node began.
        changes: of parameters while the robot ran, in the order of the log.
        restarted: nodes that were started again while the robot ran.
        topics: number of messages of every topic of the log.
        metadata: records of each name, in the order of the log.
        attachments: files by name.
    """

    path: Path
    times: Floats
    position: Floats
    velocity: Floats
    applied_effort: Floats
    torque: Floats
    torque_times: Floats
    reference: Floats | None
    tracking_error: Floats | None
    tracking_error_times: Floats | None
    sliding_surface: Floats | None
    sliding_surface_times: Floats | None
    parameter_estimate: Floats | None
    parameter_estimate_times: Floats | None
    parameters: dict[str, dict[str, Any]]
    changes: tuple[ParameterRecord, ...]
    restarted: tuple[str, ...]
    topics: dict[str, int]
    metadata: dict[str, list[dict[str, str]]]
    attachments: dict[str, bytes]


def is_log(path: Path) -> bool:
    """Tell by its name whether a path is a log, or by what is in it for a folder."""
    if path.is_dir():
        return (path / METADATA_FILE).exists() or any(path.glob('*.mcap'))
    return path.suffix == '.mcap'


def read_run(path: str | Path) -> Run:
    """Read the log of one robot, in whatever namespace it ran.

    Args:
        path: an MCAP file that this package, `ros2 bag record` or another tool wrote, or the
            folder of a recording in several.

    Raises:
        InputError: for a file that is missing, no MCAP file, damaged, incomplete, or without
            the states of exactly one robot.
    """
    path = Path(path)
    records = scan(path)
    try:
        return _run(path, records)
    except InputError as error:
        raise InputError(f'{path}: {error}') from error


def _run(path: Path, records: Records) -> Run:
    states_topic = _only_states(records)
    namespace = states_topic.name.removesuffix(STATE_TOPIC)

    def series(name: str, how: Topical) -> Series | None:
        topic = _topic(records, namespace + name, _ARRAY_TYPE)
        return None if topic is None else _last_pass(decode(topic, how))

    every_state = decode(states_topic, joint_states())
    states = _last_pass(every_state)
    history = parameter_history(records, namespace, _begun(states_topic, every_state))
    position, velocity, effort = np.hsplit(states.values, 3)
    torques = series(COMMAND_TOPIC, commands())
    if torques is None:
        torques = Series(np.zeros(0, np.int64), np.zeros((0, len(JOINTS) - len(BASE_JOINTS))))
    references = _topic(records, namespace + REFERENCE_TOPIC, _ARRAY_TYPE)
    told = {
        label: series(telemetry_topic(label), telemetry(label, count))
        for label, count in TELEMETRY.items()
    }
    values = {label: None if each is None else each.values for label, each in told.items()}
    times = {label: None if each is None else _seconds(each) for label, each in told.items()}
    return Run(
        path=path,
        times=_seconds(states),
        position=position,
        velocity=velocity,
        applied_effort=effort[:, len(BASE_JOINTS) :],
        torque=torques.values,
        torque_times=_seconds(torques),
        reference=(
            None
            if references is None
            else sample_reference(decode_references(references), states.stamps)
        ),
        tracking_error=values['tracking_error'],
        tracking_error_times=times['tracking_error'],
        sliding_surface=values['sliding_surface'],
        sliding_surface_times=times['sliding_surface'],
        parameter_estimate=values['parameter_estimate'],
        parameter_estimate_times=times['parameter_estimate'],
        parameters=history.start,
        changes=history.changes,
        restarted=history.restarted,
        topics={topic.name: len(topic.messages) for topic in records.topics.values()},
        metadata=records.metadata,
        attachments=records.attachments,
    )


def _only_states(records: Records) -> Topic:
    """Return the topic of the joint states, of which there must be one."""
    found = [
        topic
        for topic in records.topics.values()
        if f'/{topic.name}'.endswith(f'/{STATE_TOPIC}') and topic.messages
    ]
    if not found:
        raise InputError(
            f'no {STATE_TOPIC} in it; a run has at least these, recorded with the other topics'
            ' of the robot'
        )
    if len(found) > 1:
        names = ', '.join(sorted(topic.name for topic in found))
        raise InputError(f'states of several robots ({names}); a run is the log of one robot')
    topic = _topic(records, found[0].name, _STATE_TYPE)
    assert topic is not None
    return topic


def _topic(records: Records, name: str, type_name: str) -> Topic | None:
    """Return a topic that has messages, None where there is none such."""
    topic = records.topics.get(name)
    if topic is None or not topic.messages:
        return None
    found = topic.schema.name if topic.schema else 'no type'
    if found != type_name:
        raise InputError(f'{name} is {found}; it takes {type_name}')
    return topic


def _last_pass(series: Series) -> Series:
    kept = last_pass(series.stamps)
    return Series(series.stamps[kept], series.values[kept])


def _begun(topic: Topic, states: Series) -> int:
    """Return the position in the log at which the last pass began; 0 for the only one."""
    back = np.flatnonzero(np.diff(states.stamps) < 0)
    return topic.orders[back[-1] + 1] if len(back) else 0


def _seconds(series: Series) -> Floats:
    return series.stamps / NANOSECONDS
