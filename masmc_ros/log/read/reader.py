# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Reading of a run from its log, which any program may have recorded."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import mode
from typing import cast, NoReturn, TYPE_CHECKING

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.jit.field import ONE
from masmc_ros.law.command_interface import COMMAND_INTERFACE, COMMAND_INTERFACES, HYBRID
from masmc_ros.log.bag import METADATA_FILE
from masmc_ros.log.read import decode
from masmc_ros.log.read.decode import LogContents, NO_TIME, Topic
from masmc_ros.log.read.parameter_history import parameter_history
from masmc_ros.log.read.platform_motion import twists, with_platform_pose
from masmc_ros.log.read.timeline import (
    align_log_times,
    last_pass_in_order,
    PassStart,
    sample_reference,
    sort_by_log_time,
)
from masmc_ros.loop.signals import CONTACT, PUBLISHED, Signal
from masmc_ros.loop.timing import PACING
from masmc_ros.messages import topics as message_names
from masmc_ros.messages.cdr_layout import NANOSECONDS
from masmc_ros.messages.commands import ARM_VELOCITY, EFFORT
from masmc_ros.messages.message import text_of
from masmc_ros.messages.parameter_record import ParameterRecord
from masmc_ros.messages.stamps import in_time, state_timeout
from masmc_ros.messages.telemetry import telemetry_count
from masmc_ros.messages.topics import FLOAT_ARRAY, ODOMETRY, STRING, TOPICS, TWIST, TWIST_STAMPED
from masmc_ros.params.declaration import MutableValues, Values
from masmc_ros.robot.declaration import Mechanism, Quantity, URDF
from masmc_ros.robot.mechanisms import (
    DEFAULT,
    joint_names_of,
    JOINT_NAMES_PARAMETER,
    joint_names_parameter,
    load,
    mechanism_from,
)
from masmc_ros.robot.mechanisms import NAME as MECHANISM
import numpy as np

_REAL_TIME = 'realtime'
"""Pacing in which states may be late."""

_STATE_TYPE = 'sensor_msgs/msg/JointState'

_TYPES = _STATE_TYPE, ODOMETRY, FLOAT_ARRAY, TWIST, TWIST_STAMPED
"""Types of the topics from which a run is read."""

_PLACES = {
    'applied': '; its name here is `applied_effort`',
    'rates': '; the commanded velocities are `cmd_vel` and `arm_rates`',
    **dict.fromkeys(
        ('true_position', 'true_velocity', 'age', 'singular'),
        '; no topic has it, a simulated run does',
    ),
}
"""Ends of messages about signals that only simulated runs have as attributes."""


