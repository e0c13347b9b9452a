# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Reads a run back out of its log, whoever recorded it."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from masmc_ros.control.stamp_order import in_time, state_timeout
from masmc_ros.errors import InputError
from masmc_ros.log.bag import METADATA_FILE
from masmc_ros.log.read.commanded_rates import twists
from masmc_ros.log.read.contents import LogContents, Topic
from masmc_ros.log.read.decode import (
    commands,
    decode,
    decode_placed,
    decode_references,
    joint_states,
    Series,
    telemetry,
    Topical,
)
from masmc_ros.log.read.parameter_history import parameter_history
from masmc_ros.log.read.platform_pose import with_platform_pose
from masmc_ros.log.read.timeline import Beginning, last_pass, sample_reference, Stamps
from masmc_ros.loop.signals import CONTACT, Signal, TOLD
from masmc_ros.messages.commands import ARM_VELOCITY, EFFORT
from masmc_ros.messages.names import (
    ARM_VELOCITY_TOPIC,
    CMD_VEL_TOPIC,
    COMMAND_TOPIC,
    CONTACT_LABEL,
    CONTACT_TOPIC,
    DESCRIPTION_TOPIC,
    JOINTS,
    REFERENCE_TOPIC,
    STATE_TOPIC,
    telemetry_topic,
)
from masmc_ros.messages.parameter_record import ParameterRecord
from masmc_ros.messages.telemetry import telemetry_count
from masmc_ros.messages.text import text_of
from masmc_ros.messages.topics import FLOAT_ARRAY, ODOMETRY, TOPICS, TWIST, TWIST_STAMPED
from masmc_ros.numerics.field import ONE
from masmc_ros.robot.declaration import Mechanism, Quantity, URDF
from masmc_ros.robot.names import joint_names_of, JOINT_NAMES_PARAMETER, joint_names_parameter
from masmc_ros.robot.registry import chosen, DEFAULT, load
from masmc_ros.robot.registry import NAME as MECHANISM
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_REAL_TIME = 'realtime'
"""Pacing by the wall clock, in which states may come late."""

_STATE_TYPE = 'sensor_msgs/msg/JointState'

_TYPES = _STATE_TYPE, ODOMETRY, FLOAT_ARRAY, TWIST, TWIST_STAMPED
"""Of what a run is read from."""


@dataclass(frozen=True)
class Run:
    """
    One robot's run, N states long. Times are in s and ascend strictly.

    After a reset, only what the last pass wrote is kept. In real time a state that comes after
    newer ones is no reset: the controller leaves it out, and so does this.

    Attributes
    ----------
    path
        the log.
    times
        (N) stamps of the states.
    position
        (N, positions) of the base, then of the joints, m and rad.
    velocity
        (N, positions) their rates in m/s and rad/s, NaN where they were not measured.
    applied_effort
        (N, joints) torques applied over the interval that ends with the state, N m.
    torque
        (M, joints) commanded torques in N m, at the stamps of the states that they answer;
        M = 0 where rates were commanded.
    cmd_vel
        (P, twist) commanded velocities of the base in m/s and rad/s, at the stamps of the states
        that they answer, or else of the log; P = 0 where torques were commanded.
    arm_rates
        (Q, own_rates) commanded rates of the other joints in rad/s, at the stamps of the states
        that they answer; Q = 0 likewise.
    reference
        (N, 3 axes) position (m), velocity (m/s) and acceleration (m/s^2) of the
        task axes at the time of each state; None where the log has none, NaN before it
        begins.
    telemetry : mapping
        what the controller told of its ticks, by the names of signals, where the log has it.
    parameters : mapping
        with which every node began.
    changes
        of parameters while the robot ran, and events, in the order of the log.
    restarted
        nodes that were started again while the robot ran.
    mechanism
        what kind of robot it was.
    joint_names
        (positions) by which the states are read, in the order of `position`.
    topics
        number of messages of every topic of the log.
    elsewhere
        topics of types that a run has, under names that it does not have.
    contact
        (K, contacts x CONTACT) what the plant told of each contact with the ground; None where
        the log has none.
    metadata
        records of each name, in the order of the log.
    attachments
        files by name.

    """

    path: Path
    times: Floats
    position: Floats
    velocity: Floats
    applied_effort: Floats
    torque: Series
    cmd_vel: Series
    arm_rates: Series
    reference: Floats | None
    telemetry: dict[str, Series]
    parameters: dict[str, dict[str, Any]]
    changes: tuple[ParameterRecord, ...]
    restarted: tuple[str, ...]
    topics: dict[str, int]
    metadata: dict[str, list[dict[str, str]]]
    attachments: dict[str, bytes]
    mechanism: Mechanism = DEFAULT
    joint_names: tuple[str, ...] = JOINTS
    elsewhere: tuple[str, ...] = ()
    contact: Series | None = None

    @property
    def commands_rates(self) -> bool:
        """Whether rates were commanded, and no torques."""
        return not len(self.torque) and bool(len(self.cmd_vel) or len(self.arm_rates))

    @property
    def contact_names(self) -> tuple[str, ...]:
        """Return the joints of what touches the ground, or numbers where no joint moves it."""
        count = 0 if self.contact is None else self.contact.values.shape[1] // len(CONTACT)
        base, twist = len(self.mechanism.base), len(self.mechanism.twist)
        if count == twist:
            return self.joint_names[base:base + twist]
        return tuple(f'contact_{number}' for number in range(1, count + 1))

    def components(self, signal: Signal) -> tuple[Quantity, ...]:
        """Return what each component of a signal belongs to: an axis, a joint, a parameter."""
        mechanism = self.mechanism
        positions = tuple(
            Quantity(name, each.unit, each.label)
            for name, each in zip(self.joint_names, mechanism.positions, strict=True)
        )
        return {
            'axes': mechanism.axes,
            'joints': positions[len(mechanism.base):],
            'positions': positions,
            'parameters': mechanism.theta,
            ONE: (Quantity('', ''),),
        }[str(signal.size)]


