# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Logs of computed runs, with the topics, stamps and bytes of recordings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from masmc_ros.aliases import Bytes, Indices, Integers, Stamps
from masmc_ros.law.command_interface import ENABLE_STAMPED_CMD_VEL
from masmc_ros.log.bag import Qos
from masmc_ros.log.codec import ChannelRows
from masmc_ros.log.recorder_parameters import COMPRESSION
from masmc_ros.log.traced_paths import ActualPath, DesiredPath
from masmc_ros.log.write.provenance import write_origin, write_parameters
from masmc_ros.log.write.writer import LogWriter
from masmc_ros.loop.controller_parameters import POSE_FRAME, TELEMETRY_DECIMATION
from masmc_ros.loop.scenario import Scenario
from masmc_ros.loop.signals import PUBLISHED
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.tick_block import Change, TickBlock
from masmc_ros.loop.trajectory_parameters import WINDOW
from masmc_ros.messages import platform_messages, topics
from masmc_ros.messages.cdr_layout import Messages
from masmc_ros.messages.commands import ARM_VELOCITY, EFFORT
from masmc_ros.messages.joint_state import joint_state_layout
from masmc_ros.messages.message import string_message
from masmc_ros.messages.parameter_record import ParameterRecord
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.messages.telemetry import telemetry_messages
from masmc_ros.messages.transforms import transforms_messages
from masmc_ros.robot.mechanisms import check_frame_prefix, FRAME_PREFIX, joint_names
from masmc_ros.robot.robot import robot_description, robot_of
import numpy as np

_Rows = tuple[str, Integers, Messages | Bytes]
"""Topic, stamps (n) in ns, and its messages at these times."""


class _Block(NamedTuple):
    """Consecutive ticks: their signals, numbers (n), and stamps (n) in ns."""

    tick_block: TickBlock
    ticks: Integers
    stamps: Stamps