@dataclass(frozen=True)
class Run:
    """
    Run of one robot with N states. Times are in s and ascend strictly.

    After a reset of the robot, only the last pass is kept. In real time a state that arrives
    after newer ones is not a reset: it is ignored, as in the controller.

    Attributes
    ----------
    path
        the log.
    times
        (N) stamps of the states.
    position
        (N, positions) of the base, then of the joints, m and rad.
    velocity
        (N, positions) velocities in m/s and rad/s, NaN if they were not measured.
    applied_effort
        (N, joints) torques applied over the interval that ends with the state, N·m.
    torque
        (M, joints) commanded torques in N·m, at the stamps of the answered states; M = 0 if
        velocities were commanded. Those of a base that follows velocities, and of void commands,
        are zero.
    cmd_vel
        (P, twist) commanded velocities of the base in m/s and rad/s, at the stamps of the
        answered states if these are known, else at log times; P = 0 if torques were commanded.
    arm_rates
        (Q, own_rates) commanded velocities of the other joints in rad/s, at the stamps of the
        answered states; Q = 0 if torques were commanded.
    reference
        (N, 3 axes) position (m), velocity (m/s) and acceleration (m/s^2) of the task axes at the
        time of each state; None if the log has none, NaN before its start.
    telemetry
        telemetry of the controller by the names of signals, as far as the log has it.
    parameters
        parameters at the start by node.
    changes
        changes of parameters and events while the robot ran, in the order of the log.
    restarted
        nodes that were restarted while the robot ran.
    topics
        number of messages of every topic of the log.
    metadata
        records of each name, in the order of the log.
    attachments
        files by name.
    mechanism
        kind of robot.
    joint_names
        (positions) names of the joints, in the order of `position`.
    elsewhere
        topics of types that a run has, under names that it does not have.
    contact
        (K, contacts x CONTACT) telemetry of each contact with the ground; None if the log has
        none.
    notes
        sentences about messages that are not used, and about clocks that differ.
    controller_states
        (time in s, `controller/state`): the state at the start, and each later one.

    """

    path: Path
    times: Array
    position: Array
    velocity: Array
    applied_effort: Array
    torque: decode.Series
    cmd_vel: decode.Series
    arm_rates: decode.Series
    reference: Array | None
    telemetry: dict[str, decode.Series]
    parameters: dict[str, MutableValues]
    changes: tuple[ParameterRecord, ...]
    restarted: tuple[str, ...]
    topics: dict[str, int]
    metadata: dict[str, list[dict[str, str]]]
    attachments: dict[str, bytes]
    mechanism: Mechanism = DEFAULT
    joint_names: tuple[str, ...] = message_names.JOINTS
    elsewhere: tuple[str, ...] = ()
    contact: decode.Series | None = None
    notes: tuple[str, ...] = ()
    controller_states: tuple[tuple[float, str], ...] = ()

    # Type checkers report unknown names themselves, unless they see this method.
    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> NoReturn:
            """Raise AttributeError, for a signal of simulated runs with its place in this run."""
            place = _PLACES.get(name, '')
            if any(signal.name == name for signal in PUBLISHED):
                place = f"; run.telemetry['{name}'] if the log has it"
            raise AttributeError(f'{name}: no attribute of a logged run{place}')

    @property
    def commands_rates(self) -> bool:
        """Whether velocities were commanded, and no torques."""
        return not len(self.torque) and bool(len(self.cmd_vel) or len(self.arm_rates))

    @property
    def is_hybrid(self) -> bool:
        """Return True if velocities of the base and torques of the arm were commanded."""
        return _is_hybrid(self.parameters)

    @property
    def contact_names(self) -> tuple[str, ...]:
        """Return the joints of the bodies in contact, or numbers if these have no joints."""
        count = 0 if self.contact is None else self.contact.values.shape[1] // len(CONTACT)
        base, twist = len(self.mechanism.base), len(self.mechanism.twist)
        if count == twist:
            return self.joint_names[base:base + twist]
        return tuple(f'contact_{number}' for number in range(1, count + 1))

    def components(self, signal: Signal) -> tuple[Quantity, ...]:
        """Return the axis, joint or parameter of each component of a signal."""
        mechanism = self.mechanism
        positions = tuple(
            Quantity(name, quantity.unit, quantity.label)
            for name, quantity in zip(self.joint_names, mechanism.positions, strict=True)
        )
        return {
            'axes': mechanism.axes,
            'joints': positions[len(mechanism.base):],
            'positions': positions,
            'parameters': mechanism.theta,
            ONE: (Quantity('', ''),),
        }[str(signal.size)]


def is_log(path: Path) -> bool:
    """Return True if a file has the name of a log, or if a folder contains a recording."""
    if path.is_dir():
        return (path / METADATA_FILE).exists() or any(path.glob('*.mcap*'))
    return path.name.endswith(('.mcap', '.mcap.zstd'))


def read_run(path: str | Path) -> Run:
    """
    Read the log of one robot in any namespace.

    Parameters
    ----------
    path
        MCAP file of this package, of `ros2 bag record` or of another program, or folder of a
        recording in parts.

    Raises
    ------
    InputError
        if a file is missing, no MCAP file, damaged or incomplete, or if the log does not have
        the states of exactly one robot.

    """
    # Imported here: commands that read no log need no MCAP libraries.
    from masmc_ros.log.read.scan import scan

    path = Path(path)
    contents = scan(path)
    try:
        return _run(path, contents)
    except InputError as error:
        raise InputError(f'{path}: {error}') from error


