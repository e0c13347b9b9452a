# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Accepted parameter files against the values that rcl reads.

One difference is intended and tested by test_precedence.py: a repeated parameter has its later
value for all types. Files with such parameters are not compared.
"""

from collections.abc import Iterator
from pathlib import Path
import re
from typing import Any

from hypothesis import example, given, HealthCheck, settings
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.params import blocks
from masmc_ros.params.blocks import Block
from masmc_ros.params.file import ParameterFile, parse_value, read
from masmc_ros.params.yaml_nodes import FileValue
import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node

DOMAIN = 87
NODES = (('controller', '/'), ('controller', '/left'), ('plant', '/left/arm'))

# Every example starts a real node; the first one of a context takes longest.
EXAMPLES = settings(
    max_examples=150,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


class RepeatedTypeError(Exception):
    """A parameter is repeated with a value of another type."""


class OneType(dict[str, tuple[FileValue, int]]):
    """Values of a block; a repeated name must keep its type."""

    def __setitem__(self, name: str, item: tuple[FileValue, int]) -> None:
        """Write the value and the line of a name."""
        if name in self and kind(self[name][0]) != kind(item[0]):
            raise RepeatedTypeError
        super().__setitem__(name, item)


def kind(value: FileValue) -> object:
    return ('array', type(value[0])) if isinstance(value, list) else type(value)


@pytest.fixture(scope='module', autouse=True)
def one_type() -> Iterator[None]:
    """Detect the files that are not compared."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(blocks, 'Block', lambda *arguments: Block(*arguments, OneType()))
        yield


def by_keys(parameters: ParameterFile, name: str, namespace: str) -> dict[str, FileValue]:
    """Return a node's values merged as in rcl: keys in the order of first appearance."""
    merged: dict[str, FileValue] = {}
    for block_ in parameters.blocks:
        if block_.is_for(name, namespace):
            merged.update({key: value for key, (value, _) in block_.values.items()})
    return merged


@pytest.fixture(scope='module')
def context() -> Iterator[Context]:
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
        context = Context()
        rclpy.init(args=[], context=context, domain_id=DOMAIN)
        try:
            yield context
        finally:
            rclpy.shutdown(context=context)


def overrides(context: Context, name: str, namespace: str, *arguments: str) -> dict[str, str]:
    """Return the parameters that a real node receives from its ROS arguments."""
    node = Node(
        name,
        namespace=namespace,
        context=context,
        cli_args=['--ros-args', *arguments],
        use_global_arguments=False,
        start_parameter_services=False,
        enable_rosout=False,
    )
    try:
        # Declaring them automatically fails for those without a value (`a: []`).
        return comparable({name: p.value for name, p in node._parameter_overrides.items()})
    finally:
        node.destroy_node()  # type: ignore[no-untyped-call]


def comparable(values: dict[str, Any]) -> dict[str, str]:
    """Return the values as texts that distinguish 1, 1.0 and true; NaN equals itself."""
    return {
        name: repr(value if value is None or isinstance(value, (str, int, float)) else list(value))
        for name, value in values.items()
    }


def assert_same(context: Context, path: Path) -> bool:
    """Compare an accepted file with real nodes; return True if the file is accepted."""
    try:
        parameters = read(path)
    except InputError:
        return False
    for name, namespace in NODES:
        real = overrides(context, name, namespace, '--params-file', str(path))
        assert comparable(by_keys(parameters, name, namespace)) == real
    return True


def block(body: str, key: str = '/**') -> str:
    lines = ''.join(f'    {line}\n' for line in body.splitlines())
    return f'{key}:\n  ros__parameters:\n{lines}'