class SimulationLog:
    """
    Log of a computed run, written in blocks of ticks; a context manager.

    A run that ends with an exception leaves no file.
    """

    def __init__(
        self, path: Path, simulation: Simulation, scenario: Scenario,
        files: Mapping[str, bytes],
    ) -> None:
        """
        Initialise the log.

        Parameters
        ----------
        path
            the file.
        simulation
            the run.
        scenario
            parameters of the run.
        files
            parameter files by name.

        """
        self._simulation = simulation
        # No state was late, so the log is one of a run in lock-step.
        self._scenario = scenario.with_nodes({
            node: {**own, 'pacing': 'lockstep'} if 'pacing' in own else own
            for node, own in scenario.values.items()
        })
        self._changes: list[ParameterRecord] = []
        plant, controller, trajectory = scenario.plant, scenario.controller, scenario.trajectory
        self._robot = robot_of(plant)
        self._mechanism = self._robot.mechanism
        self._prefix = check_frame_prefix(FRAME_PREFIX.of(plant))
        self._joints = joint_names(plant)
        self._description = robot_description(plant, self._prefix)
        self._files = {**files, 'robot.urdf': self._description.encode()}
        self._actual = ActualPath(simulation.timing, self._robot, self._prefix)
        prefix = check_frame_prefix(FRAME_PREFIX.of(trajectory))
        desired = DesiredPath(
            simulation.timing, robot_of(trajectory), prefix, POSE_FRAME.of(trajectory)
        )
        self._desired = desired.whole(simulation.trajectory)
        self._writer = LogWriter(path, compression=COMPRESSION.of(scenario['recorder']))
        self._is_stamped = ENABLE_STAMPED_CMD_VEL.of(controller)
        self._command_prefix = check_frame_prefix(FRAME_PREFIX.of(controller))
        types = {topic.name: topic.type_name for topic in topics.TOPICS}
        latched = {topic.name for topic in topics.TOPICS if topic.is_latched}
        if self._is_stamped:
            types[topics.CMD_VEL_TOPIC] = topics.TWIST_STAMPED
        if simulation.controller.commands_rates:
            unused = [topics.COMMAND_TOPIC]
            unused += [topics.telemetry_topic(s.label) for s in PUBLISHED if s.of_torques]
        else:
            unused = [topics.ARM_VELOCITY_TOPIC]
            if not simulation.controller.is_hybrid:
                unused.append(topics.CMD_VEL_TOPIC)
        if simulation.controller.by_velocity.any() or not self._mechanism.sharing_drives:
            unused.append(topics.SHARED_TOPIC)
        if not len(simulation.plant.contact):
            unused.append(topics.CONTACT_TOPIC)
        self._channels = {
            name: self._writer.channel(
                f'/{name.lstrip("/")}',
                type_name,
                Qos(durability='transient_local' if name in latched else 'volatile'),
            )
            for name, type_name in types.items()
            if name not in unused
        }

    def __enter__(self) -> SimulationLog:
        """Write the data known before the first tick."""
        self._writer.__enter__()
        write_origin(self._writer, self._files)
        for node in topics.PARAMETER_NODES:
            self._write_record(ParameterRecord(f'/{node}', 0, 0, dict(self._scenario[node]), ()))
        urdf = string_message(self._description)
        self._writer.write(self._channels[topics.DESCRIPTION_TOPIC], 0, urdf)
        if self._desired is not None:
            channel = self._channels[topics.DESIRED_PATH_TOPIC]
            self._writer.write(channel, 0, self._desired)
        return self

    def __exit__(self, _: object, error: BaseException | None, traceback: object) -> None:
        """Complete the file, or remove it after an exception."""
        if error is None:
            parameters = {node: self._scenario[node] for node in topics.PARAMETER_NODES}
            write_parameters(self._writer, parameters, self._changes)
        self._writer.__exit__(_, error, traceback)

    def write(self, tick_block: TickBlock) -> None:
        """Write all messages of consecutive ticks."""
        ticks = np.arange(tick_block.first, tick_block.first + len(tick_block))
        timing = self._simulation.timing
        stamps = np.array([timing.stamp(tick) for tick in ticks.tolist()], dtype=np.int64)
        for change in tick_block.changes:
            self._write_change(change)
        block = _Block(tick_block, ticks, stamps)
        # Messages of the same time are written in this order.
        sources = (
            *(self._reference, self._motion, self._clock, self._transforms),
            *(self._path, self._states, self._commands, self._telemetry),
        )
        parts = chain.from_iterable(source(block) for source in sources)
        self._writer.write_rows(
            [ChannelRows(self._channels[topic], times, rows) for topic, times, rows in parts]
        )

    @property
    def size(self) -> int:
        """Size in bytes without the open chunk."""
        return self._writer.size

    def _write_change(self, change: Change) -> None:
        """Write a change of a node at its first tick."""
        node, values = f'/{change.node}', self._scenario[change.node]
        before = (past.parameters for past in reversed(self._changes) if past.node == node)
        stamp, changed = self._simulation.timing.stamp(change.tick), tuple(change.values)
        record = ParameterRecord(
            node, change.tick, stamp, {**next(before, values), **change.values}, changed,
            change.event,
        )
        self._changes.append(record)
        self._write_record(record)

    def _write_record(self, record: ParameterRecord) -> None:
        channel = self._channels[topics.parameters_topic(record.node.lstrip('/'))]
        self._writer.write(channel, record.stamp, string_message(record.to_text()))

    def _states(self, block: _Block) -> Iterator[_Rows]:
        tick_block = block.tick_block
        effort = np.zeros_like(tick_block.position)
        effort[:, len(self._mechanism.base):] = tick_block.applied
        yield topics.STATE_TOPIC, block.stamps, joint_state_layout(self._joints).messages(
            header_stamp=block.stamps,
            position=tick_block.position,
            velocity=tick_block.velocity,
            effort=effort,
        )

    def _commands(self, block: _Block) -> Iterator[_Rows]:
        tick_block, stamps, mechanism = block.tick_block, block.stamps, self._mechanism
        driven, controller = self._joints[len(mechanism.base):], self._simulation.controller
        own = len(mechanism.twist)
        if not controller.commands_rates:
            first = own if controller.is_hybrid else 0
            torques, is_void = tick_block.torque[:, first:], tick_block.is_void
            for group in EFFORT.named(driven[first:]).messages(stamps, torques, is_void):
                yield topics.COMMAND_TOPIC, stamps[group.indices], group.messages
        if topics.SHARED_TOPIC in self._channels:
            shared = mechanism.shared_torques(np.where(is_void[:, None], 0.0, tick_block.torque))
            for group in EFFORT.named(mechanism.sharing_drives).messages(stamps, shared, is_void):
                yield topics.SHARED_TOPIC, stamps[group.indices], group.messages
        if not controller.by_velocity.any():
            return
        rates = np.zeros((len(stamps), 6))
        rates[:, [component.place for component in mechanism.twist]] = tick_block.rates[:, :own]
        if self._is_stamped:
            frame = mechanism.frames[0][1]
            layout = platform_messages.twist_stamped_layout(self._command_prefix, frame)
            twists = layout.messages(header_stamp=stamps, twist=rates)
        else:
            twists = platform_messages.twist_layout().messages(numbers=rates)
        yield topics.CMD_VEL_TOPIC, stamps, twists
        if controller.is_hybrid:
            return
        for group in ARM_VELOCITY.named(driven[own:]).messages(stamps, tick_block.rates[:, own:]):
            yield topics.ARM_VELOCITY_TOPIC, stamps[group.indices], group.messages

    def _telemetry(self, block: _Block) -> Iterator[_Rows]:
        decimation = TELEMETRY_DECIMATION.of(self._scenario.controller)
        if decimation:
            rows = (block.ticks % decimation == 0) & block.tick_block.active
            stamps = block.stamps[rows]
            for signal in PUBLISHED:
                topic = topics.telemetry_topic(signal.label)
                if topic in self._channels:
                    values = getattr(block.tick_block, signal.name)[rows]
                    yield topic, stamps, telemetry_messages(signal.label, stamps, values)

    def _motion(self, block: _Block) -> Iterator[_Rows]:
        rows, tick_block, mechanism = self._rows(block, 'odom'), block.tick_block, self._mechanism
        stamps = block.stamps[rows]
        pose, velocity = mechanism.formulas.base_motion(
            tick_block.position[rows], tick_block.velocity[rows]
        )
        layout = platform_messages.odometry_layout(self._prefix, mechanism.frames[0][1])
        yield 'odom', stamps, layout.messages(
            header_stamp=stamps, pose_pose=pose, twist_twist=velocity
        )
        yield 'base_twist', stamps, platform_messages.twist_layout().messages(numbers=velocity)
        topic, label = topics.CONTACT_TOPIC, topics.CONTACT_LABEL
        if topic in self._channels:
            yield topic, stamps, telemetry_messages(label, stamps, tick_block.contact[rows])

    def _clock(self, block: _Block) -> Iterator[_Rows]:
        stamps = block.stamps[self._rows(block, 'clock')]
        yield topics.CLOCK_TOPIC, stamps, platform_messages.time_layout().messages(
            clock=stamps
        )

    def _transforms(self, block: _Block) -> Iterator[_Rows]:
        rows, frames = self._rows(block, 'tf'), self._mechanism.frames
        stamps = block.stamps[rows]
        transforms = self._robot.frame_transforms(block.tick_block.position[rows])
        messages = transforms_messages(stamps, transforms, self._prefix, frames)
        yield topics.TRANSFORMS.name, stamps, messages

    def _path(self, block: _Block) -> Iterator[_Rows]:
        for row, tick in enumerate(block.ticks.tolist()):
            if self._actual.takes(tick):
                raw = self._actual.add(tick, block.tick_block.position[row])
                if raw is not None:
                    yield topics.ACTUAL_PATH_TOPIC, block.stamps[row:row + 1], _one_row(raw)

    def _rows(self, block: _Block, topic: str) -> Indices:
        """Return the ticks of a decimated topic of the plant: multiples, and the last one."""
        decimation = self._scenario.plant[f'{topic}_decimation']
        if not decimation:
            return np.zeros(0, np.intp)
        is_last = block.ticks == self._simulation.timing.last
        return np.flatnonzero((block.ticks % decimation == 0) | is_last)

    def _reference(self, block: _Block) -> Iterator[_Rows]:
        """Yield the samples in windows, each at its own first stamp."""
        stamps, period = block.stamps, self._simulation.timing.period
        length = max(2, round(WINDOW.of(self._scenario.trajectory) / period))
        for first in range(0, len(stamps), length):
            samples = block.tick_block.reference[first:first + length]
            raw = ReferenceWindow(int(stamps[first]), period, samples).to_bytes()
            yield topics.REFERENCE_TOPIC, stamps[first:first + 1], _one_row(raw)


def _one_row(message: bytes) -> Bytes:
    """Return a message as the only row (1, size) of an array."""
    return np.frombuffer(message, dtype=np.uint8)[None]
