# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Declaration of parameters: coercion of valid values, one-line errors for all others."""

import array
import math
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.params.declaration import check_all, Parameter
import pytest

GAIN = Parameter('k_s1', 100.0, 'Gain', length=4, broadcast=True, minimum=0.0, read_only=False)
PERIOD = Parameter(
    'control_period', 0.001, 'Period', unit='s', minimum=0.0, exclusive_minimum=True, maximum=1.0
)
DURATION = Parameter('duration', 20.0, 'Duration', unit='s', minimum=0.0)
POSE = Parameter('initial_pose', (0.0, 0.0, 1.5), 'Pose', length=3)
LAW = Parameter('law', 'rasmc', 'Law', choices=lambda: ('smc', 'rasmc'))
TOPICS = Parameter('extra_topics', (), 'Topics')
DECIMATION = Parameter('decimation', 10, 'Ticks', minimum=1, maximum=1000)
OVERWRITE = Parameter('overwrite', False, 'Replace')
ALL = (GAIN, PERIOD, DURATION, POSE, LAW, TOPICS, DECIMATION, OVERWRITE)


@pytest.mark.parametrize(
    ('parameter', 'kind'),
    [
        (GAIN, 'doubles'),
        (PERIOD, 'double'),
        (POSE, 'doubles'),
        (LAW, 'string'),
        (TOPICS, 'strings'),
        (DECIMATION, 'integer'),
        (OVERWRITE, 'bool'),
        (Parameter('x', (), 'X', kind='doubles'), 'doubles'),
    ],
)
def test_parameter_kind_follows_from_default(parameter: Parameter, kind: str) -> None:
    assert parameter.kind == kind


def test_parameter_broadcast_default_has_all_entries() -> None:
    assert GAIN.default == (100.0, 100.0, 100.0, 100.0)


@pytest.mark.parametrize(
    ('parameter', 'value', 'coerced'),
    [
        (GAIN, 150, (150.0,) * 4),
        (GAIN, 150.0, (150.0,) * 4),
        (GAIN, [150, 150, 80, 80], (150.0, 150.0, 80.0, 80.0)),
        (GAIN, [150, 150.5, 80, 80], (150.0, 150.5, 80.0, 80.0)),
        (GAIN, array.array('d', (1.0, 2.0, 3.0, 0.0)), (1.0, 2.0, 3.0, 0.0)),
        (PERIOD, 1.0, 1.0),
        (POSE, [1.0, 2.0, 3.0], (1.0, 2.0, 3.0)),
        (LAW, 'smc', 'smc'),
        (TOPICS, None, ()),
        (TOPICS, ['/scan', '/map'], ('/scan', '/map')),
        (DECIMATION, 5, 5),
        (OVERWRITE, True, True),
    ],
)
def test_parameter_valid_value_is_coerced(
    parameter: Parameter, value: object, coerced: object
) -> None:
    checked = parameter.check(value)
    assert checked == coerced
    assert type(checked) is type(coerced)


@pytest.mark.parametrize(
    ('parameter', 'value', 'message'),
    [
        (
            GAIN,
            [1.0, 2.0],
            'k_s1 = [1.0, 2.0]: expected a number or 4 numbers, each >= 0',
        ),
        (GAIN, -1, 'k_s1 = -1: expected a number or 4 numbers, each >= 0'),
        (GAIN, True, 'k_s1 = true: expected a number or 4 numbers, each >= 0'),
        (GAIN, '150', 'k_s1 = "150": expected a number or 4 numbers, each >= 0'),
        (
            GAIN,
            '[1.0, 1, 1, 2]',
            'k_s1 = "[1.0, 1, 1, 2]": expected a number or 4 numbers, each >= 0; ROS 2 takes an '
            'array of several types for a string: write each with a point, [1.0, 1.0, 1.0, 2.0]',
        ),
        (
            GAIN,
            '[1.0, 1, 1]',
            'k_s1 = "[1.0, 1, 1]": expected a number or 4 numbers, each >= 0; it has 3, and ROS 2 '
            'takes an array of several types for a string: write each with a point, as in 1.0',
        ),
        (GAIN, '[a, 1]', 'k_s1 = "[a, 1]": expected a number or 4 numbers, each >= 0'),
        (GAIN, None, 'k_s1 = []: expected a number or 4 numbers, each >= 0'),
        (
            GAIN,
            [1.0, 1.0, 1.0, math.nan],
            'k_s1 = [1.0, 1.0, 1.0, .nan]: expected a number or 4 numbers, each >= 0',
        ),
        (PERIOD, 0.0, 'control_period = 0.0: expected a number in (0, 1]'),
        (PERIOD, math.inf, 'control_period = .inf: expected a number in (0, 1]'),
        (PERIOD, [0.1], 'control_period = [0.1]: expected a number in (0, 1]'),
        (
            DURATION,
            20,
            'duration = 20: expected a number >= 0, written with a point; write 20.0',
        ),
        (DURATION, 10**400, f'duration = {10**119}…: expected a number >= 0'),
        (
            POSE,
            [0, 0, 1],
            'initial_pose = [0, 0, 1]: expected 3 numbers, written with a point; '
            'write [0.0, 0.0, 1.0]',
        ),
        (POSE, 1.0, 'initial_pose = 1.0: expected 3 numbers'),
        (LAW, 'rasm', 'law = rasm: expected one of smc, rasmc; did you mean rasmc?'),
        (LAW, 'lqr', 'law = lqr: expected one of smc, rasmc'),
        (LAW, True, 'law = true: expected one of smc, rasmc'),
        (LAW, 'a\nb', 'law = "a\\nb": expected one of smc, rasmc'),
        (TOPICS, '/scan', 'extra_topics = /scan: expected an array of strings'),
        (TOPICS, [1, 2], 'extra_topics = [1, 2]: expected an array of strings'),
        (DECIMATION, 0, 'decimation = 0: expected an integer in [1, 1000]'),
        (DECIMATION, 1.0, 'decimation = 1.0: expected an integer in [1, 1000]'),
        (DECIMATION, True, 'decimation = true: expected an integer in [1, 1000]'),
        (OVERWRITE, 1, 'overwrite = 1: expected true or false'),
    ],
)
def test_parameter_invalid_value_raises(parameter: Parameter, value: object, message: str) -> None:
    with pytest.raises(InputError) as raised:
        parameter.check(value)
    assert str(raised.value) == message


