# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Values of parameters: scalars and arrays of one type."""

from __future__ import annotations

from typing import Any

from masmc_ros.params.scalar import Scalar, typed
from masmc_ros.params.yaml_nodes import error_at, Place
import yaml

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
