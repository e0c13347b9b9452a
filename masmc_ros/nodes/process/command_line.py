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

"""
What a ROS command line says about parameters: files, and settings that win over them.

rcl keeps an unprefixed `-p name:=value` with the block `/**` of a file, where a block for
the node itself wins over it. Read here, the command line has the last word.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.params.file import parse_value, read


@dataclass(frozen=True)
class Setting:
    """One `-p [NODE:]NAME:=VALUE`."""

    node: str
    """Name of the node it is for; empty: all nodes of the process."""
    name: str
    value: Any


@dataclass(frozen=True)
class CommandLine:
    """The parameter files and settings among ROS arguments."""

    files: tuple[str, ...] = ()
    settings: tuple[Setting, ...] = field(default=())

    def for_node(self, node: str) -> dict[str, Any]:
        """Return the settings for a node, the last of a name winning."""
        return {s.name: s.value for s in self.settings if s.node in ('', node)}


def parse(arguments: Sequence[str]) -> CommandLine:
    """
    Read a command line.

    Raises InputError for a file or a setting that cannot be read, and for arguments that are
    none of ROS: nodes take no others.
    """
    files: list[str] = []
    settings: list[Setting] = []
    in_ros = False
    iterator = iter(arguments)
    for argument in iterator:
        if argument == '--ros-args':
            in_ros = True
        elif argument == '--' and in_ros:
            in_ros = False
        elif not in_ros:
            raise InputError(
                f"argument '{argument}' is unknown; parameters and remappings follow --ros-args, "
                'as in --ros-args --params-file FILE -p NAME:=VALUE'
            )
        elif argument == '--params-file':
            files.append(next(iterator, ''))
        elif argument in ('-p', '--param'):
            settings.append(_setting(next(iterator, '')))
    for path in files:
        if not path:
            raise InputError('--params-file: no file; give the path of a parameter file')
        read(path)
    return CommandLine(tuple(files), tuple(settings))


def _setting(text: str) -> Setting:
    target, assigned, value = text.partition(':=')
    node, _, name = target.rpartition(':')
    if not assigned or not name:
        raise InputError(f'-p {text}: expected NAME:=VALUE, as in k_s1:=150.0')
    return Setting(node, name, parse_value(value, f'-p {text}'))