def test_parameter_integer_of_command_line_becomes_double() -> None:
    assert DURATION.check(20, integers_for_doubles=True) == 20.0
    assert POSE.check([1, 2, 3], integers_for_doubles=True) == (1.0, 2.0, 3.0)
    with pytest.raises(InputError, match='true'):
        DURATION.check(True, integers_for_doubles=True)


_ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=5,
)


@given(st.sampled_from(ALL), _ANYTHING, st.booleans())
def test_parameter_any_value_is_coerced_or_raises_one_line(
    parameter: Parameter, value: object, integers: bool
) -> None:
    try:
        checked = parameter.check(value, integers_for_doubles=integers)
    except InputError as error:
        assert str(error).startswith(f'{parameter.name} = ')
        assert len(str(error).splitlines()) == 1
    else:
        assert parameter.check(checked) == checked
        assert type(checked) is type(parameter.default)


@given(st.floats(allow_nan=False), st.floats(allow_nan=False), st.booleans(), st.booleans())
def test_parameter_number_is_accepted_only_within_bounds(
    bound: float, value: float, upper: bool, exclusive: bool
) -> None:
    limits: dict[str, Any] = (
        {'maximum': bound, 'exclusive_maximum': exclusive}
        if upper
        else {'minimum': bound, 'exclusive_minimum': exclusive}
    )
    # A finite default within the bounds, if one exists.
    inside = -1.7e308 if upper else 1.7e308
    if not (inside < bound if upper else inside > bound):
        return
    parameter = Parameter('x', inside, 'X', **limits)
    right = value < bound if upper else value > bound
    right = (right or (not exclusive and value == bound)) and math.isfinite(value)
    if right:
        assert parameter.check(value) == value
    else:
        with pytest.raises(InputError):
            parameter.check(value)


@pytest.mark.parametrize(
    ('default', 'options'),
    [
        (-1.0, {'minimum': 0.0}),
        ((1.0, 2.0), {'length': 3}),
        ('pid', {'choices': ('smc',)}),
    ],
)
def test_parameter_invalid_default_raises(default: object, options: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        Parameter('x', default, 'X', **options)


def test_parameter_string_becomes_array_of_one() -> None:
    task = Parameter('task', ('pose',), 'Task', broadcast=True)
    assert task.check('planar') == ('planar',)
    assert task.check(['pose', 'heading']) == ('pose', 'heading')
    with pytest.raises(InputError, match=r'task = 1\.0: expected a string or an array of strings'):
        task.check(1.0)


def test_parameter_broadcast_without_length_raises() -> None:
    with pytest.raises(ValueError, match='length'):
        Parameter('x', 1.0, 'X', broadcast=True)


def test_parameter_choices_function_is_not_called_at_declaration() -> None:
    def fail() -> tuple[str, ...]:
        raise AssertionError('asked while declaring')

    Parameter('x', 'a', 'X', choices=fail)


def test_check_all_fills_in_defaults() -> None:
    values = check_all(ALL, {'k_s1': 5, 'law': 'smc'})
    assert list(values) == [parameter.name for parameter in ALL]
    assert values['k_s1'] == (5.0,) * 4
    assert values['law'] == 'smc'
    assert values['duration'] == 20.0


def test_check_all_unknown_name_suggests_similar_one() -> None:
    with pytest.raises(InputError) as raised:
        check_all(ALL, {'k_s': 5}, where='controller: ')
    assert str(raised.value) == "controller: unknown parameter 'k_s'; did you mean k_s1?"


def test_check_all_error_names_place_of_value() -> None:
    with pytest.raises(InputError) as raised:
        check_all(ALL, {'k_s1': 1, 'duration': -1.0}, where={'duration': 'a.yaml:3: '})
    assert str(raised.value) == 'a.yaml:3: duration = -1.0: expected a number >= 0'