def is_log(path: Path) -> bool:
    """Tell by its name whether a path is a log, or by what is in it for a folder."""
    if path.is_dir():
        return (path / METADATA_FILE).exists() or any(path.glob('*.mcap'))
    return path.suffix == '.mcap'


def read_run(path: str | Path) -> Run:
    """
    Read the log of one robot, in whatever namespace it ran.

    Parameters
    ----------
    path
        an MCAP file that this package, `ros2 bag record` or another tool wrote, or the
        folder of a recording in several.

    Raises
    ------
    InputError
        for a file that is missing, no MCAP file, damaged, incomplete, or without
        the states of exactly one robot.

    """
    # Who reads no log need not have what reads MCAP.
    from masmc_ros.log.read.scan import scan

    path = Path(path)
    records = scan(path)
    try:
        return _run(path, records)
    except InputError as error:
        raise InputError(f'{path}: {error}') from error


def _run(path: Path, records: LogContents) -> Run:
    states_topic = _only_states(records)
    namespace = states_topic.name.removesuffix(STATE_TOPIC)

    def series(name: str, how: Topical) -> Series | None:
        topic = _topic(records, namespace + name, FLOAT_ARRAY)
        # A topic on which strangers alone have sent is as one that nobody has sent on.
        with suppress(InputError):
            return None if topic is None else decode(topic, how)
        return None

    given = parameter_history(records, namespace, Beginning()).start
    mechanism, names = _robot(records, namespace, given)
    base = len(mechanism.base)
    rated = names[base + len(mechanism.twist):]
    every_state, orders, odometry = _states(records, namespace, states_topic, mechanism, names)
    taken = in_time(every_state.stamps, _gap_ns(given))
    begun = Beginning(orders[taken], every_state.stamps[taken])
    kept = taken[last_pass(every_state.stamps[taken])]
    states = Series(every_state.stamps[kept], every_state.values[kept])
    if odometry is not None:
        states = with_platform_pose(states, odometry)
    history = parameter_history(records, namespace, begun)
    _describe(history.start, records, namespace)
    position, velocity, effort = np.hsplit(states.values, 3)
    efforts = series(COMMAND_TOPIC, commands(EFFORT.named(names[base:])))
    every_arm_rate = series(ARM_VELOCITY_TOPIC, commands(ARM_VELOCITY.named(rated)))
    cmd_vel_topic = _topic(records, namespace + CMD_VEL_TOPIC, TWIST, TWIST_STAMPED)
    places = [each.place for each in mechanism.twist]
    every_twist = (
        None if cmd_vel_topic is None else twists(cmd_vel_topic, every_arm_rate, places)
    )
    references = _topic(records, namespace + REFERENCE_TOPIC, FLOAT_ARRAY)
    told = {}
    for signal in TOLD:
        count = signal.count(mechanism.sizes)
        each = series(telemetry_topic(signal.label), telemetry(signal.label, count))
        if each is not None:
            told[signal.name] = _last_pass(each, count)
    return Run(
        path=path,
        times=states.times,
        position=position,
        velocity=velocity,
        applied_effort=effort[:, base:],
        torque=_last_pass(efforts, len(names) - base),
        cmd_vel=_last_pass(every_twist, len(places)),
        arm_rates=_last_pass(every_arm_rate, len(rated)),
        reference=(
            None
            if references is None
            else sample_reference(
                decode_references(references, len(mechanism.axes)),
                states.stamps,
                len(mechanism.axes),
            )
        ),
        telemetry=told,
        parameters=history.start,
        changes=history.changes,
        restarted=history.restarted,
        topics={topic.name: len(topic.messages) for topic in records.topics.values()},
        metadata=records.metadata,
        attachments=records.attachments,
        mechanism=mechanism,
        joint_names=names,
        elsewhere=tuple(_elsewhere(records, namespace, *_TYPES)),
        contact=_contact(_topic(records, namespace + CONTACT_TOPIC, FLOAT_ARRAY)),
    )