def _run(path: Path, contents: LogContents) -> Run:
    states_topic = _only_states(contents)
    namespace = states_topic.name.removesuffix(message_names.STATE_TOPIC)
    sort_by_log_time(contents, states_topic)

    def series(name: str, kind: decode.MessageFormat) -> decode.Series | None:
        """Return None for a topic without messages that a receiver accepts."""
        topic = _topic(contents, namespace + name, FLOAT_ARRAY)
        with suppress(InputError):
            return None if topic is None else decode.decode_topic(topic, kind)
        return None

    start = parameter_history(contents, namespace, PassStart()).start
    mechanism, names = _robot(contents, namespace, start)
    base, twist_size, axes = len(mechanism.base), len(mechanism.twist), len(mechanism.axes)
    every_state, odometry = _states(contents, namespace, states_topic, mechanism, names)
    if not every_state.stamps.any() and len(every_state) > 1:
        raise InputError(
            f'{states_topic.name}: the stamps of all {len(every_state)} states are 0; expected'
            ' their times, which the node that publishes them must set in header.stamp'
        )
    taken = in_time(every_state.stamps, _gap_ns(start))
    assert every_state.orders is not None
    pass_start = PassStart(every_state.orders[taken], every_state.stamps[taken])
    kept = taken[last_pass_in_order(every_state.stamps[taken])]
    states = decode.Series(
        every_state.stamps[kept], every_state.values[kept], every_state.orders[kept]
    )
    notes = align_log_times(contents, states_topic, states)
    counts = {
        'that cannot be used': len(states_topic.messages) - len(every_state),
        'that arrived late': len(every_state) - len(taken),
        'before a reset or repeated': len(taken) - len(kept),
    }
    if odometry is not None:
        states = with_platform_pose(states, odometry, pass_start)
        counts['without a pose of the platform'] = len(kept) - len(states)
    notes += _left_out(states_topic, counts)
    history = parameter_history(contents, namespace, pass_start)
    _insert_description(history.start, contents, namespace)
    position, velocity, effort = np.hsplit(states.values, 3)
    driven, rated = EFFORT.named(names[base:]), ARM_VELOCITY.named(names[base + twist_size:])
    is_hybrid = _is_hybrid(start)
    by_torque = EFFORT.named(names[base + twist_size:]) if is_hybrid else driven
    efforts = series(message_names.COMMAND_TOPIC, decode.commands(by_torque))
    if efforts is not None and is_hybrid:
        efforts = replace(efforts, values=np.pad(efforts.values, ((0, 0), (twist_size, 0))))
    arm_rates = series(message_names.ARM_VELOCITY_TOPIC, decode.commands(rated))
    places = [component.place for component in mechanism.twist]
    topic = _topic(contents, namespace + message_names.CMD_VEL_TOPIC, TWIST, TWIST_STAMPED)
    twist = None if topic is None else twists(topic, arm_rates, places)
    topic = _topic(contents, namespace + message_names.REFERENCE_TOPIC, FLOAT_ARRAY)
    reference = None
    if topic is not None:
        reference = sample_reference(decode.decode_references(topic, axes), states.stamps, axes)
    contact = _topic(contents, namespace + message_names.CONTACT_TOPIC, FLOAT_ARRAY)
    signals = {}
    torque = _last_pass(efforts, len(names) - base, pass_start)
    cmd_vel = _last_pass(twist, twist_size, pass_start)
    rates = _last_pass(arm_rates, len(rated.joints), pass_start)
    for name, decoded, used in (
        (message_names.COMMAND_TOPIC, efforts, torque),
        (message_names.CMD_VEL_TOPIC, twist, cmd_vel),
        (message_names.ARM_VELOCITY_TOPIC, arm_rates, rates),
    ):
        topic = contents.topics.get(namespace + name)
        if topic is not None and topic.messages:
            usable = 0 if decoded is None else len(decoded)
            notes += _left_out(topic, {
                'that cannot be used': len(topic.messages) - usable,
                'before a reset or repeated': usable - len(used),
            })
    for signal in PUBLISHED:
        count = signal.count(mechanism.sizes)
        name = message_names.telemetry_topic(signal.label)
        values = _last_pass(series(name, decode.telemetry(signal.label, count)), count, pass_start)
        if len(values):
            signals[signal.name] = values
    return Run(
        path=path,
        times=states.times,
        position=position,
        velocity=velocity,
        applied_effort=effort[:, base:],
        torque=torque,
        cmd_vel=cmd_vel,
        arm_rates=rates,
        reference=reference,
        telemetry=signals,
        parameters=history.start,
        changes=history.changes,
        restarted=history.restarted,
        topics={topic.name: len(topic.messages) for topic in contents.topics.values()},
        metadata=contents.metadata,
        attachments=contents.attachments,
        mechanism=mechanism,
        joint_names=names,
        elsewhere=tuple(_elsewhere(contents, namespace, *_TYPES)),
        contact=_contact(contact, pass_start),
        notes=tuple(notes),
        controller_states=_controller_states(
            contents, namespace, pass_start, float(states.times[0])
        ),
    )


