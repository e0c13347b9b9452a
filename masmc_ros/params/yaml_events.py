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

"""YAML as the stream of events that rcl's parser sees, and refusals with their place."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from masmc_ros.errors import InputError
import yaml

Place = Callable[[int], str]
"""What stands in front of a message about a line (from 1): 'path:line', or an option."""

# libyaml, which rcl uses too, where PyYAML was built with it.
_LOADER: Any = getattr(yaml, 'CBaseLoader', yaml.BaseLoader)


def yaml_events(data: bytes, place: Place) -> Iterator[yaml.Event]:
    """
    Parse YAML (UTF-8, or UTF-16 with a byte order mark) into events.

    Raises
    ------
    InputError
        not YAML, or not text.

    """
    try:
        yield from yaml.parse(data, Loader=_LOADER)
    except yaml.reader.ReaderError as error:
        line = data[: error.position].count(b'\n') + 1
        raise InputError(
            f'{place(line)}: not text in UTF-8 ({error.reason}); write it in UTF-8'
        ) from None
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        problem = ', '.join(filter(None, (error.context, error.problem)))
        raise InputError(
            f'{place(line)}: not YAML: {problem}; check indentation, colons, brackets and quotes'
        ) from None


def line_of(event: yaml.Event) -> int:
    """Line on which an event starts, counted from 1."""
    return event.start_mark.line + 1 if event.start_mark else 1


def c_string(text: str) -> str:
    """Cut a string where C does: at its first NUL."""
    return text.partition('\0')[0]
