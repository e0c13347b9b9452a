# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
`masmc param`: parameters of running nodes, if the ros2 command is not installed.

Arguments and output are those of `ros2 param`; the exit status of a rejected value is 1.
"""

from __future__ import annotations

import argparse
import re
import sys
from typing import Any, TYPE_CHECKING

from masmc_ros.cli.arguments import add_json
from masmc_ros.errors import InputError, require_rclpy
from masmc_ros.params.blocks import complaint
from masmc_ros.params.file import parse_value
from masmc_ros.params.yaml_nodes import FileValue
from masmc_ros.result_text import json_text
import yaml

if TYPE_CHECKING:
    from masmc_ros.nodes.parameters.session import ParameterSession
    from rcl_interfaces.msg import ParameterValue


_REJECTED = 1
"""Exit status if a node rejects a value."""

_LONGEST_NAME = 200
"""Longest name of a node, whose services have longer names."""

_KINDS = {bool: 'Boolean', int: 'Integer', float: 'Double', str: 'String', bytes: 'Byte'}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = 'Read and set parameters of running nodes, as `ros2 param` does.'
    verbs = parser.add_subparsers(
        dest='verb', required=True, parser_class=type(parser), metavar='list|get|set|dump'
    )
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument(
        '--timeout',
        type=_seconds,
        default=5.0,
        metavar='S',
        help='longest time in s to wait for a node (%(default)g)',
    )
    add_json(common)
    for verb, text in (
        ('list', 'names of the parameters of a node, or of all'),
        ('get', 'the current value'),
        ('set', 'change a value'),
        ('dump', 'all values as a parameter file'),
    ):
        sub = verbs.add_parser(verb, parents=[common], help=text, description=f'Show {text}.')
        sub.add_argument('node', nargs='?' if verb == 'list' else None, help='such as /controller')
        if verb in ('get', 'set'):
            sub.add_argument('name', help='parameter, such as k_s1')
        if verb == 'set':
            sub.description = 'Change a value while the node runs.'
            # By default -1e-3 is an option.
            sub._negative_number_matcher = re.compile(r'-[.\d]')
            sub.add_argument('value', help='as in a parameter file: 150, [1.0, 2.0], smc')
        if verb == 'get':
            sub.add_argument('--hide-type', action='store_true', help='print the value alone')


def run(options: argparse.Namespace) -> int:
    """List, get, set or dump parameters; return the exit status."""
    require_rclpy()
    from masmc_ros.nodes.parameters.session import ParameterSession

    node = None if options.node is None else _node(options.node)
    value = _value(options.value) if options.verb == 'set' else None
    with ParameterSession(options.timeout) as session:
        if options.verb == 'list':
            return _list(session, node, is_json=options.json)
        # Only `list` has an optional node.
        assert node is not None
        if options.verb == 'get':
            if options.json:
                return _print_json(session, node, [options.name])
            return _get(session, node, options.name, hide_type=options.hide_type)
        if options.verb == 'set':
            return _set(session, node, options.name, value, is_json=options.json)
        if options.json:
            return _print_json(session, node, session.names(node))
        return _dump(session, node)


def _list(session: ParameterSession, node: str | None, *, is_json: bool) -> int:
    nodes = session.nodes() if node is None else [node]
    if is_json:
        print(json_text({'nodes': [{'node': n, 'names': session.names(n)} for n in nodes]}))
        return 0
    for listed in nodes:
        if node is None:
            print(f'{listed}:')
        for name in session.names(listed):
            print(f'  {name}')
    return 0


def _print_json(session: ParameterSession, node: str, names: list[str]) -> int:
    """Print the values of parameters as JSON, null for one without a value."""
    values = map(_plain, session.values(node, names))
    print(json_text({'node': node, 'parameters': dict(zip(names, values, strict=True))}))
    return 0


def _get(session: ParameterSession, node: str, name: str, *, hide_type: bool) -> int:
    value = _plain(session.values(node, [name])[0])
    if hide_type:
        print(value)
    elif value is None:
        print('Parameter not set.')
    elif isinstance(value, list):
        print(f'{_KINDS[type(value[0])]} values are:' if value else 'Values are:', value)
    else:
        print(f'{_KINDS[type(value)]} value is: {value}')
    return 0


def _set(
    session: ParameterSession, node: str, name: str, value: FileValue, *, is_json: bool
) -> int:
    from rclpy.parameter import Parameter

    kind = Parameter.Type.STRING_ARRAY if value == [] else None
    result = session.assign(node, Parameter(name, kind, value))
    if is_json:
        fields = {'node': node, 'name': name, 'value': value}
        print(json_text({**fields, 'is_set': result.successful, 'reason': result.reason}))
        return 0 if result.successful else _REJECTED
    reason = f': {result.reason}' if result.reason else ''
    if result.successful:
        print(f'Set parameter successful{reason}')
        return 0
    print(f'Setting parameter failed{reason}', file=sys.stderr)
    return _REJECTED


def _dump(session: ParameterSession, node: str) -> int:
    names = session.names(node)
    tree: dict[str, Any] = {}
    for name, value in zip(names, session.values(node, names), strict=True):
        plain = _plain(value)
        if plain is None or value.byte_array_value:
            print(f'{node}: {name} has no value that a file can contain', file=sys.stderr)
            continue
        *outer, last = name.split('.')
        if any('.'.join(outer[:i + 1]) in names for i in range(len(outer))):
            # In a file, a parameter with a value contains no others.
            outer, last = [], name
        block = tree
        for part in outer:
            block = block.setdefault(part, {})
        block[last] = plain
    print(yaml.dump({node: {'ros__parameters': tree}}, default_flow_style=None), end='')
    return 0


def _node(text: str) -> str:
    """Return a node's full name; InputError for an invalid one."""
    if '*' in text or complaint(text) or len(text) > _LONGEST_NAME:
        raise InputError(f"'{text}' is not the name of a node; write one such as /controller")
    return f'/{text.removeprefix("/")}'


def _value(text: str) -> FileValue:
    value = parse_value(text, f"value '{text}'")
    return [] if value is None else value


def _plain(value: ParameterValue) -> object:
    """Return a parameter's value as Python writes it."""
    from rclpy.parameter import parameter_value_to_python

    plain = parameter_value_to_python(value)
    return plain if plain is None or isinstance(plain, bool | int | float | str) else list(plain)


def _seconds(text: str) -> float:
    value = float(text)
    if not 0.0 < value < 3600.0:
        raise ValueError
    return value


_seconds.__name__ = 'time in s'  # in the messages of argparse