def _controller_states(
    contents: LogContents, namespace: str, pass_start: PassStart, start: float
) -> tuple[tuple[float, str], ...]:
    """Return times in s and texts: the state at the start of the pass, and later ones."""
    topic = contents.topics.get(namespace + message_names.CONTROLLER_STATE_TOPIC)
    states: list[tuple[float, str]] = []
    if topic is None or _type_name(topic) != STRING:
        return ()
    for order, time, raw in zip(topic.orders, topic.log_times, topic.messages, strict=True):
        with suppress(InputError):
            text = text_of(raw)
            if not pass_start.is_over(order):
                states = [(start, text)]
            elif time != NO_TIME:
                states.append((time / NANOSECONDS, text))
    return tuple(states)


def _left_out(topic: Topic, counts: Mapping[str, int]) -> list[str]:
    """Return a sentence about the messages of a topic that are not used, by their reasons."""
    parts = [f'{count} {reason}' for reason, count in counts.items() if count]
    total = len(topic.messages)
    return [f'{topic.name}: {" and ".join(parts)}, of {total} messages.'] if parts else []


def _is_hybrid(parameters: Mapping[str, Values]) -> bool:
    interface = parameters.get('controller', {}).get(COMMAND_INTERFACE.name)
    return interface == COMMAND_INTERFACES[HYBRID]


def _contact(topic: Topic | None, pass_start: PassStart) -> decode.Series | None:
    """Return the last pass of contacts with the ground, for any number of contacts."""
    label = message_names.CONTACT_LABEL
    # The size of most messages: one may be of a third-party node.
    count = 0 if topic is None else telemetry_count(label, mode(map(len, topic.messages)))
    if topic is not None and count > 0 and not count % len(CONTACT):
        with suppress(InputError):
            series = decode.decode_topic(topic, decode.telemetry(label, count))
            kept = _last_pass(series, count, pass_start)
            return kept if len(kept) else None
    return None


def _gap_ns(start: Mapping[str, MutableValues]) -> int | None:
    """Return the maximum gap of states in real time, in ns; None: an older state is a reset."""
    if _REAL_TIME in (values.get(PACING.name) for values in start.values()):
        with suppress(KeyError, TypeError, ValueError, OverflowError):
            return round(1e9 * state_timeout(start.get('controller', {})))
    return None


def _robot(
    contents: LogContents, namespace: str, start: dict[str, MutableValues]
) -> tuple[Mechanism, tuple[str, ...]]:
    """Return the kind of robot and its joints by the plant's or else the controller's values."""
    _insert_description(start, contents, namespace)
    nodes = [start.get(node, {}) for node in ('plant', 'controller')]
    kinds = (values[MECHANISM] for values in nodes if isinstance(values.get(MECHANISM), str))
    trees = (values for values in nodes if isinstance(values.get(URDF), str) and values[URDF])
    tree = next(trees, None)
    mechanism = load(next(kinds, DEFAULT.name)) if tree is None else mechanism_from(tree)
    for values in nodes:
        names = values.get(JOINT_NAMES_PARAMETER)
        if names is not None:
            checked = joint_names_parameter(mechanism).check(names)
            return mechanism, joint_names_of(mechanism, cast(tuple[str, ...], checked))
    return mechanism, joint_names_of(mechanism)


