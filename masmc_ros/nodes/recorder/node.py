# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Recorder node, which writes every message of a run unmodified into one MCAP file."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
import os
from pathlib import Path
import sys
from threading import Thread
import time

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from masmc_ros.control.supervisor import Mode
from masmc_ros.errors import InputError
from masmc_ros.log.bag import Qos
from masmc_ros.log.recorder_parameters import EXTRA_TOPICS, QUEUE_SIZE
from masmc_ros.log.recover import recover_all
from masmc_ros.loop.timing import Timing
from masmc_ros.messages.cdr_layout import Definition
from masmc_ros.messages.message import text_of
from masmc_ros.messages.parameter_record import record_of
from masmc_ros.messages.stamps import stamp_reader
from masmc_ros.messages.topics import (
    ARM_VELOCITY_TOPIC,
    CMD_VEL_TOPIC,
    COMMAND_TOPIC,
    CONTROLLER_STATE_TOPIC,
    DESCRIPTION_TOPIC,
    PARAMETER_NODES,
    parameters_topic,
    REFERENCE_TOPIC,
    STATE_TOPIC,
    SYSTEM_TOPICS,
    TELEMETRY,
    telemetry_topic,
    TOPICS,
    TRANSFORMS,
)
from masmc_ros.nodes.middleware.ros_topics import (
    DEEP,
    raw_class,
    subscribe,
    subscribe_with_past,
    subscription_qos,
)
from masmc_ros.nodes.process.base import publish_health, RejectedMessages, SuiteNode
from masmc_ros.nodes.process.command_line import CommandLine
from masmc_ros.nodes.process.runtime import run
from masmc_ros.nodes.recorder.extra_topics import ExtraTopics
from masmc_ros.nodes.recorder.health import RecorderHealth
from masmc_ros.nodes.recorder.intake import Intake, OwnFrames, take_rest
from masmc_ros.nodes.recorder.output import Attachments, DiskWatch, MEGABYTE, open_recording
from masmc_ros.nodes.recorder.progress import Progress
from masmc_ros.robot.mechanisms import FRAME_PREFIX
from rclpy.context import Context

_LONG_QUIET = 3.0
"""
Time in s without a message of the run after which a run that reached its end is over.

Other topics do not count: every node publishes diagnostics once a second.
"""

_WATCH = 0.2
"""Time in s between two checks of the disk."""

_SOON = 0.02
"""Maximum time in s for which messages are collected."""

_QUEUE = 10 * DEEP
"""Messages of a topic that wait for a delayed recorder; they need memory only then."""

_NICENESS = 5
"""
Niceness of a recorder in a separate process.

At the same priority it preempts the publishers at each message, and lock-step waits for it.
With a higher niceness it could not record a run at 1 kHz on busy processors.
"""

_CORE = (
    ((STATE_TOPIC,),),
    ((COMMAND_TOPIC,), (CMD_VEL_TOPIC, ARM_VELOCITY_TOPIC)),
    ((REFERENCE_TOPIC,),),
)
"""
Topics whose senders must be discovered before the recorder is ready.

All topics of one entry of each line are needed: torques are commanded, or velocities.
"""

_TELEMETRY = tuple(map(telemetry_topic, TELEMETRY))

_WITH_TICKS = (*_TELEMETRY, TRANSFORMS.name, TRANSFORMS.name.lstrip('/'), 'odom', CMD_VEL_TOPIC)
"""Topics with a message every few ticks, other than states and commands."""


