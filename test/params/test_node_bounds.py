# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Bounds of the nodes' parameters: extreme values are rejected with the permitted range."""

from __future__ import annotations

from masmc_ros.errors import InputError
from masmc_ros.scenario.node_parameters import declared
import pytest


@pytest.mark.parametrize(
    ('node', 'name', 'value', 'expected'),
    [
        ('trajectory', 'window', 1e-300, 'a number in [0.001, 5]'),
        ('trajectory', 'horizon', 5e-324, 'a number in [0.001, 10]'),
        ('recorder', 'flush_period', 1e300, 'a number in [0.01, 3600]'),
        ('recorder', 'max_size', 1e-300, '0, or a number in [1, 1e+09]'),
        ('recorder', 'max_duration', 0.999, '0, or a number in [1, 1e+09]'),
    ],
)
def test_parameter_extreme_value_raises(
    node: str, name: str, value: float, expected: str
) -> None:
    (parameter,) = (p for p in declared(node) if p.name == name)
    with pytest.raises(InputError, match=f'^{name} = ') as raised:
        parameter.check(value)
    assert str(raised.value).endswith(f': expected {expected}')


@pytest.mark.parametrize('name', ['max_size', 'max_duration'])
@pytest.mark.parametrize('value', [0.0, 1.0, 1e9])
def test_recorder_parts_usual_value_is_accepted(name: str, value: float) -> None:
    (parameter,) = (p for p in declared('recorder') if p.name == name)
    assert parameter.check(value) == value