ACCEPTED = {
    'empty': '',
    'comment': '# nothing\n',
    'no blocks': '{}\n',
    'node without a map of parameters': 'controller: {}\n',
    'flow style': '/**: {ros__parameters: {a: 1.0, b: [x, z]}}\n',
    'json': '{"/**": {"ros__parameters": {"a": 1.0, "b": [true, false]}}}\n',
    'byte order mark': '\ufeff' + block('a: 1'),
    'windows line ends': block('a: 1\nb: x').replace('\n', '\r\n'),
    'unicode': block('a: 5 µm\nb: "\\U0001F600"'),
    'names with dots': block('a.b: 1\nc:\n  d.e: 2\n  f:\n    g: 3\nh: 4'),
    'same name twice': block('a: 1\na: 2'),
    'same key twice': block('a: 1\nb: 1') + block('a: 2', 'controller') + block('a: 3\nb: 3'),
    'last block wins': block('a: 1', 'controller') + block('a: 2') + block('a: 3', '/left/*'),
    'keys of all kinds': ''.join(
        block(f'p{number}: {number}', key)
        for number, key in enumerate(
            (
                '/**',
                '/*',
                '"**"',
                '"*"',
                'controller',
                '/controller',
                '/**/controller',
                '/*/controller',
                '/left/controller',
                'left/controller',
                '/left/**',
                '/left/*',
                '/left/**/plant',
                '/left/*/plant',
                '/*/arm/plant',
                '/**/arm/**',
                '/right/controller',
                'control',
            )
        )
    ),
    'nested namespaces': (
        '/left:\n  controller:\n    ros__parameters: {a: 1}\n  arm:\n    plant:\n'
        '      ros__parameters: {a: 2}\n'
    ),
    'root namespace': '/:\n  controller:\n    ros__parameters: {a: 1}\n',
    'wildcard namespace': '/**:\n  controller:\n    ros__parameters: {a: 1}\n',
    'two names in one key': (
        'left/arm:\n  plant:\n    ros__parameters: {a: 1}\n'
        'left:\n  controller:\n    ros__parameters: {a: 2}\n'
    ),
    'same name dotted and nested': block('a.b: 1\na:\n  b: 2'),
    'same name nested and dotted': block('a:\n  b: 1\na.b: 2'),
    'no parameters': block('{}'),
    'node below another before its block': (
        'left:\n  controller:\n    ros__parameters: {a: 1}\n  ros__parameters: {b: 1}\n'
    ),
    'merge key without an alias': block('<<: {a: 1}'),
    'empty array': block('a: []\nb: 1'),
    'block array': block('a:\n- 1.0\n- 2.0'),
    'anchor without alias': block('a: &x 1.0'),
    'tags': block('a: !!str 5\nb: !!int "5"\nc: !!float 5\nd: [!!str 1, x]\ne: !local 5'),
    'text over lines': block('a: |\n  1\nb: |-\n  1\nc: >-\n  x\n  y\nd: "x\n  y"'),
    'bools': block(
        '\n'.join(
            f'p{n}: {text}'
            for n, text in enumerate(['y', 'Y', 'yes', 'on', 'TRUE', 'n', 'no', 'Off'])
        )
    ),
    'not bools': block('a: oN\nb: "on"\nc: yEs\nd: t\ne: ~\nf: null'),
    '1000 parameters': block('\n'.join(f'p{number}: {number}' for number in range(1000))),
    '300 nodes': ''.join(block('a: 1', f'node_{number}') for number in range(300)) + block('b: 1'),
    'long names': block('a: 1', f'/{"n" * 244}/{"c" * 255}'),
}

ERRORS_ONLY_HERE = {
    'scalar document': 'controller\n',
    'name above a dotted one keeps too little': block('a:\n  b.c:\n    d: 1\n  e: 2'),
    'value replaced by a map': block('a: 1\na:\n  b: 2'),
    'any key that starts with ros__parameters': '/**:\n  ros__parameters_old:\n    a: 1\n',
    'two documents': block('a: 1') + '---\n' + block('b: 2', 'controller'),
    'empty map': block('a: 1\nb: {}'),
    'array in an array': block('a: [[1, 2]]'),
    'array in an array, first type counts': block('a: [1, [2.0, 3.0]]'),
    'array in an array, other value': block('a: [1, [2, 3]]'),
    'name after an array in an array': block('a: [[1], 5]'),
    'map in an array': block('a: [{b: 1}]'),
    'maps in an array': block('a: [{b: 1}, {b: 2}]'),
    'maps in an array, other name': block('a: [{b: 1}, {c: 2}]'),
    'NUL ends a text': block('a: "x\\0y"\n"b\\0c": 1'),
    'slash below a namespace': 'left:\n  arm/plant:\n    ros__parameters: {a: 1}\n',
}
"""Files that rcl accepts without a clear meaning, or with lost values."""

