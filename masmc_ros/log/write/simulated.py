# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Computed runs in the log format of live ones: the same topics, stamps and bytes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import chain, pairwise
from pathlib import Path
from typing import Any, NamedTuple

from masmc_ros.log.mcap.chunks import ChannelRows
from masmc_ros.log.qos import Qos
from masmc_ros.log.traced_paths import ActualPath, DesiredPath
from masmc_ros.log.write.provenance import write_origin, write_parameters
from masmc_ros.log.write.writer import LogWriter
from masmc_ros.loop.signals import PUBLISHED
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.tick_block import Change, TickBlock
from masmc_ros.messages.commands import ARM_VELOCITY, EFFORT
from masmc_ros.messages.joint_state import joint_state_layout
from masmc_ros.messages.layout import Messages
from masmc_ros.messages.names import (
    ACTUAL_PATH_TOPIC,
    ARM_VELOCITY_TOPIC,
    CLOCK_TOPIC,
    CMD_VEL_TOPIC,
    COMMAND_TOPIC,
    CONTACT_LABEL,
    CONTACT_TOPIC,
    DESCRIPTION_TOPIC,
    DESIRED_PATH_TOPIC,
    REFERENCE_TOPIC,
    STATE_TOPIC,
    telemetry_topic,
)
from masmc_ros.messages.parameter_record import ParameterRecord
from masmc_ros.messages.platform_motion import (
    odometry_layout,
    time_layout,
    twist_layout,
    twist_stamped_layout,
)
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.messages.telemetry import telemetry_messages
from masmc_ros.messages.text import string_message
from masmc_ros.messages.topics import (
    PARAMETER_NODES,
    parameters_topic,
    TOPICS,
    TRANSFORMS,
    TWIST_STAMPED,
)
from masmc_ros.messages.transforms import transforms_messages
from masmc_ros.robot.joint_names import check_frame_prefix, joint_names
from masmc_ros.robot.robot import robot_description, robot_of
import numpy as np
from numpy.typing import NDArray

Values = Mapping[str, Any]


_Rows = tuple[str, NDArray[np.int64], Messages | NDArray[np.uint8]]
"""Topic, stamps (n) in ns, and its messages at these times."""


class _Block(NamedTuple):
    """Consecutive ticks: their signals, numbers (n), and stamps (n) in ns."""

    tick_block: TickBlock
    ticks: NDArray[np.int64]
    stamps: NDArray[np.int64]


