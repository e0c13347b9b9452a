# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
ROS 2 parameter files: the values that rcl reads from them, and text with such values.

Precedence is defaults, files in order, command line (`node_values`). A later value replaces an
earlier one, whether either is a number or an array. rcl keeps a number of one file next to an
array of another, and the number then applies. Therefore the nodes use this reading instead of
rcl's, and the offline commands use the same.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
import os
from pathlib import Path
from typing import TypeGuard

from masmc_ros.errors import InputError
from masmc_ros.params.blocks import Block, PARAMETERS_KEY, read_blocks
from masmc_ros.params.declaration import MutableValues, Values
from masmc_ros.params.text import yaml_text
from masmc_ros.params.yaml_nodes import compose, FileValue, value_of


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


EVERY = '/**'
"""Place of the values for all nodes."""

PATH_PARAMETERS = ('robot.urdf', 'file.path')
"""Parameters whose value may be a path; a relative one is relative to the parameter file."""


@dataclass(frozen=True)
class ParameterFile:
    """
    A parameter file.

    Attributes
    ----------
    path
        path of the file as the user wrote it.
    blocks
        blocks in the order in which their keys first appear, one per key.

    """

    path: str
    blocks: tuple[Block, ...]

    def for_node(self, name: str, namespace: str = '/') -> dict[str, FileValue]:
        """Return the values for a node, of several for a name the last in the matching blocks."""
        return {parameter: value for parameter, (value, _) in self._merged(name, namespace)}

    def places(self, name: str, namespace: str = '/') -> dict[str, str]:
        """Return the places of the values of `for_node`, 'path:line: ', for messages."""
        return {
            parameter: f'{self.path}:{line}: '
            for parameter, (_, line) in self._merged(name, namespace)
        }

    def shared(self, name: str, namespace: str = '/') -> set[str]:
        """Return names that apply to a node only by wildcards, and may be for other nodes."""
        blocks = [block for block in self.blocks if block.is_for(name, namespace)]
        own = {name for block in blocks if not block.is_shared for name in block.values}
        return {name for block in blocks if block.is_shared for name in block.values} - own

    def unmatched(self, names: Iterable[str], namespace: str = '/') -> tuple[Block, ...]:
        """Return the blocks that apply to none of these nodes."""
        nodes = tuple(names)
        return tuple(
            block
            for block in self.blocks
            if not any(block.is_for(name, namespace) for name in nodes)
        )

    def _merged(self, name: str, namespace: str) -> list[tuple[str, tuple[FileValue, int]]]:
        matching = [block for block in self.blocks if block.is_for(name, namespace)]
        # A key may appear twice, with a more specific key between; the last line applies.
        ascending = sorted(
            (item for block in matching for item in block.values.items()),
            key=lambda item: item[1][1],
        )
        return list(dict(ascending).items())


def read(path: str | os.PathLike[str]) -> ParameterFile:
    """
    Read a ROS 2 parameter file; its values are those that rcl's parser gives a node.

    Paths in it are relative to its folder.

    Raises
    ------
    InputError
        no such file, not readable, not YAML, or not a parameter file.

    """
    source = os.fspath(path)
    data = content_of(source)
    if is_urdf(data):
        raise InputError(
            f'{source} is a URDF; masmc robot {source} --write FILE.yaml writes a parameter file'
            ' for its robot'
        )
    return parsed(data, source)


def content_of(source: str) -> bytes:
    """Return the content of a parameter file; InputError if it cannot be read."""
    try:
        return Path(source).read_bytes()
    except FileNotFoundError:
        raise InputError(f'{source}: no such file; give the path of a parameter file') from None
    except IsADirectoryError:
        raise InputError(f'{source}: a directory; give the path of a parameter file') from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(
            f'{source}: not readable ({reason}); give the path of a readable parameter file'
        ) from None


def is_urdf(data: bytes) -> bool:
    """Return True for the content of a URDF, or of another XML file."""
    return data[:200].removeprefix(b'\xef\xbb\xbf').lstrip().startswith(b'<')


def parsed(data: bytes, source: str) -> ParameterFile:
    """Return the parameter file of a content, with paths relative to the folder of `source`."""
    folder = os.path.dirname(source)
    blocks = tuple(
        replace(block, values={n: (_located(n, v, folder), line)
                               for n, (v, line) in block.values.items()})
        for block in read_blocks(data, source)
    )  # fmt: skip
    return ParameterFile(source, blocks)


def _located(name: str, value: FileValue, folder: str) -> FileValue:
    """Return a value of a parameter; a relative path with the folder of the file."""
    return os.path.join(folder, value) if is_path(value, name) else value


def anywhere(values: Values) -> MutableValues:
    """Return the paths among values as absolute ones, for a file in another folder."""
    return {n: os.path.abspath(v) for n, v in values.items() if is_path(v, n)}


def is_path(value: object, name: str) -> TypeGuard[str]:
    """Return True for a path of a parameter: no URI, no text of a URDF, none of a home folder."""
    if name not in PATH_PARAMETERS or not isinstance(value, str) or not value:
        return False
    return not ('://' in value or value.lstrip().startswith('<') or value.startswith('~'))


def parse_value(text: str, source: str = '') -> FileValue:
    """
    Return the typed value of a command line, as `-p NAME:=VALUE` does.

    Parameters
    ----------
    text
        a scalar (`150`, `1.0`, `rasmc`) or an array (`[150.0, 80.0]`).
    source
        name of the value in messages.

    Raises
    ------
    InputError
        empty, not YAML, a map, or an array of several types.

    """
    name = source or repr(text)
    if not text:
        raise InputError(f"{name}: no value; write one ('' for an empty string)")
    root = compose(text.encode('utf-8', 'surrogateescape'), lambda _: name)
    return None if root is None else value_of(root, 'it', lambda _: name)


def parameter_file_text(nodes: Mapping[str, Values], comments: Iterable[str]) -> str:
    """
    Return a ROS 2 parameter file for any namespace.

    Parameters
    ----------
    nodes
        Values by node, or by EVERY for all nodes, and by name; relative paths become absolute.
    comments
        Lines of comments at the start of the file.

    """
    lines = [f'# {comment}' for comment in comments]
    for node, values in nodes.items():
        lines += [f'{EVERY}:' if node == EVERY else f'{EVERY}/{node}:', f'  {PARAMETERS_KEY}:']
        placed = {**values, **anywhere(values)}
        lines += [f'    {name}: {yaml_text(value)}' for name, value in placed.items()]
    return '\n'.join(lines) + '\n'