REJECTED = {
    'no node': 'ros__parameters:\n  a: 1\n',
    'no ros__parameters': 'controller:\n  a: 1\n',
    'no ros__parameters, array': 'controller:\n  a: [1]\n',
    'nothing below the node': 'controller:\n',
    'nothing below ros__parameters': 'controller:\n  ros__parameters:\n',
    'two blocks in one key': 'a:\n  ros__parameters: {b: 1}\n  c:\n    ros__parameters: {d: 1}\n',
    'array document': '[1, 2]\n',
    'empty document': '---\n',
    'no value': block('a:'),
    'no value in an array': block('a:\n-\n- 1'),
    'no name': block('"": 1'),
    'alias': block('a: &x 1\nb: *x'),
    'merge key': '/**: &x\n  ros__parameters: {a: 1}\ncontroller:\n  <<: *x\n',
    'two types in an array': block('a: [1, 2.0]'),
    'bool and text in an array': block('a: [yes, maybe]'),
    'two arrays in an array': block('a: [[1, 2], [3, 4]]'),
    'array as a name': block('? [1, 2]\n: 3'),
    'name after an empty map': block('a: {}\nb: 1'),
    'hyphen in a node name': block('a: 1', 'the-node'),
    'digit first': block('a: 1', '1node'),
    'digit first in the namespace': block('a: 1', '/1ns/node'),
    'half a wildcard': block('a: 1', 'control*'),
    'two slashes': block('a: 1', '//node'),
    'two slashes, nested': '/left:\n  /node:\n    ros__parameters: {a: 1}\n',
    'ends with a slash': block('a: 1', '/left/'),
    'only a slash': block('a: 1', '/'),
    'spaces in a name': block('a: 1', 'the node'),
    'node name too long': block('a: 1', 'c' * 256),
    'namespace too long': block('a: 1', f'/{"n" * 245}/c'),
    'tabs': '/**:\n\tros__parameters:\n\t\ta: 1\n',
    'open bracket': block('a: [1, 2'),
    'unknown tag handle': block('a: !e!x 1'),
    'colon in a plain text': block('a: b: c'),
}


@pytest.mark.parametrize('text', ACCEPTED.values(), ids=ACCEPTED.keys())
def test_parameter_file_accepted_values_equal_rcl(
    context: Context, tmp_path: Path, text: str
) -> None:
    path = tmp_path / 'run.yaml'
    path.write_bytes(text.encode())
    assert assert_same(context, path)


@pytest.mark.parametrize('text', REJECTED.values(), ids=REJECTED.keys())
def test_parameter_file_rejected_is_rejected_by_rcl(
    context: Context, tmp_path: Path, text: str
) -> None:
    path = tmp_path / 'run.yaml'
    path.write_bytes(text.encode())
    assert not assert_same(context, path)
    with pytest.raises(rclpy._rclpy_pybind11.RCLError):
        overrides(context, 'controller', '/', '--params-file', str(path))


@pytest.mark.parametrize('text', ERRORS_ONLY_HERE.values(), ids=ERRORS_ONLY_HERE.keys())
def test_parameter_file_unclear_meaning_raises(tmp_path: Path, text: str) -> None:
    path = tmp_path / 'run.yaml'
    path.write_bytes(text.encode())
    with pytest.raises(InputError, match=r'run\.yaml:\d+: .*; '):
        read(path)


@pytest.mark.parametrize(
    ('data', 'accepted'),
    [
        (block('a: é').encode('utf-16'), True),
        (block('a: é').encode('latin-1'), False),
        (block('a: "\x01"').encode(), False),
    ],
)
def test_parameter_file_encoding_is_accepted_as_in_rcl(
    context: Context, tmp_path: Path, data: bytes, accepted: bool
) -> None:
    path = tmp_path / 'run.yaml'
    path.write_bytes(data)
    assert assert_same(context, path) is accepted


@pytest.mark.parametrize('name', ['.', 'missing.yaml'])
def test_parameter_file_missing_is_rejected(context: Context, tmp_path: Path, name: str) -> None:
    assert not assert_same(context, tmp_path / name)


