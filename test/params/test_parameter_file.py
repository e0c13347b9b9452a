# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameter files: values, blocks, line numbers, and one-line errors."""

import math
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.params.file import parse_value, read
import pytest

EXAMPLE = """\
/**:
  ros__parameters:
    control_period: 0.001
    robot:
      wheel_radius: 0.05
      link_1_length: 0.5
/**/controller:
  ros__parameters:
    law: smc
    k_s1: [150, 150, 80, 80]
    robot.wheel_radius: 0.06
/left:
  controller:
    ros__parameters: {law: rasmc, control_period: 0.002}
observer:
  ros__parameters:
    gain: 1.0
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / 'run.yaml'
    path.write_text(EXAMPLE)
    return path


def test_parameter_file_last_matching_block_applies_per_name(file: Path) -> None:
    parameters = read(file)
    shared = {'control_period': 0.001, 'robot.wheel_radius': 0.05, 'robot.link_1_length': 0.5}
    own = {'law': 'smc', 'k_s1': [150, 150, 80, 80], 'robot.wheel_radius': 0.06}
    assert parameters.for_node('plant') == shared
    assert parameters.for_node('controller') == {**shared, **own}
    assert parameters.for_node('controller', '/right/arm') == {**shared, **own}
    left = {'law': 'rasmc', 'control_period': 0.002}
    assert parameters.for_node('controller', '/left') == {**shared, **own, **left}
    assert parameters.for_node('controller', 'left') == {**shared, **own, **left}


def test_parameter_file_blocks_have_pattern_lines_and_values(file: Path) -> None:
    blocks = read(file).blocks
    assert [(block.pattern, block.line) for block in blocks] == [
        ('/**', 1),
        ('/**/controller', 7),
        ('/left/controller', 13),
        ('observer', 15),
    ]
    assert blocks[1].values == {
        'law': ('smc', 9),
        'k_s1': ([150, 150, 80, 80], 10),
        'robot.wheel_radius': (0.06, 11),
    }


def test_parameter_file_places_name_line_of_applied_value(file: Path) -> None:
    places = read(file).places('controller')
    assert places['robot.wheel_radius'] == f'{file}:11: '
    assert places['robot.link_1_length'] == f'{file}:6: '


def test_parameter_file_blocks_of_unknown_nodes_are_listed(file: Path) -> None:
    unmatched = read(file).unmatched(['plant', 'controller'])
    assert [block.pattern for block in unmatched] == ['/left/controller', 'observer']
    assert not read(file).unmatched(['observer', 'controller'], '/left')[0].is_for('controller')


@pytest.mark.parametrize(
    ('text', 'line', 'words'),
    [
        ('/**:\n  ros__parameters:\n    k: [1, 2.0]\n', 3, 'k has a double (2.0) in an array'),
        ('/**:\n  ros__parameters:\n    k:\n    law: smc\n', 3, 'no value for k'),
        ('/**:\n  ros__parameters:\n    k: *other\n', 3, 'alias *other'),
        ('/**:\n  ros__parameters:\n    a: &x 1.0\n    k: *x\n', 4, 'alias *x'),
        ('/**:\n  ros__parameters:\n    k: [[1], [2]]\n', 3, 'k has an array in an array'),
        ('/**:\n  ros__parameters:\n    k: [1\n', 4, "expected ',' or ']'"),
        ('/**:\n  ros__parameters:\n  - k\n', 3, 'no map below ros__parameters'),
        ('controller:\n  k_s1: 1.0\n', 2, "value '1.0' outside of ros__parameters"),
        ('controller:\n  k_s1: [1.0]\n', 2, 'array outside of ros__parameters'),
        ('controller:\n', 1, "value '' outside of ros__parameters"),
        ('ros__parameters:\n  k_s1: 1.0\n', 1, 'without a node name'),
        ('a:\n- b\n', 2, 'array outside of ros__parameters'),
        ('- a\n', 1, 'array outside of ros__parameters'),
        ('\n/the-controller:\n  ros__parameters:\n    k: 1\n', 2, "'the-controller' is not made"),
        ('/a//b:\n  ros__parameters:\n    k: 1\n', 1, 'two slashes in a row'),
        ('/a/:\n  ros__parameters:\n    k: 1\n', 1, 'ends with a slash'),
        ("/**:\n  ros__parameters:\n    '': 1\n", 3, "no name in front of ':'"),
        ('/**:\n  ros__parameters:\n\tk: 1\n', 3, 'not YAML'),
        ('# only\n---\n', 3, "value '' outside of ros__parameters"),
        ('a: {ros__parameters: {k: 1}}\n---\nb: {}\n', 2, 'second document'),
        ('a: &x {}\nb:\n  <<: *x\n', 3, 'alias *x'),
        ('/**:\n  ros__parameters:\n    k: {}\n', 3, 'k is an empty map'),
        ('/**:\n  ros__parameters:\n    k: [{a: 1}]\n', 3, 'k has a map in an array'),
        ('/**:\n  ros__parameters:\n    k: 1\n    k: {a: 1}\n', 4, 'a value in line 3'),
        ('/**:\n  ros__parameters:\n    k: {a.b: {c: 1}}\n', 3, 'k.a.b is a map below a map'),
        ('a:\n  b/c:\n    ros__parameters: {}\n', 2, "node name 'b/c' below 'a': it has a slash"),
        ('a:\n  ros__parameters: {}\n  b: {}\n', 3, "key 'b' after ros__parameters"),
        ('a:\n  ros__parameters: {"k\\0": 1}\n', 2, 'NUL character'),
        ('a:\n  ros__parameters: {? [1] : 1}\n', 2, 'in place of a name'),
        ('[' * 100_000, 1, 'more than 50 levels'),
    ],
)
def test_parameter_file_invalid_text_raises_one_line_with_place(
    tmp_path: Path, text: str, line: int, words: str
) -> None:
    path = tmp_path / 'run.yaml'
    path.write_text(text)
    with pytest.raises(InputError) as raised:
        read(path)
    message = str(raised.value)
    assert message.startswith(f'{path}:{line}: ')
    assert words in message
    assert '; ' in message
    assert len(message.splitlines()) == 1


def test_parameter_file_unreadable_raises(tmp_path: Path) -> None:
    latin = tmp_path / 'latin.yaml'
    latin.write_bytes(b'/**:\n  ros__parameters:\n    name: caf\xe9\n')
    (tmp_path / 'plain').touch()
    for path, words in (
        (tmp_path / 'missing.yaml', 'no such file'),
        (tmp_path, 'a directory'),
        (tmp_path / 'plain' / 'run.yaml', 'not readable (Not a directory)'),
        ('a\0b', 'not readable'),
    ):
        with pytest.raises(InputError) as raised:
            read(path)
        assert str(raised.value).startswith(f'{path}: {words}')
    with pytest.raises(InputError) as raised:
        read(latin)
    assert str(raised.value).startswith(f'{latin}:3: not text in UTF-8')


@pytest.mark.parametrize('text', ['', '# a comment\n', '{}', 'a: {}\n'])
def test_parameter_file_without_parameters_is_empty(tmp_path: Path, text: str) -> None:
    path = tmp_path / 'run.yaml'
    path.write_text(text)
    assert read(path).for_node('controller') == {}


def test_parameter_file_repeated_keys_merge_to_last_values(tmp_path: Path) -> None:
    path = tmp_path / 'run.yaml'
    path.write_text(
        'a:\n  ros__parameters: {k: 1, l: 1, k: [2.0]}\n'
        'b:\n  ros__parameters: {k: 3}\n'
        'a:\n  ros__parameters: {l: x, m.n: 1, m: {n: 2, o: 3}}\n'
    )
    assert [block.pattern for block in read(path).blocks] == ['a', 'b']
    assert read(path).for_node('a') == {'k': [2.0], 'l': 'x', 'm.n': 2, 'm.o': 3}
    assert read(path).places('a')['l'] == f'{path}:6: '


def test_parameter_file_tags_and_anchors_keep_values(tmp_path: Path) -> None:
    path = tmp_path / 'run.yaml'
    path.write_text(
        'a:\n  ros__parameters:\n    k: &x 1.0\n    l: !!str 5\n    m: !local 5\n'
        '    n: !!int "5"\n    o: !!float 5\n    <<: {p: 1}\n'
    )
    expected = {'k': 1.0, 'l': '5', 'm': 5, 'n': '5', 'o': 5, '<<.p': 1}
    assert read(path).for_node('a') == expected


@given(st.binary(max_size=60) | st.text(max_size=60).map(str.encode))
def test_parameter_file_random_bytes_are_read_or_raise(
    tmp_path_factory: pytest.TempPathFactory, data: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / 'any.yaml'
    path.write_bytes(data)
    try:
        parameters = read(path)
    except InputError as error:
        assert len(str(error).splitlines()) == 1
    else:
        assert isinstance(parameters.for_node('controller'), dict)


@pytest.mark.parametrize(
    ('text', 'value'),
    [
        ('150', 150),
        ('150.0', 150.0),
        ('rasmc', 'rasmc'),
        ('on', True),
        ('No', False),
        ('"on"', 'on'),
        ("'1.0'", '1.0'),
        ('!!str 5', '5'),
        ('!!int "5"', '5'),
        ('010', 8),
        ('08', 8.0),
        ('0x1F', 31),
        ('-0x10', -16),
        ('0b1', '0b1'),
        ('1_000', '1_000'),
        ('9223372036854775807', 2**63 - 1),
        ('9223372036854775808', 2.0**63),
        ('-9223372036854775808', -(2**63)),
        ('1e3', 1000.0),
        ('.5', 0.5),
        ('5.', 5.0),
        ('1e', '1e'),
        ('0x1.8p1', 3.0),
        ('0x1p', '0x1p'),
        ('.inf', math.inf),
        ('-.Inf', -math.inf),
        ('infinity', math.inf),
        ('-.nan', '-.nan'),
        ('1e999', '1e999'),
        ('1e-999', '1e-999'),
        ('0e-999', 0.0),
        ('5e-324', '5e-324'),
        ('0x1p-1074', '0x1p-1074'),
        ('0' * 40 + '7', 7),
        ('1' + '0' * 5000, '1' + '0' * 5000),
        ('2.2250738585072014e-308', 2.2250738585072014e-308),
        ('~', '~'),
        ('null', 'null'),
        ('[150.0, 80.0]', [150.0, 80.0]),
        ('[smc, "1"]', ['smc', '1']),
        ('[true, no]', [True, False]),
        ('[]', None),
        ('# a comment', None),
    ],
)
def test_command_line_value_is_parsed_as_in_ros(text: str, value: object) -> None:
    parsed = parse_value(text)
    assert repr(parsed) == repr(value)


@pytest.mark.parametrize(
    'text', ['', '[1, 2.0]', '[1, a]', '{a: 1}', '[1', '"', '\udce9', '*a', '1\n--- 2', '[[1]]']
)
def test_command_line_value_invalid_raises(text: str) -> None:
    with pytest.raises(InputError) as raised:
        parse_value(text, '--set controller.k_s1')
    assert str(raised.value).startswith('--set controller.k_s1: ')
    assert len(str(raised.value).splitlines()) == 1
