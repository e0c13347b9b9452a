# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Blocks of a parameter file: the parameters below each node key, and the nodes of a key."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
import re

from masmc_ros.errors import InputError
from masmc_ros.params.yaml_nodes import compose, error_at, FileValue, line_of, value_of
import yaml

PARAMETERS_KEY = 'ros__parameters'


@dataclass(frozen=True)
class Block:
    """
    The parameters below one node key.

    Attributes
    ----------
    pattern
        the key, as in `controller`, `/left/controller`, `/**/controller` or `/**`.
    line
        the line on which it first appears, from 1.
    values
        value and line of every parameter by its dotted name, the last ones if the name is
        repeated. An empty array has no type: its value is None.

    """

    pattern: str
    line: int
    values: dict[str, tuple[FileValue, int]] = field(default_factory=dict)

    @property
    def is_shared(self) -> bool:
        """Return True if the key is a wildcard, which nodes of other packages read as well."""
        return is_wildcard(self.pattern)

    def is_for(self, name: str, namespace: str = '/') -> bool:
        """Return True if the block applies to a node."""
        return matches(self.pattern, qualified(name, namespace))


def read_blocks(data: bytes, source: str) -> tuple[Block, ...]:
    """
    Read the content of a parameter file.

    rcl reads the file of a node too. It joins names by `/` and `.` and later removes the last
    part of the joined name, not the key. A file in which this changes the meaning is an error
    here, as are files in which rcl loses values.

    Parameters
    ----------
    data
        the content.
    source
        names the file in messages.

    Returns
    -------
        The blocks in the order in which their keys first appear; blocks of one key are merged.

    Raises
    ------
    InputError
        not YAML, or not a parameter file.

    """
    reader = _BlockReader(source)
    root = compose(data, reader.place)
    if root is not None:
        reader.read_nodes(root)
    return tuple(reader.blocks.values())


class _BlockReader:
    """Reader of the nodes of a YAML document; `blocks` has the result by pattern."""

    def __init__(self, source: str) -> None:
        """Initialise the reader of a file with the name `source` in messages."""
        self.source = source
        self.blocks: dict[str, Block] = {}

    def place(self, line: int) -> str:
        """Return the name of a line of the file (from 1)."""
        return f'{self.source}:{line}'

    def _error(self, item: yaml.Node, message: str) -> InputError:
        return error_at(self.place, item, message)

    def read_nodes(self, parent: yaml.Node, path: str = '', line: int = 0) -> None:
        """
        Read the map below a namespace or a node name.

        Parameters
        ----------
        parent
            the map.
        path
            the keys above it, joined by slashes.
        line
            the line of the last of them, from 1.

        """
        if not isinstance(parent, yaml.MappingNode):
            content = (
                f"value '{parent.value}'" if isinstance(parent, yaml.ScalarNode) else 'array'
            )
            raise self._error(
                parent,
                f"{content} outside of {PARAMETERS_KEY}; write 'NODE:', below it "
                f"'{PARAMETERS_KEY}:' and below that 'name: value'",
            )
        has_parameters = False
        for key, child in self._pairs(parent):
            if has_parameters:
                problem = f"key '{key.value}' after {PARAMETERS_KEY}"
                remedy = f'write {PARAMETERS_KEY} as the last key of its node'
                raise self._error(key, f'{problem}; {remedy}')
            if key.value == PARAMETERS_KEY:
                has_parameters = True
                self._read_block(key, child, path, line)
                continue
            separator = '' if not path or path.endswith('/') else '/'
            if path and '/' in key.value:
                raise self._error(
                    key,
                    f"node name '{key.value}' below '{path}': it has a slash; write one name a "
                    f"level, or the full name '{path}{separator}{key.value}' at the first level",
                )
            self.read_nodes(child, path + separator + key.value, line_of(key))

    def _read_block(
        self, key: yaml.ScalarNode, parameters: yaml.Node, pattern: str, line: int
    ) -> None:
        if not pattern:
            remedy = "write 'NODE:' (or '/**:' for every node) one level up"
            raise self._error(key, f'{PARAMETERS_KEY} without a node name above it; {remedy}')
        if problem := complaint(pattern):
            raise InputError(
                f"{self.place(line)}: node name '{pattern}': {problem}; write a name such "
                'as controller, /left/controller, /**/controller or /**',
            )
        if not isinstance(parameters, yaml.MappingNode):
            raise self._error(parameters, f"no map below {PARAMETERS_KEY}; write 'name: value'")
        block = self.blocks.setdefault(pattern, Block(pattern, line))
        self._read_parameters(parameters, block.values)

    def _read_parameters(
        self,
        parent: yaml.MappingNode,
        values: dict[str, tuple[FileValue, int]],
        prefix: str = '',
    ) -> None:
        """Write the parameters of a map to `values`; `prefix` is the dotted name above."""
        for key, child in self._pairs(parent):
            name = prefix + key.value
            if not isinstance(child, yaml.MappingNode):
                values[name] = (value_of(child, name, self.place), line_of(key))
                continue
            if not child.value:
                problem = "an empty map; write '[]' for no value"
            elif name in values:
                problem = f'a map, and a value in line {values[name][1]}; write one of both'
            elif prefix and '.' in key.value:
                problem = 'a map below a map, with a dotted key; write one name a level'
            else:
                self._read_parameters(child, values, f'{name}.')
                continue
            raise self._error(key, f'{name} is {problem}')

    def _pairs(self, parent: yaml.MappingNode) -> Iterator[tuple[yaml.ScalarNode, yaml.Node]]:
        """Yield keys and values of a map whose keys are names."""
        for key, child in parent.value:
            if not isinstance(key, yaml.ScalarNode):
                raise self._error(key, "array or map in place of a name; write 'name: value'")
            if not key.value:
                raise self._error(key, "no name in front of ':'; write 'name: value'")
            yield key, child