class SimulationLog:
    """
    Writes the stretches of a computed run; a context manager.

    A run that ends by an exception leaves no file.
    """

    def __init__(
        self,
        path: Path,
        simulation: Simulation,
        values: Mapping[str, Values],
        files: Mapping[str, bytes],
    ) -> None:
        """Start a log at `path` of a run with these values by node, read from `files`."""
        self._simulation = simulation
        self._values = values
        self._changes: list[ParameterRecord] = []
        recorder, plant = values['recorder'], values['plant']
        robot = robot_of(plant)
        self._prefix = check_frame_prefix(plant['frame_prefix'])
        self._joints = joint_names(plant)
        self._files = {
            **files, 'robot.urdf': robot_description(plant, self._prefix).encode()
        }
        self._robot, self._mechanism = robot, robot.mechanism
        self._actual = ActualPath(simulation.timing, robot, self._prefix)
        self._desired = self._desired_path()
        self._writer = LogWriter(path, compression=recorder['compression'])
        controller = values['controller']
        self._is_stamped: bool = controller['enable_stamped_cmd_vel']
        self._command_prefix = check_frame_prefix(controller['frame_prefix'])
        types = {topic.name: topic.type_name for topic in TOPICS}
        latched = {topic.name for topic in TOPICS if topic.is_latched}
        if self._is_stamped:
            types[CMD_VEL_TOPIC] = TWIST_STAMPED
        rates = CMD_VEL_TOPIC, ARM_VELOCITY_TOPIC
        of_torques = (telemetry_topic(signal.label) for signal in PUBLISHED if signal.of_torques)
        torques = COMMAND_TOPIC, *of_torques
        for name in torques if simulation.controller.commands_rates else rates:
            del types[name]
        if not len(simulation.plant.contact):
            del types[CONTACT_TOPIC]
        self._channels = {
            name: self._writer.channel(
                f'/{name.lstrip("/")}',
                type_name,
                Qos(durability='transient_local' if name in latched else 'volatile'),
            )
            for name, type_name in types.items()
        }

    def _desired_path(self) -> bytes | None:
        values = self._values['trajectory']
        prefix = check_frame_prefix(values['frame_prefix'])
        desired = DesiredPath(self._simulation.timing, robot_of(values), prefix)
        return desired.whole(self._simulation.trajectory)

    def __enter__(self) -> SimulationLog:
        """Write what is known before the first tick."""
        self._writer.__enter__()
        write_origin(self._writer, self._files)
        for node in PARAMETER_NODES:
            self._tell(ParameterRecord(f'/{node}', 0, 0, dict(self._values[node]), ()))
        urdf = string_message(robot_description(self._values['plant'], self._prefix))
        self._writer.write(self._channels[DESCRIPTION_TOPIC], 0, urdf)
        if self._desired is not None:
            self._writer.write(self._channels[DESIRED_PATH_TOPIC], 0, self._desired)
        return self

    def __exit__(self, *exception: Any) -> None:
        """Complete the file, or leave none."""
        if exception[0] is None:
            parameters = {node: self._values[node] for node in PARAMETER_NODES}
            write_parameters(self._writer, parameters, self._changes)
        self._writer.__exit__(*exception)

    def write(self, tick_block: TickBlock) -> None:
        """Write all messages of consecutive ticks."""
        ticks = np.arange(tick_block.first, tick_block.first + len(tick_block))
        timing = self._simulation.timing
        stamps = np.array([timing.stamp(tick) for tick in ticks.tolist()], dtype=np.int64)
        for change in tick_block.changes:
            self._change(change)
        block = _Block(tick_block, ticks, stamps)
        # Messages of one time are written in this order.
        parts = (
            self._reference(block),
            self._motion(block),
            self._clock(block),
            self._transforms(block),
            self._path(block),
            self._states(block),
            self._commands(block),
            self._telemetry(block),
        )
        self._writer.write_rows(
            [
                ChannelRows(self._channels[topic], times, messages)
                for topic, times, messages in chain.from_iterable(parts)
            ]
        )

    @property
    def size(self) -> int:
        """Bytes written so far, as in `LogWriter`."""
        return self._writer.size

    def _change(self, change: Change) -> None:
        """Write a change of the controller at its first tick."""
        before = self._changes[-1].parameters if self._changes else self._values['controller']
        record = ParameterRecord(
            '/controller',
            change.tick,
            self._simulation.timing.stamp(change.tick),
            {**before, **change.values},
            tuple(change.values),
            change.event,
        )
        self._changes.append(record)
        self._tell(record)

    def _tell(self, record: ParameterRecord) -> None:
        channel = self._channels[parameters_topic(record.node.lstrip('/'))]
        message = string_message(record.to_text())
        self._writer.write(channel, record.stamp, message)

    def _states(self, block: _Block) -> Iterator[_Rows]:
        tick_block = block.tick_block
        effort = np.zeros_like(tick_block.position)
        effort[:, len(self._mechanism.base):] = tick_block.applied
        yield STATE_TOPIC, block.stamps, joint_state_layout(self._joints).messages(
            stamp=block.stamps,
            position=tick_block.position,
            velocity=tick_block.velocity,
            effort=effort,
        )

    def _commands(self, block: _Block) -> Iterator[_Rows]:
        tick_block, stamps = block.tick_block, block.stamps
        driven = self._joints[len(self._mechanism.base):]
        if not self._simulation.controller.commands_rates:
            efforts = EFFORT.named(driven)
            for group in efforts.messages(stamps, tick_block.torque, tick_block.is_void):
                yield COMMAND_TOPIC, stamps[group.indices], group.messages
            return
        rates = np.zeros((len(stamps), 6))
        own = len(self._mechanism.twist)
        for number, velocity in enumerate(self._mechanism.twist):
            rates[:, velocity.place] = tick_block.rates[:, number]
        linear, angular = rates[:, :3], rates[:, 3:]
        if self._is_stamped:
            layout = twist_stamped_layout(self._command_prefix, self._mechanism.frames[0][1])
            twists = layout.messages(stamp=stamps, linear=linear, angular=angular)
        else:
            twists = twist_layout().messages(linear=linear, angular=angular)
        yield CMD_VEL_TOPIC, stamps, twists
        for group in ARM_VELOCITY.named(driven[own:]).messages(stamps, tick_block.rates[:, own:]):
            yield ARM_VELOCITY_TOPIC, stamps[group.indices], group.messages

    def _telemetry(self, block: _Block) -> Iterator[_Rows]:
        decimation = self._values['controller']['telemetry_decimation']
        if not decimation:
            return
        chosen = (block.ticks % decimation == 0) & block.tick_block.active
        stamps = block.stamps[chosen]
        for signal in PUBLISHED:
            topic = telemetry_topic(signal.label)
            if topic in self._channels:
                values = getattr(block.tick_block, signal.name)[chosen]
                yield topic, stamps, telemetry_messages(signal.label, stamps, values)

    def _motion(self, block: _Block) -> Iterator[_Rows]:
        tick_block = block.tick_block
        chosen = self._decimated(block.ticks, self._values['plant']['odom_decimation'])
        stamps = block.stamps[chosen]
        pose, twist = self._mechanism.formulas.base_motion(
            tick_block.position[chosen], tick_block.velocity[chosen]
        )
        linear, angular = twist[:, :3], twist[:, 3:]
        layout = odometry_layout(self._prefix, self._mechanism.frames[0][1])
        yield 'odom', stamps, layout.messages(
            stamp=stamps,
            position=pose[:, :3],
            orientation=pose[:, 3:],
            linear=linear,
            angular=angular,
        )
        yield 'base_twist', stamps, twist_layout().messages(linear=linear, angular=angular)
        if CONTACT_TOPIC in self._channels:
            contact = telemetry_messages(CONTACT_LABEL, stamps, tick_block.contact[chosen])
            yield CONTACT_TOPIC, stamps, contact

    def _clock(self, block: _Block) -> Iterator[_Rows]:
        decimation = self._values['plant']['clock_decimation']
        if decimation:
            stamps = block.stamps[self._decimated(block.ticks, decimation)]
            yield CLOCK_TOPIC, stamps, time_layout().messages(stamp=stamps)

    def _transforms(self, block: _Block) -> Iterator[_Rows]:
        decimation = self._values['plant']['tf_decimation']
        if decimation:
            chosen = self._decimated(block.ticks, decimation)
            stamps, frames = block.stamps[chosen], self._mechanism.frames
            transforms = self._robot.frame_transforms(block.tick_block.position[chosen])
            messages = transforms_messages(stamps, transforms, self._prefix, frames)
            yield TRANSFORMS.name, stamps, messages

    def _path(self, block: _Block) -> Iterator[_Rows]:
        for row, tick in enumerate(block.ticks.tolist()):
            if self._actual.takes(tick):
                raw = self._actual.add(tick, block.tick_block.position[row])
                if raw is not None:
                    yield ACTUAL_PATH_TOPIC, block.stamps[row:row + 1], _one_row(raw)

    def _decimated(self, ticks: NDArray[np.int64], decimation: int) -> NDArray[np.bool_]:
        """Return the ticks of a decimated topic: multiples, and the last one."""
        return (ticks % decimation == 0) | (ticks == self._simulation.timing.last)

    def _reference(self, block: _Block) -> Iterator[_Rows]:
        """Yield the samples in windows, each at its own first stamp."""
        stamps, period = block.stamps, self._simulation.timing.period
        length = max(2, round(self._values['trajectory']['window'] / period))
        edges = [*range(0, len(stamps), length), len(stamps)]
        for first, end in pairwise(edges):
            samples = block.tick_block.reference[first:end]
            raw = ReferenceWindow(int(stamps[first]), period, samples).to_bytes()
            yield REFERENCE_TOPIC, stamps[first:first + 1], _one_row(raw)


def _one_row(message: bytes) -> NDArray[np.uint8]:
    """Return a message as the only row (1, size) of an array."""
    return np.frombuffer(message, dtype=np.uint8)[None]