def test_parameter_file_of_process_values_equal_rcl(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file applies to the whole process: `ros2 run … --ros-args --params-file …`."""
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    path = tmp_path / 'run.yaml'
    path.write_text(block('a: 1\nb: 2') + block('b: 3.0', '/**/controller'))
    context = Context()
    rclpy.init(args=['--ros-args', '--params-file', str(path)], context=context, domain_id=DOMAIN)
    try:
        for name, namespace in NODES:
            node = Node(
                name,
                namespace=namespace,
                context=context,
                start_parameter_services=False,
                enable_rosout=False,
                automatically_declare_parameters_from_overrides=True,
            )
            expected = read(path).for_node(name, namespace)
            got = {parameter: node.get_parameter(parameter).value for parameter in expected}
            node.destroy_node()  # type: ignore[no-untyped-call]
            assert comparable(got) == comparable(expected)
    finally:
        rclpy.shutdown(context=context)


def test_parameter_file_of_process_rejected_by_rcl(tmp_path: Path) -> None:
    path = tmp_path / 'run.yaml'
    path.write_text(REJECTED['two types in an array'])
    with pytest.raises(InputError):
        read(path)
    with pytest.raises(rclpy._rclpy_pybind11.RCLError):
        rclpy.init(
            args=['--ros-args', '--params-file', str(path)], context=Context(), domain_id=DOMAIN
        )


_NUMBER_LIKE = st.one_of(
    st.text('0123456789abcdefxXpPeE+-._ infINFNATY()', min_size=1, max_size=14),
    st.integers().map(str),
    st.integers(-(2**65), 2**65).map(hex),
    st.floats().map(repr),
    st.floats(0.0, 1e-300).map(repr),
    st.floats(1e-300, 1e-290).map(float.hex),
    st.floats(allow_nan=False, allow_subnormal=False).map(float.hex),
    st.from_regex(r'[+-]?[0-9]{1,5}(\.[0-9]{0,5})?([eE][+-]?[0-9]{1,3})?', fullmatch=True),
    st.from_regex(r'[+-]?0x[0-9a-f]{1,4}(\.[0-9a-f]{0,4})?([pP][+-]?[0-9]{1,4})?', fullmatch=True),
)


@pytest.mark.slow
@EXAMPLES
@given(st.lists(_NUMBER_LIKE, min_size=1, max_size=20))
@example(['5e-324', '0x1p-1075', '1e-309', '0e-999', '-0', '-0.0', '00000000000000000000007'])
@example(['2.2250738585072014e-308', '2.225073858507201e-308', '1.7976931348623159e308'])
@example(['9223372036854775807', '9223372036854775808', '-9223372036854775808', '08', '0x', '0b1'])
@example(['nan(', '-nan', 'Infinity', '+inf', 'infin', '.nan', '-.nan'])
@example(['\t1', '1\t', ' 1', '\x0b1', '1_0', '+ 1', '--1', '.', '.e1', '0x.p1', '0x.8', '1.e1'])
def test_parameter_file_random_scalars_equal_rcl(
    context: Context, tmp_path: Path, texts: list[str]
) -> None:
    # A literal with an indentation indicator is not quoted and keeps leading blanks.
    # Hexadecimal subnormals that are exact and NaN with a payload are strings here.
    texts = [text for text in texts if not re.search(r'nan\(|0x.*p-10[2-9]', text, re.IGNORECASE)]
    path = tmp_path / 'run.yaml'
    path.write_text(block('\n'.join(f'p{n}: |1-\n {text}' for n, text in enumerate(texts))))
    # A control character may be rejected.
    assert assert_same(context, path) or not ''.join(texts).isprintable()


_NAMES = st.sampled_from(
    ('a', 'b', 'a.b', 'a.b.c', '"c\\0"', '5', 'ros__parameters', '""', '!!str a', '[a]', '*x')
)
_NODE_KEYS = st.sampled_from(
    ('controller', '/controller', '/**', '/left', 'left', '/left/controller', '/**/controller',
     '/', '**', '*', '/*/controller', 'arm', 'plant', 'left/arm', 'ros__parameters', 'x-y')
)  # fmt: skip
_FLOW_SCALARS = st.sampled_from(
    ('1', '2', '1.5', 'true', 'x', '"1"', "''", '!!str 1', '~', '.nan', '&x 3', '*x', '1e999')
)


def _flow(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    arrays = st.lists(inner, max_size=3).map(lambda entries: f'[{", ".join(entries)}]')
    pairs = st.tuples(_NAMES, inner).map(': '.join)
    return arrays | st.lists(pairs, max_size=2).map(lambda entries: f'{{{", ".join(entries)}}}')


_TANGLED = st.recursive(_FLOW_SCALARS, _flow, max_leaves=8)
_TANGLED_BLOCKS = st.tuples(st.just('ros__parameters'), _TANGLED).map(': '.join)
_TANGLED_NODES = st.tuples(_NODE_KEYS, _TANGLED_BLOCKS.map('{{{}}}'.format)).map(': '.join)
_TANGLED_SPACES = st.tuples(_NODE_KEYS, _TANGLED_NODES.map('{{{}}}'.format)).map(': '.join)
_TANGLED_FILES = st.lists(_TANGLED_NODES | _TANGLED_SPACES, min_size=1, max_size=4).map(
    lambda nodes: ''.join(f'{node}\n' for node in nodes)
)


@pytest.mark.slow
@EXAMPLES
@given(_TANGLED_FILES | _TANGLED)
def test_parameter_file_random_structure_equals_rcl(
    context: Context, tmp_path: Path, text: str
) -> None:
    path = tmp_path / 'run.yaml'
    path.write_text(text)
    try:
        assert_same(context, path)
    except RepeatedTypeError:
        return


_WORDS = st.sampled_from(('1', '-2', '0x1F', '1.5', '.inf', '1e3', 'true', 'off', 'x', '"1"', '~'))
_SAME_TYPE = st.sampled_from((('1', '02'), ('1.5', '1e3'), ('on', 'no'), ('x', "'1'", '1_0')))
_VALUES = _WORDS | _SAME_TYPE.flatmap(
    lambda texts: st.lists(st.sampled_from(texts), max_size=3).map(
        lambda entries: f'[{", ".join(entries)}]'
    )
)


def _maps(values: st.SearchStrategy[str], size: int = 1) -> st.SearchStrategy[str]:
    return st.dictionaries(st.sampled_from('abcdef'), values, min_size=size, max_size=4).map(
        lambda pairs: '{' + ', '.join(f'{name}: {value}' for name, value in pairs.items()) + '}'
    )


_PARAMETERS = _maps(_VALUES | _maps(_VALUES | _maps(_VALUES)), 0).map(
    '{{ros__parameters: {}}}'.format
)
_KEYS = ('controller', '/controller', '/**', '*', '/left/controller', '/**/controller', 'left/arm')
_WELL_FORMED = st.dictionaries(
    st.sampled_from(_KEYS) | st.just('/left/arm'),
    _PARAMETERS | st.dictionaries(st.sampled_from(('plant', 'arm')), _PARAMETERS, max_size=2).map(
        lambda nodes: '{' + ', '.join(f'{name}: {node}' for name, node in nodes.items()) + '}'
    ),
    max_size=5,
)


@pytest.mark.slow
@settings(EXAMPLES, max_examples=300)
@given(_WELL_FORMED)
def test_parameter_file_random_well_formed_equals_rcl(
    context: Context, tmp_path: Path, nodes: dict[str, str]
) -> None:
    path = tmp_path / 'run.yaml'
    path.write_text(''.join(f'"{key}": {node}\n' for key, node in nodes.items()))
    assert assert_same(context, path)


@EXAMPLES
@given(_TANGLED | st.text('019.,:[]{}"\'-ex #\n', max_size=8))
@example('')
@example('[]')
@example('# only a comment')
@example('[1, 2.0]')
@example('[[1], [2]]')
@example('[[1.0], 2]')
def test_command_line_random_values_equal_rcl(context: Context, text: str) -> None:
    try:
        value = parse_value(text)
    except InputError:
        return
    real = overrides(context, 'controller', '/', '-p', f'x:={text}')
    assert real == comparable({'x': value})