def _insert_description(
    start: Mapping[str, MutableValues], contents: LogContents, namespace: str
) -> None:
    """Replace the name of a description file by the published description."""
    topic = contents.topics.get(namespace + message_names.DESCRIPTION_TOPIC)
    # With a prefix of its frames it differs from the file that the parameters name.
    if topic is None or not topic.messages or start.get('plant', {}).get('frame_prefix'):
        return
    for values in start.values():
        if isinstance(values.get(URDF), str) and values[URDF]:
            with suppress(InputError):
                values[URDF] = text_of(topic.messages[0])


def _elsewhere(contents: LogContents, namespace: str, *type_names: str) -> list[str]:
    """Return the topics of some types that have messages and are not the robot's."""
    ours = {namespace + topic.name for topic in TOPICS}
    return sorted(
        topic.name
        for topic in contents.topics.values()
        if topic.messages and topic.name not in ours and _type_name(topic) in type_names
    )


def _hint(topics: list[str], name: str) -> str:
    """Return an addition to the error message for a missing topic."""
    if not topics:
        return ''
    return f'; {" and ".join(topics)}, of that type, would have to be called {name}'


def _only_states(contents: LogContents) -> Topic:
    """Return the topic of the joint states; InputError unless there is exactly one."""
    state_topic = message_names.STATE_TOPIC
    topics = [
        topic
        for topic in contents.topics.values()
        if f'/{topic.name}'.endswith(f'/{state_topic}') and topic.messages
    ]
    if not topics:
        raise InputError(
            f'no {state_topic} in it; a run has at least these, recorded with the other topics'
            f' of the robot{_hint(_elsewhere(contents, "/", _STATE_TYPE), state_topic)}'
        )
    if len(topics) > 1:
        names = ', '.join(sorted(topic.name for topic in topics))
        raise InputError(f'states of several robots ({names}); a run is the log of one robot')
    _topic(contents, topics[0].name, _STATE_TYPE)
    return topics[0]


def _states(
    contents: LogContents, namespace: str, topic: Topic, mechanism: Mechanism,
    names: tuple[str, ...],
) -> tuple[decode.Series, Topic | None]:
    """Return the states, and the odometry if they lack the joints of a moving base."""
    driven = names[len(mechanism.base):]
    try:
        return decode.decode_topic(topic, decode.joint_states(names)), None
    except InputError as error:
        if not mechanism.twist:
            return decode.decode_topic(topic, decode.joint_states(names, driven)), None
        if not mechanism.is_planar:
            raise
        odometry = _topic(contents, namespace + 'odom', ODOMETRY)
        if odometry is None:
            hint = _hint(_elsewhere(contents, namespace, ODOMETRY), f'{namespace}odom')
            raise InputError(f'{error}{hint}') from None
        return decode.decode_topic(topic, decode.joint_states(names, driven)), odometry


def _topic(contents: LogContents, name: str, *type_names: str) -> Topic | None:
    """Return a topic with messages, or None; InputError if it has another type."""
    topic = contents.topics.get(name)
    if topic is None or not topic.messages:
        return None
    if _type_name(topic) not in type_names:
        raise InputError(f'{name} is {_type_name(topic)}; it takes {" or ".join(type_names)}')
    return topic


def _type_name(topic: Topic) -> str:
    return topic.schema.name if topic.schema else 'no type'


def _last_pass(
    series: decode.Series | None, width: int, pass_start: PassStart
) -> decode.Series:
    """Return the last pass of a series; an empty series of a width for a missing topic."""
    if series is None:
        return decode.Series(np.zeros(0, np.int64), np.zeros((0, width)))
    assert series.orders is not None
    kept = pass_start.kept(series.orders, series.stamps)
    is_void = None if series.is_void is None else series.is_void[kept]
    return decode.Series(series.stamps[kept], series.values[kept], is_void=is_void)
