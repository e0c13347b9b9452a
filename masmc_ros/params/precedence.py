# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Precedence of parameter values: defaults, files in order, command line.

A later value replaces an earlier one, whether either is a number or an array. rcl keeps a
number of one file next to an array of another, and the number then applies. Therefore the
nodes use this reading instead of rcl's, and the offline commands use the same.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from masmc_ros.params.file import ParameterFile
from masmc_ros.params.values import FileValue


@dataclass(frozen=True)
class NodeValues:
    """
    Values for one node from files and the command line, without defaults.

    Attributes
    ----------
    values
        value by parameter name; None for an empty array, which has no type.
    places
        place of each value of a file, as 'path:line: ' in front of a message.
    shared
        names that apply to the node only by wildcards such as `/**`, and may be for other
        nodes.

    """

    values: dict[str, FileValue]
    places: dict[str, str]
    shared: frozenset[str]


def node_values(
    files: Iterable[ParameterFile],
    settings: Mapping[str, FileValue],
    name: str,
    namespace: str = '/',
) -> NodeValues:
    """
    Return the active values of a node.

    Parameters
    ----------
    files
        parameter files in the order of the command line.
    settings
        values of the command line by parameter name; they replace those of all files.
    name
        the node's name.
    namespace
        the node's namespace.

    """
    values: dict[str, FileValue] = {}
    places: dict[str, str] = {}
    shared: set[str] = set()
    addressed = set(settings)
    for file in files:
        of_file = file.for_node(name, namespace)
        by_wildcard = file.shared(name, namespace)
        values.update(of_file)
        places.update(file.places(name, namespace))
        shared |= by_wildcard
        addressed |= of_file.keys() - by_wildcard
    for setting in settings:
        places.pop(setting, None)
    return NodeValues({**values, **settings}, places, frozenset(shared - addressed))
