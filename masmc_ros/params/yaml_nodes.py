# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""YAML documents as nodes with line numbers, the values of nodes, and errors with their place."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from masmc_ros.errors import InputError
from masmc_ros.params.text import Scalar, typed
import yaml

Place = Callable[[int], str]
"""Text in front of a message about a line (from 1): 'path:line', or an option."""

# libyaml, which rcl uses too, if PyYAML was built with it.
_LOADER: Any = getattr(yaml, 'CBaseLoader', yaml.BaseLoader)

_DEPTH = 50
"""Maximum number of maps and arrays inside each other; libyaml's composer has no limit."""


def compose(data: bytes, place: Place) -> yaml.Node | None:
    """
    Compose the document of a YAML stream (UTF-8, or UTF-16 with a byte order mark).

    Parameters
    ----------
    data
        the stream.
    place
        names a line of it in messages.

    Returns
    -------
        The root, None for a stream without content. A node's tag is None unless it is written.

    Raises
    ------
    InputError
        not text, not YAML, an alias, a second document or too many levels.

    """
    root: yaml.Node | None = None
    events = yaml.parse(data, Loader=_LOADER)
    try:
        for event in events:
            if isinstance(event, yaml.NodeEvent):
                root = _node(event, events, place, 0)
            elif isinstance(event, yaml.DocumentStartEvent) and root is not None:
                raise error_at(place, event, 'second document; write one document, without ---')
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
    return root


def _node(start: Any, events: Iterator[yaml.Event], place: Place, depth: int) -> yaml.Node:
    """Compose the node that an event starts from the events that follow it."""
    if isinstance(start, yaml.AliasEvent):
        raise error_at(
            place,
            start,
            f'alias *{start.anchor}: parameter files have no aliases; write the value out',
        )
    tag: Any = start.tag
    mark: Any = start.start_mark
    if isinstance(start, yaml.ScalarEvent):
        if '\0' in start.value:
            raise error_at(place, start, 'NUL character in a string; remove it')
        return yaml.ScalarNode(tag, start.value, mark, style=start.style)
    if depth == _DEPTH:
        raise error_at(place, start, f'more than {_DEPTH} levels; write a flat map or array')
    children = []
    while not isinstance(child := next(events), yaml.CollectionEndEvent):
        children.append(_node(child, events, place, depth + 1))
    if isinstance(start, yaml.SequenceStartEvent):
        return yaml.SequenceNode(tag, children, mark)
    pairs = list(zip(children[::2], children[1::2], strict=True))
    return yaml.MappingNode(tag, pairs, mark)


def line_of(item: yaml.Node | yaml.Event) -> int:
    """Return the line on which a node or an event starts, from 1."""
    return item.start_mark.line + 1 if item.start_mark else 1


def error_at(place: Place, item: yaml.Node | yaml.Event, message: str) -> InputError:
    """Return the error about a node or an event, with its place."""
    return InputError(f'{place(line_of(item))}: {message}')


FileValue = Scalar | list[bool] | list[int] | list[float] | list[str] | None

_STRING_TAG = 'tag:yaml.org,2002:str'
_TYPE_NAMES = {bool: 'a bool', int: 'an integer', float: 'a double', str: 'a string'}


def value_of(node: yaml.Node, name: str, place: Place) -> FileValue:
    """
    Return the value of a node.

    Parameters
    ----------
    node
        a scalar or an array.
    name
        the parameter, for messages.
    place
        names a line in messages.

    Returns
    -------
        None for an empty array, which has no type.

    Raises
    ------
    InputError
        no value, a map, or an array of several types or of arrays.

    """
    if isinstance(node, yaml.ScalarNode):
        return _scalar(node, name, place)
    if not isinstance(node, yaml.SequenceNode):
        raise error_at(place, node, f'{name} is a map; write one value or an array')
    values: list[Any] = []
    for entry in node.value:
        if not isinstance(entry, yaml.ScalarNode):
            kind = 'an array' if isinstance(entry, yaml.SequenceNode) else 'a map'
            raise error_at(
                place, entry, f'{name} has {kind} in an array; write one array of scalars'
            )
        value = _scalar(entry, name, place)
        if values and type(value) is not type(values[0]):
            raise error_at(
                place,
                entry,
                f'{name} has {_TYPE_NAMES[type(value)]} ({entry.value}) in an array that starts '
                f'with {_TYPE_NAMES[type(values[0])]}; write all its entries as one '
                'type (doubles with a point: 1.0)',
            )
        values.append(value)
    return values or None


def _scalar(node: yaml.ScalarNode, name: str, place: Place) -> Scalar:
    """Return the typed value of a scalar; quotes and the tag !!str make it a string."""
    if node.style in ("'", '"'):
        return str(node.value)
    if not node.value:
        raise error_at(place, node, f"no value for {name}; write one ('' for an empty string)")
    return str(node.value) if node.tag == _STRING_TAG else typed(node.value)