class RecorderNode(SuiteNode):
    """Recorder of all topics of a run."""

    name = 'recorder'
    follows = True

    def __init__(self, *, context: Context, command_line: CommandLine) -> None:
        """Initialise the node and open the file; InputError if that is not possible."""
        super().__init__(context=context, command_line=command_line)
        self._last = self._last_stamp()
        self._extra = ExtraTopics(
            self.node,
            EXTRA_TOPICS.of(self.values),
            {t.name: t.holds for t in TOPICS if t.turns_up},
        )
        files = {file.path: Path(file.path).read_bytes() for file in command_line.files}
        self._attachments = Attachments(files, lambda: self._health.missing())
        self._recording = open_recording(
            self.values, self._attachments, self.node.get_namespace()
        )
        self._not_understood = RejectedMessages(self.log, 'is recorded as it came')
        self._recording.not_understood = self._not_understood.counts
        self._health = RecorderHealth(self._recording)
        self._note_state = self._health.watch(self.node.resolve_topic_name(STATE_TOPIC)).add
        self._intake = Intake(self._recording, QUEUE_SIZE.of(self.values) * MEGABYTE)
        self._disk = DiskWatch(self._recording, QUEUE_SIZE.of(self.values), self.log)
        self._frames = OwnFrames(self.node, FRAME_PREFIX.of(self.values))
        self._is_ready = False
        self._last_arrival = self._last_of_run = time.monotonic()
        self._known_nodes: set[str] = set()
        self.counts: dict[str, int] = {}

    def connect(self) -> None:
        """Subscribe to all topics, and report when the senders are discovered."""
        super().connect()
        self._progress = Progress(
            self._recording, self.publisher(Time, 'recorder/progress', 1).publish
        )
        last = {parameters_topic(node) for node in PARAMETER_NODES}
        # A node discovers these subscriptions in their order: a node whose parameters have
        # arrived has discovered all of them, and none of its telemetry is lost.
        for topic in sorted((*TOPICS, *SYSTEM_TOPICS), key=lambda topic: topic.name in last):
            if topic.turns_up:
                continue
            name = self._frames.topic if topic is TRANSFORMS else topic.name
            try:
                self._record_topic(
                    name, topic.type_name, is_latched=topic.is_latched, holds=topic.holds
                )
            except InputError as error:
                self.log.warning(f'{name} is not recorded: {error}')
        self.node.create_timer(0.05, self._look_around, clock=self.steady)
        self.node.create_timer(_WATCH, self._watch_disk, clock=self.steady)
        self.node.create_timer(_SOON, self._intake.hand_over, clock=self.steady)
        publish_health(
            self.node,
            self.latched(DiagnosticArray, '/diagnostics'),
            self.steady,
            lambda: self._health.report(self.counts),
        )
        self.log.info(f'recording into {self._recording.path}')
        self._recover_earlier()
        self.wait(f'the senders of {_core_text()}')

    def close(self, spin: Callable[[], None]) -> None:
        """Receive the last messages and complete the file, also if a callback raises."""
        with ExitStack() as ending:
            ending.callback(self._recording.close)
            ending.callback(self._health.look)
            ending.callback(self._intake.finish)
            super().close(spin)
            take_rest(spin, lambda: self._last_arrival)
        self._watch_disk()
        lost = sum(self._recording.lost.values())
        messages = sum(self.counts.values()) - lost
        losses = f', {lost} lost' if lost else ''
        self.log.info(f'{messages} messages in {self._recording.path}{losses}')
        for topic, text in self._health.missing().items():
            self.log.warning(f'{topic}: {text}, by its stamps')

    def _on_description(self, raw: bytes, stamp: int | None) -> None:
        self._attachments.description = text_of(raw)

    def _recover_earlier(self) -> None:
        """Complete, during the recording, incomplete files of an earlier one in this folder."""
        folder = self._recording.path.parent
        recovery = Thread(target=self._recover_in, args=(folder,), name='recovery', daemon=True)
        recovery.start()

    def _recover_in(self, folder: Path) -> None:
        for path, recovered in recover_all(folder):
            self.log.warning(
                f'{path}: truncated log of a killed recorder; completed with '
                f'{recovered.messages} messages'
            )

    def _watch_disk(self) -> None:
        if self._recording.failure is not None:
            self.finished = True
        self._disk.look()

    def _last_stamp(self) -> int | None:
        """Return the stamp of the run's last state; None for an endless run."""
        timing = Timing.from_values(self.values)
        return None if timing.last is None else timing.stamp(timing.last)

    def _record_topic(
        self,
        topic: str,
        type_name: str,
        *,
        is_latched: bool,
        holds: bool,
        best_effort: bool = False,
        defined: Definition | None = None,
    ) -> None:
        resolved = self.node.resolve_topic_name(topic)
        message_type = raw_class(type_name, defined.type_hash if defined is not None else None)
        offered = Qos(
            reliability='best_effort' if best_effort else 'reliable',
            durability='transient_local' if is_latched else 'volatile',
        )
        channel = self._recording.channel(
            resolved,
            type_name,
            offered,
            defined=defined,
            holds=holds,
            has_robot_time=topic == STATE_TOPIC,
        )
        self.counts[resolved] = 0
        handlers: dict[str, Callable[[bytes, int | None], None]] = {
            STATE_TOPIC: self._on_state,
            COMMAND_TOPIC: self._on_command,
            ARM_VELOCITY_TOPIC: self._on_command,
            DESCRIPTION_TOPIC: self._on_description,
            CONTROLLER_STATE_TOPIC: self._on_controller_state,
            **{name: partial(self._on_tick, name) for name in _WITH_TICKS},
            **{parameters_topic(n): partial(self._on_parameters, n) for n in PARAMETER_NODES},
        }
        stamp_of, handler = stamp_reader(topic, type_name), handlers.get(topic)
        is_shared, counts = topic == TRANSFORMS.name, self.counts

        def take(raw: bytes) -> None:
            if is_shared and not self._frames.are_in(raw):
                return
            self._last_arrival = time.monotonic()
            counts[resolved] += 1
            stamp = None
            try:
                stamp = stamp_of(raw)
                if handler is not None:
                    handler(raw, stamp)
            except Exception as error:  # a third-party message must not end the recording
                self._not_understood.add(resolved, error)
            self._intake.keep(channel, stamp, raw)

        if best_effort:
            qos = subscription_qos(depth=_QUEUE, past=is_latched, best_effort=True)
            self.node.create_subscription(message_type, topic, take, qos, raw=True)
        elif is_latched:
            subscribe_with_past(self.node, message_type, topic, take, _QUEUE)
        else:
            subscribe(self.node, message_type, topic, take, _QUEUE)

    def _on_state(self, raw: bytes, stamp: int | None) -> None:
        if stamp is None:
            return
        self._last_of_run = self._last_arrival
        self._intake.note_state(stamp)
        self._progress.coverage.add_state(stamp)
        self._note_state(stamp)

    def _on_command(self, raw: bytes, stamp: int | None) -> None:
        """Note that a state is answered."""
        if stamp is None:
            return
        self._last_of_run = self._last_arrival
        self._progress.add_answer(stamp)
        if self._last is not None and stamp >= self._last:
            self.wait(None)

    def _on_tick(self, topic: str, raw: bytes, stamp: int | None) -> None:
        if stamp is not None:
            self._last_of_run = self._last_arrival
            self._progress.coverage.add(topic, stamp)

    def _on_controller_state(self, raw: bytes, stamp: int | None) -> None:
        """Expect no telemetry of a controller that does not compute."""
        if text_of(raw) != Mode.ACTIVE.value:
            self._progress.coverage.forget(_TELEMETRY)

    def _on_parameters(self, node: str, raw: bytes, stamp: int | None) -> None:
        self._known_nodes.add(node)
        record = record_of(raw)
        self._attachments.add_parameters(node, record)
        if node == 'plant':
            self._frames.go_by(record.parameters.get(FRAME_PREFIX.name))

    def _is_sent(self, topic: str) -> bool:
        """Return True if a recorded topic has a publisher."""
        resolved = self.node.resolve_topic_name(topic)
        return resolved in self.counts and self.node.count_publishers(resolved) > 0

    def _has_parameters(self, node: str) -> bool:
        """Return True unless a node that publishes its parameters has not yet done so."""
        return node in self._known_nodes or not self._is_sent(parameters_topic(node))

    def _look_around(self) -> None:
        """Report to the plant when all publishers are discovered; end when they have left."""
        self._extra.look(self.node, self.log, self._record_topic, self.counts)
        has_senders = [
            any(all(map(self._is_sent, names)) for names in line) for line in _CORE
        ]
        has_parameters = all(map(self._has_parameters, PARAMETER_NODES))
        if not self._is_ready and all(has_senders) and has_parameters:
            self._is_ready = True
            self.wait(None)
            self._progress.start()
        if self._is_ready:
            # While the plant waits, a topic that was behind may arrive or end.
            self._progress.report()
        is_over = self._last is not None and self._progress.coverage.answered >= self._last
        # A killed sender is still discovered for some seconds.
        is_quiet = time.monotonic() - self._last_of_run > _LONG_QUIET
        if is_over and (is_quiet or not any(has_senders)):
            self.finished = True


def _core_text() -> str:
    return ', '.join(' or '.join(' and '.join(topics) for topics in line) for line in _CORE)


def main(arguments: list[str] | None = None) -> int:
    """Run the recorder node, at a lower priority than the publishers."""
    # First, because threads inherit the priority.
    if hasattr(os, 'nice'):
        os.nice(_NICENESS)
    return run([RecorderNode], arguments)


if __name__ == '__main__':
    sys.exit(main())
