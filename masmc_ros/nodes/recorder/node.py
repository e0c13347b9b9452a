# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The recorder node: every message of a run, byte for byte, into one MCAP file."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from functools import partial
from pathlib import Path
import sys
from threading import Thread
import time
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from masmc_ros.errors import InputError
from masmc_ros.log.chunks import Message
from masmc_ros.log.qos import Qos
from masmc_ros.log.read.gaps import MISSING
from masmc_ros.log.recover.recover import recover_all
from masmc_ros.log.write.provenance import write_origin, write_parameters
from masmc_ros.log.write.recording import clear_recording, Options, Recording
from masmc_ros.log.write.writer import LogWriter
from masmc_ros.loop.supervisor import ACTIVE
from masmc_ros.loop.timing import Timing
from masmc_ros.messages.definitions import Definition
from masmc_ros.messages.layout import NANOSECONDS
from masmc_ros.messages.names import (
    ARM_VELOCITY_TOPIC,
    CMD_VEL_TOPIC,
    COMMAND_TOPIC,
    DESCRIPTION_TOPIC,
    REFERENCE_TOPIC,
    STATE_TOPIC,
    TELEMETRY,
    telemetry_topic,
)
from masmc_ros.messages.parameter_record import ParameterRecord, record_of
from masmc_ros.messages.stamps import stamp_reader
from masmc_ros.messages.text import text_of
from masmc_ros.messages.topics import (
    PARAMETER_NODES,
    parameters_topic,
    SYSTEM_TOPICS,
    TOPICS,
    TRANSFORMS,
    transforms_topic,
)
from masmc_ros.messages.transforms import first_frames, first_names, is_of_robot
from masmc_ros.nodes.middleware.exchange import hears_logs
from masmc_ros.nodes.middleware.qos import DEEP, subscribe_with_past, subscription_qos
from masmc_ros.nodes.middleware.raw_types import raw_class
from masmc_ros.nodes.process.base import SuiteNode
from masmc_ros.nodes.process.command_line import CommandLine
from masmc_ros.nodes.process.diagnostics import publish_health
from masmc_ros.nodes.process.refusals import Refusals
from masmc_ros.nodes.process.runtime import run
from masmc_ros.nodes.recorder.coverage import Coverage
from masmc_ros.nodes.recorder.extra_topics import ExtraTopics
from masmc_ros.nodes.recorder.health import RecorderHealth
from masmc_ros.nodes.recorder.listening import take_rest
from rclpy.context import Context

_PROGRESS = 100
"""Answered states between two reports of progress."""

_LONG_QUIET = 3.0
"""Time in s without a message of the run itself after which one that reached its end is over.

Others do not count: health is told every second, by this node too.
"""

_WATCH = 0.2
"""Time in s between two looks at how the disk does."""

_TOGETHER = 256
"""Messages that are handed to the thread that writes at once."""

_SOON = 0.02
"""Time in s that they wait for one another at most."""

_MEGABYTE = 1_000_000

_QUEUE = 10 * DEEP
"""Messages of a topic that wait for a recorder that is held up; memory only while they do."""

_CORE = (
    ((STATE_TOPIC,),),
    ((COMMAND_TOPIC,), (CMD_VEL_TOPIC, ARM_VELOCITY_TOPIC)),
    ((REFERENCE_TOPIC,),),
)
"""Topics whose senders must be found before the recorder calls itself ready.

Of each line all topics of one of its entries: torques are commanded, or rates.
"""


_TELEMETRY = tuple(map(telemetry_topic, TELEMETRY))

_WITH_TICKS = (*_TELEMETRY, TRANSFORMS.name, TRANSFORMS.name.lstrip('/'), 'odom', CMD_VEL_TOPIC)
"""Topics that come with the ticks, or every few of them, beside states and commands."""


