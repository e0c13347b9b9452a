# SPDX-License-Identifier: Apache-2.0
"""What Foxglove's message paths find in a log, and what the layout's scripts make of it."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping
import json
import math
from pathlib import Path
import re
from types import SimpleNamespace
from typing import Any, NamedTuple

from masmc_ros.errors import InputError
from masmc_ros.log.decode import message_decoder
from masmc_ros.log.layout import NANOSECONDS
from masmc_ros.log.scan import scan

_STEP = re.compile(r'\.(\w+)|\[(\d+|:)\]')
_SCRIPT = re.compile(r'export const (input|output)s? = \[?([^\]\n;]+)')


class Messages(NamedTuple):
    """A topic's messages and when each was logged, in s."""

    times: list[float]
    messages: list[Any]


class LayoutLog:
    """The topics of a log and of a layout's scripts, decoded as they are asked for.

    Attributes:
        path: the log.
        end: time of the last message in s.
    """

    def __init__(self, path: Path, scripts: Mapping[str, Any]) -> None:
        """Read a log; InputError for one that is none, and for a script that is not known."""
        self.path = path
        self._topics = {
            name: topic for name, topic in scan(path).topics.items() if topic.messages
        }
        self._inputs: dict[str, str] = {}
        for script in scripts.values():
            topics = dict(_SCRIPT.findall(script['sourceCode']))
            made, source = (topics[kind].strip('"') for kind in ('output', 'input'))
            if made not in SCRIPTS:
                raise InputError(f'{made}: expected a script that SCRIPTS in {__file__} tells')
            self._inputs[made] = source
        self._read: dict[str, Messages] = {}
        self.end = max(topic.log_times[-1] for topic in self._topics.values()) / NANOSECONDS

    def messages(self, topic: str) -> Messages:
        """Return all messages of a topic or of a script; InputError where there are none."""
        if topic not in self._read:
            read = self._made if topic in self._inputs else self._decoded
            self._read[topic] = read(topic)
        return self._read[topic]

    def latest(self, topic: str, at: float) -> Any:
        """Return a topic's last message up to a time in s; InputError where there is none."""
        times, messages = self.messages(topic)
        count = bisect_right(times, at)
        if count == 0:
            raise InputError(f'{topic}: expected a message up to {at:g} s in {self.path}')
        return messages[count - 1]

    def over_time(self, path: str) -> tuple[list[float], list[float]]:
        """Return what a message path finds in every message, and the times of these in s."""
        topic, steps = _split(path)
        times, values = [], []
        for time, message in zip(*self.messages(topic), strict=True):
            found = _follow(message, steps, path)
            times += [time] * len(found)
            values += found
        return times, values

    def latest_values(self, path: str, at: float) -> list[Any]:
        """Return what a message path finds in the last message up to a time in s."""
        topic, steps = _split(path)
        return _follow(self.latest(topic, at), steps, path)

    def _decoded(self, name: str) -> Messages:
        topic = self._topics.get(name)
        if topic is None:
            raise InputError(f'{name}: expected messages of this topic in {self.path}')
        decode = message_decoder(topic)
        times = [stamp / NANOSECONDS for stamp in topic.log_times]
        return Messages(times, [decode(raw) for raw in topic.messages])

    def _made(self, output: str) -> Messages:
        script = SCRIPTS[output]
        made = [(t, script(m)) for t, m in zip(*self.messages(self._inputs[output]), strict=True)]
        return Messages(
            [t for t, m in made if m is not None], [m for _, m in made if m is not None]
        )


def _split(path: str) -> tuple[str, list[re.Match[str]]]:
    """Split a message path into its topic and the steps into a message."""
    topic, dot, rest = path.partition('.')
    steps = list(_STEP.finditer(dot + rest))
    if ''.join(step[0] for step in steps) != dot + rest:
        raise InputError(f'{path}: expected a message path of names, [number] and [:]')
    return topic, steps


def _follow(message: Any, steps: list[re.Match[str]], path: str) -> list[Any]:
    """Return everything that the steps of a path lead to."""
    found = [message]
    for step in steps:
        try:
            if step[1]:
                found = [getattr(each, step[1]) for each in found]
            elif step[2] == ':':
                found = [entry for each in found for entry in each]
            else:
                found = [each[int(step[2])] for each in found]
        except (AttributeError, IndexError) as error:
            raise InputError(f'{path}: expected such a field in the messages ({error})') from error
    return found


def _position_f(message: Any) -> Any:
    named = {each.child_frame_id.rpartition('/')[2]: each.transform for each in message.transforms}
    if not {'base_link', 'link_1'} <= set(named):
        return None
    base, arm = named['base_link'], named['link_1'].translation
    yaw = 2.0 * math.atan2(base.rotation.z, base.rotation.w)
    return SimpleNamespace(
        x=base.translation.x + arm.x * math.cos(yaw) - arm.y * math.sin(yaw),
        y=base.translation.y + arm.x * math.sin(yaw) + arm.y * math.cos(yaw),
    )


def _reference_f(message: Any) -> Any:
    layout, data = message.layout, message.data
    if len(layout.dim) < 3:
        return None  # a set-point
    samples = layout.dim[0]
    starts = [
        layout.data_offset + i * (samples.stride // samples.size)
        for i in range(0, samples.size, 10)
    ]
    return SimpleNamespace(
        points=[SimpleNamespace(x=data[start + 2], y=data[start + 3]) for start in starts]
    )


def _gains(message: Any) -> Any:
    values = json.loads(message.data)['parameters']
    return SimpleNamespace(**{name: values[name] for name in ('k_s1', 'k_s2', 'sigma', 'gamma')})


SCRIPTS: dict[str, Callable[[Any], Any]] = {
    '/masmc/position_f': _position_f,
    '/masmc/reference_f': _reference_f,
    '/masmc/gains': _gains,
}
"""The layout's scripts, by the topic that each makes; Foxglove runs them as TypeScript."""