def _contact(topic: Topic | None) -> Series | None:
    """Return what the last pass tells of contacts with the ground, however many they are."""
    if topic is None:
        return None
    count = telemetry_count(CONTACT_LABEL, len(topic.messages[0]))
    if count <= 0 or count % len(CONTACT):
        return None
    with suppress(InputError):
        return _last_pass(decode(topic, telemetry(CONTACT_LABEL, count)), count)
    return None


def _gap_ns(start: Mapping[str, dict[str, Any]]) -> int | None:
    """Return how far states may be apart in real time, in ns; None: an older one is a reset."""
    controller = start.get('controller', {})
    if _REAL_TIME not in (each.get('pacing') for each in start.values()):
        return None
    try:
        return round(1e9 * state_timeout(controller))
    except (KeyError, TypeError, ValueError, OverflowError):
        return None


def _robot(
    records: LogContents, namespace: str, start: dict[str, dict[str, Any]]
) -> tuple[Mechanism, tuple[str, ...]]:
    """Return the kind of robot and its joints, as the plant or else the controller was told."""
    _describe(start, records, namespace)
    told = [start.get(node, {}) for node in ('plant', 'controller')]
    kinds = (values[MECHANISM] for values in told if isinstance(values.get(MECHANISM), str))
    trees = (values for values in told if isinstance(values.get(URDF), str) and values[URDF])
    tree = next(trees, None)
    mechanism = load(next(kinds, DEFAULT.name)) if tree is None else chosen(tree)
    for values in told:
        names = values.get(JOINT_NAMES_PARAMETER)
        if names is not None:
            checked: Any = joint_names_parameter(mechanism).check(names)
            return mechanism, joint_names_of(mechanism, checked)
    return mechanism, joint_names_of(mechanism)


def _describe(
    start: Mapping[str, dict[str, Any]], records: LogContents, namespace: str
) -> None:
    """Put the description that was published in place of the name of its file."""
    topic = records.topics.get(namespace + DESCRIPTION_TOPIC)
    # With a prefix before its frames it is no longer what the parameters speak of.
    if topic is None or not topic.messages or start.get('plant', {}).get('frame_prefix'):
        return
    for values in start.values():
        if isinstance(values.get(URDF), str) and values[URDF]:
            with suppress(InputError):
                values[URDF] = text_of(topic.messages[0])


def _elsewhere(records: LogContents, namespace: str, *type_names: str) -> list[str]:
    """Return the topics of some types that are none of the robot's, and have messages."""
    ours = {namespace + topic.name for topic in TOPICS}
    return sorted(
        topic.name
        for topic in records.topics.values()
        if topic.messages
        and topic.schema is not None
        and topic.schema.name in type_names
        and topic.name not in ours
    )


def _hint(topics: list[str], name: str) -> str:
    """Return what to add to a line about a topic that is missing."""
    if not topics:
        return ''
    return f'; {" and ".join(topics)}, of that type, would have to be called {name}'


def _only_states(records: LogContents) -> Topic:
    """Return the topic of the joint states, of which there must be one."""
    found = [
        topic
        for topic in records.topics.values()
        if f'/{topic.name}'.endswith(f'/{STATE_TOPIC}') and topic.messages
    ]
    if not found:
        raise InputError(
            f'no {STATE_TOPIC} in it; a run has at least these, recorded with the other topics'
            f' of the robot{_hint(_elsewhere(records, "/", _STATE_TYPE), STATE_TOPIC)}'
        )
    if len(found) > 1:
        names = ', '.join(sorted(topic.name for topic in found))
        raise InputError(f'states of several robots ({names}); a run is the log of one robot')
    topic = _topic(records, found[0].name, _STATE_TYPE)
    assert topic is not None
    return topic


def _states(
    records: LogContents,
    namespace: str,
    topic: Topic,
    mechanism: Mechanism,
    names: tuple[str, ...],
) -> tuple[Series, Stamps, Topic | None]:
    """Return states, their places in the log, and odometry where they lack the base's joints."""
    try:
        return *decode_placed(topic, joint_states(names)), None
    except InputError as error:
        if not mechanism.is_planar:
            raise
        odometry = _topic(records, namespace + 'odom', ODOMETRY)
        if odometry is None:
            hint = _hint(_elsewhere(records, namespace, ODOMETRY), f'{namespace}odom')
            raise InputError(f'{error}{hint}') from None
        driven = names[len(mechanism.base):]
        return *decode_placed(topic, joint_states(names, driven)), odometry


def _topic(records: LogContents, name: str, *type_names: str) -> Topic | None:
    """Return a topic that has messages, None where there is none such."""
    topic = records.topics.get(name)
    if topic is None or not topic.messages:
        return None
    found = topic.schema.name if topic.schema else 'no type'
    if found not in type_names:
        raise InputError(f'{name} is {found}; it takes {" or ".join(type_names)}')
    return topic


def _last_pass(series: Series | None, width: int) -> Series:
    """Return what still holds at the end; nothing, `width` wide, of a topic that is missing."""
    if series is None:
        return Series(np.zeros(0, np.int64), np.zeros((0, width)))
    kept = last_pass(series.stamps)
    return Series(series.stamps[kept], series.values[kept])
