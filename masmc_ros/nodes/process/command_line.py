# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Parameters of a ROS command line: files, and settings that replace their values.

rcl has other rules, which depend on the type of a value. For example, a number of one file
survives an array of the next one. A block for the node in a file replaces an unprefixed
`-p name:=value`. The nodes use the values of `CommandLine.for_node` (see `params/file.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from masmc_ros.errors import InputError
from masmc_ros.params.file import node_values, NodeValues, ParameterFile, parse_value, read
from masmc_ros.params.yaml_nodes import FileValue
from masmc_ros.scenario.node_parameters import with_posture


@dataclass(frozen=True)
class Setting:
    """One `-p [NODE:]NAME:=VALUE`."""

    node: str
    """Name of the node; empty: all nodes of the process."""
    name: str
    value: FileValue


@dataclass(frozen=True)
class CommandLine:
    """The parameter files and settings among ROS arguments, each in their order."""

    files: tuple[ParameterFile, ...] = ()
    settings: tuple[Setting, ...] = field(default=())

    def for_node(self, node: str, namespace: str = '/') -> NodeValues:
        """Return the values for a node; the last setting of a name replaces the others."""
        own, plant = self._stated(node, namespace), self._stated('plant', namespace)
        return replace(own, values=with_posture(own.values, plant.values))

    def _stated(self, node: str, namespace: str) -> NodeValues:
        settings = {s.name: s.value for s in self.settings if s.node in ('', node)}
        return node_values(self.files, settings, node, namespace)


def parse(arguments: Sequence[str]) -> CommandLine:
    """
    Read a command line.

    Raises InputError for a file or a setting that cannot be read, and for any argument that is
    not a ROS argument.
    """
    paths: list[str] = []
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
            paths.append(next(iterator, ''))
        elif argument in ('-p', '--param'):
            settings.append(_setting(next(iterator, '')))
    if '' in paths:
        raise InputError('--params-file: no file; give the path of a parameter file')
    return CommandLine(tuple(map(read, paths)), tuple(settings))


def _setting(text: str) -> Setting:
    target, assigned, value = text.partition(':=')
    node, _, name = target.rpartition(':')
    if not assigned or not name:
        raise InputError(f'-p {text}: expected NAME:=VALUE, as in k_s1:=150.0')
    return Setting(node, name, parse_value(value, f'-p {text}'))