class RecorderNode(SuiteNode):
    """Subscribes raw to everything and writes it as it comes."""

    name = 'recorder'
    follows = True

    def __init__(self, *, context: Context, command_line: CommandLine) -> None:
        """Open the file; InputError where that is not possible."""
        super().__init__(context=context, command_line=command_line)
        self._last = self._last_stamp()
        self._files = {path: Path(path).read_bytes() for path in command_line.files}
        self._extra = ExtraTopics(
            self.values['extra_topics'], {t.name: t.holds for t in TOPICS if t.turns_up}
        )
        self._recording = self._open(log_path(Path(self.values['output'])))
        self._not_understood = Refusals(self.log, 'is recorded as it came')
        self._recording.not_understood = self._not_understood.counts
        self._health = RecorderHealth(self._recording)
        self._note_state = self._health.watch(self.node.resolve_topic_name(STATE_TOPIC)).add
        self._latest: int | None = None
        self._taken: list[Message] = []
        self._early: list[tuple[int, bytes]] = []
        self._early_size = 0
        self._coverage = Coverage()
        self._reported = -1
        self._unreported = 0
        self._is_ready = False
        self._last_arrival = self._last_of_run = time.monotonic()
        self._parameters: dict[str, Any] = {}
        self._heard_of: set[str] = set()
        self._frame_prefix: str = self.values['frame_prefix']
        self._own_names = first_names(self._frame_prefix)
        self._description: str | None = None
        self._changes: list[ParameterRecord] = []
        self._told_trouble: str | None = None
        self._told_lost = 0
        self.counts: dict[str, int] = {}

    def connect(self) -> None:
        """Subscribe to everything, and say so once the senders are found."""
        super().connect()
        self._progress = self.publisher(Time, 'recorder/progress', 1)
        told = {parameters_topic(node) for node in PARAMETER_NODES}
        # A node finds our subscriptions in their order: one from which parameters have come
        # has found all of them, and no telemetry of it goes by.
        for topic in sorted((*TOPICS, *SYSTEM_TOPICS), key=lambda each: each.name in told):
            if topic.turns_up:
                continue
            name = topic.name
            if topic is TRANSFORMS:
                name = transforms_topic(self.node.get_namespace(), self._frame_prefix)
            try:
                self._record_topic(
                    name, topic.type_name, is_latched=topic.is_latched, holds=topic.holds
                )
            except InputError as error:
                self.log.warning(f'{name} is not recorded: {error}')
        self.node.create_timer(0.05, self._look_around, clock=self.steady)
        self.node.create_timer(_WATCH, self._watch_disk, clock=self.steady)
        self.node.create_timer(_SOON, self._hand_over, clock=self.steady)
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
        """Take what is still under way, complete the file."""
        super().close(spin)
        take_rest(spin, lambda: self._last_arrival)
        self._release_early(self._latest or 0)
        self._hand_over()
        self._health.look()
        self._recording.close()
        self._watch_disk()
        lost = sum(self._recording.lost.values())
        messages = sum(self.counts.values()) - lost
        told = f', {lost} lost' if lost else ''
        self.log.info(f'{messages} messages in {self._recording.path}{told}')
        for topic, text in self._health.missing().items():
            self.log.warning(f'{topic}: {text}, by its stamps')

    def _open(self, path: Path) -> Recording:
        """Start the recording; InputError where its place is taken or cannot be written."""
        values = self.values
        options = Options(
            compression=values['compression'],
            flush_period=values['flush_period'],
            max_size=round(values['max_size'] * _MEGABYTE),
            max_duration=round(values['max_duration'] * NANOSECONDS),
            queue_size=round(values['queue_size'] * _MEGABYTE),
        )
        place = path.with_suffix('') if options.is_split else path
        if place.exists():
            if not values['overwrite']:
                raise InputError(
                    f'output = {place}: is there already; name another, or set overwrite to true'
                )
            if options.is_split:
                clear_recording(place)
        return Recording(path, options, self._write_opening, self._write_closing)

    def _write_opening(self, log: LogWriter) -> None:
        write_origin(log, self._files)

    def _write_closing(self, log: LogWriter) -> None:
        write_parameters(log, dict(self._parameters), tuple(self._changes))
        missing = self._health.missing()
        if missing:
            log.metadata(MISSING, missing)
        if self._description is not None:
            log.attach('robot.urdf', 'application/xml', self._description.encode())

    def _on_description(self, raw: bytes, stamp: int | None) -> None:
        self._description = text_of(raw)

    def _recover_earlier(self) -> None:
        """Complete, beside the recording, what an earlier one in this folder left."""
        folder = self._recording.path.parent
        recovery = Thread(target=self._recover_in, args=(folder,), name='recovery', daemon=True)
        recovery.start()

    def _recover_in(self, folder: Path) -> None:
        for path, recovered in recover_all(folder):
            self.log.warning(
                f'{path}: its recorder was cut off; completed with {recovered.messages} messages'
            )

    def _watch_disk(self) -> None:
        """Say when the disk takes nothing, when messages are lost, and when that is over."""
        recording = self._recording
        if recording.failure is not None:
            self.finished = True
        trouble = recording.trouble
        if trouble != self._told_trouble:
            self._told_trouble = trouble
            if trouble is not None:
                self.log.error(
                    f'{recording.path}: {trouble}; up to {self.values["queue_size"]:g} MB of'
                    ' messages are kept until there is space again'
                )
            else:
                self.log.info(f'{recording.path}: the disk takes messages again')
        lost = sum(recording.lost.values())
        if lost > self._told_lost:
            self._told_lost = lost
            self.log.error(
                f'{lost} messages lost so far: the disk does not keep up with them',
                throttle_duration_sec=1.0,
            )

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
        )
        self.counts[resolved] = 0
        handlers: dict[str, Callable[[bytes, int | None], None]] = {
            STATE_TOPIC: self._on_state,
            COMMAND_TOPIC: self._on_command,
            ARM_VELOCITY_TOPIC: self._on_command,
            DESCRIPTION_TOPIC: self._on_description,
            'controller/state': self._on_controller_state,
            **{name: partial(self._on_tick, name) for name in _WITH_TICKS},
            **{parameters_topic(n): partial(self._on_parameters, n) for n in PARAMETER_NODES},
        }
        stamp_of, handler = stamp_reader(topic, type_name), handlers.get(topic)
        is_shared, counts = topic == TRANSFORMS.name, self.counts

        def take(raw: Any) -> None:
            if is_shared and not (raw.startswith(*self._own_names) or self._is_own(raw)):
                return
            self._last_arrival = time.monotonic()
            counts[resolved] += 1
            stamp = None
            try:
                stamp = stamp_of(raw)
                if handler is not None:
                    handler(raw, stamp)
            except Exception as error:  # whatever a stranger sends must not end the recording
                self._not_understood.add(resolved, error)
            self._keep(channel, stamp, raw)

        if is_latched and not best_effort:
            subscribe_with_past(self.node, message_type, topic, take, _QUEUE)
        else:
            qos = subscription_qos(depth=_QUEUE, past=is_latched, best_effort=best_effort)
            self.node.create_subscription(message_type, topic, take, qos, raw=True)

    def _keep(self, channel: int, stamp: int | None, raw: bytes) -> None:
        """Keep a message of a stamp in ns, or without one, for the log."""
        time_ns = self._latest if stamp is None else stamp
        if time_ns is None:
            self._keep_early(channel, raw)
            return
        self._taken.append((channel, time_ns, raw))
        if len(self._taken) >= _TOGETHER:
            self._hand_over()

    def _hand_over(self) -> None:
        """Hand what has come to the thread that writes."""
        if self._taken:
            self._recording.write_all(self._taken)
            self._taken = []

    def _keep_early(self, channel: int, raw: bytes) -> None:
        """Keep a message until there is a time, but no more than a queue may hold."""
        self._early.append((channel, raw))
        self._early_size += len(raw)
        if self._early_size > self.values['queue_size'] * _MEGABYTE:
            self._latest = 0
            self._release_early(0)

    def _on_state(self, raw: bytes, stamp: int | None) -> None:
        if stamp is None:
            return
        self._last_of_run = self._last_arrival
        if self._latest is None:
            self._release_early(stamp)
        self._latest = stamp
        self._coverage.add_state(stamp)
        self._note_state(stamp)

    def _on_command(self, raw: bytes, stamp: int | None) -> None:
        """Note which states are answered."""
        if stamp is None:
            return
        self._last_of_run = self._last_arrival
        self._coverage.answered = stamp
        self._unreported += 1
        if self._unreported >= _PROGRESS:
            self._report_progress()
        if self._last is not None and stamp >= self._last:
            self.wait(None)

    def _is_own(self, raw: bytes) -> bool:
        """Tell whether transforms on /tf, which robots share, are of this one."""
        is_own = is_of_robot(raw, self._frame_prefix)
        if not is_own:
            parent, child = first_frames(raw)
            self.log.info(
                f'{TRANSFORMS.name}: frames of others, such as {parent} to {child}, are left out',
                once=True,
            )
        return is_own

    def _on_tick(self, topic: str, raw: bytes, stamp: int | None) -> None:
        if stamp is not None:
            self._last_of_run = self._last_arrival
            self._coverage.add(topic, stamp)

    def _on_controller_state(self, raw: bytes, stamp: int | None) -> None:
        """Expect no telemetry of a controller that does not compute."""
        if text_of(raw) != ACTIVE:
            self._coverage.forget(_TELEMETRY)

    def _on_parameters(self, node: str, raw: bytes, stamp: int | None) -> None:
        self._heard_of.add(node)
        record = record_of(raw)
        if node in self._parameters:
            self._changes.append(record)
        else:
            self._parameters[node] = record.parameters
        if node == 'plant':
            self._go_by_prefix(record.parameters.get('frame_prefix'))

    def _go_by_prefix(self, prefix: Any) -> None:
        """Take the plant's word for the names of its frames."""
        if not isinstance(prefix, str) or prefix == self._frame_prefix:
            return
        namespace = self.node.get_namespace()
        topics = [transforms_topic(namespace, each) for each in (prefix, self._frame_prefix)]
        if topics[0] != topics[1]:
            self.log.warning(
                f'the plant sends its frames on {topics[0]} (frame_prefix {prefix!r}), and what '
                f'is recorded is {topics[1]}; give the recorder the same frame_prefix'
            )
        self._frame_prefix = prefix
        self._own_names = first_names(prefix)

    def _release_early(self, stamp: int) -> None:
        """Write what came before the first state, with its stamp."""
        self._taken += [(channel, stamp, raw) for channel, raw in self._early]
        self._early.clear()
        self._early_size = 0

    def _report_progress(self) -> None:
        """Report up to where everything has come, unless that is told already."""
        reached = self._coverage.reached()
        if reached != self._reported and not self._recording.is_congested:
            self._report(reached)

    def _report(self, reached: int) -> None:
        self._unreported = 0
        self._reported = reached
        stamp = max(reached, 0)
        self._progress.publish(Time(sec=stamp // 10**9, nanosec=stamp % 10**9))

    def _is_sent(self, topic: str) -> bool:
        """Tell whether somebody sends on a topic, and it is recorded."""
        resolved = self.node.resolve_topic_name(topic)
        return resolved in self.counts and self.node.count_publishers(resolved) > 0

    def _has_told(self, node: str) -> bool:
        """Tell whether a node, if it is there and tells them, has told its parameters."""
        return node in self._heard_of or not self._is_sent(parameters_topic(node))

    def _look_around(self) -> None:
        """Tell the plant when all senders are found; end when they have gone."""
        self._extra.look(self.node, self.log, self._record_topic)
        here = [any(all(map(self._is_sent, each)) for each in line) for line in _CORE]
        has_found = all(here) and hears_logs(self.node)
        if not self._is_ready and has_found and all(map(self._has_told, PARAMETER_NODES)):
            self._is_ready = True
            self.wait(None)
            self._report(self._coverage.reached())
        if self._is_ready:
            # What was behind may be there, or no longer expected, while the plant stands still.
            self._report_progress()
        is_over = self._last is not None and self._coverage.answered >= self._last
        # A sender that was killed counts as there for a while yet.
        is_quiet = time.monotonic() - self._last_of_run > _LONG_QUIET
        if is_over and (is_quiet or not any(here)):
            self.finished = True


def _core_text() -> str:
    return ', '.join(' or '.join(' and '.join(each) for each in line) for line in _CORE)


def log_path(output: Path) -> Path:
    """Return the file to record into: the one named, or one named by the time in a folder."""
    if output.suffix == '.mcap':
        return output
    return output / datetime.now().strftime('masmc_%Y-%m-%d_%H-%M-%S.mcap')


def main(arguments: list[str] | None = None) -> int:
    """Run the recorder node."""
    return run([RecorderNode], arguments)


if __name__ == '__main__':
    sys.exit(main())