_NODE_NAME_LIMIT = 255
_NAMESPACE_LIMIT = 245
_TOKEN = re.compile(r'[A-Za-z_][A-Za-z0-9_]*')
_WILDCARDS = ('*', '**')


def complaint(pattern: str) -> str:
    """
    Return the reason why rcl rejects a node name in a parameter file.

    Parameters
    ----------
    pattern
        the name with its namespace, as in `controller`, `/left/controller`,
        `/**/controller`, `/*` or `/**`.

    Returns
    -------
        The reason, '' for a valid name.

    """
    if pattern in ('/*', '/**'):
        return ''
    namespace, _, name = pattern.rpartition('/')
    # A pattern of one leading slash (or none) stands in the root namespace.
    tokens = namespace.removeprefix('/').split('/') if namespace else []
    for token in tokens:
        if not token:
            return 'it has two slashes in a row'
        if token not in _WILDCARDS and (problem := _token_complaint(token, _NAMESPACE_LIMIT - 1)):
            return problem
    if name in _WILDCARDS:
        return ''
    return _token_complaint(name, _NODE_NAME_LIMIT)


def _token_complaint(token: str, limit: int) -> str:
    if not token:
        return 'it ends with a slash'
    if not _TOKEN.fullmatch(token):
        return f"'{token}' is not made of letters, digits and _ with no digit first"
    if len(token) > limit:
        return f"'{token}' is longer than {limit} characters"
    return ''


def is_wildcard(pattern: str) -> bool:
    """Return True if a pattern applies to nodes of any name, such as `/**` and `/left/*`."""
    return pattern.rpartition('/')[2] in _WILDCARDS


def qualified(name: str, namespace: str = '/') -> str:
    """Join a namespace ('/', '/left' or 'left') and a node name to '/left/name'."""
    return '/'.join(('', *filter(None, namespace.split('/')), name))


def matches(pattern: str, qualified_name: str) -> bool:
    """
    Return True if a block of a parameter file applies to a node.

    Parameters
    ----------
    pattern
        the key of the block; `*` stands for one name, `**` for any number of them.
    qualified_name
        the node's name with its namespace, as in `/left/controller`.

    """
    absolute = pattern if pattern.startswith('/') else '/' + pattern
    # '/**' thereby becomes '(/\w+)*'.
    expression = absolute.replace('/*', r'(?:/\w+)')
    return re.fullmatch(expression, qualified_name, re.ASCII) is not None
