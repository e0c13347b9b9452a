# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameter changes during a run: checked, applied between two ticks, recorded with the tick."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from helpers.processes import peer, processes, ros_arguments
from masmc_ros.scenario.node_parameters import declared
import pytest
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParametersAtomically
from rclpy.parameter import Parameter

Call = Callable[[Any, str, Any], Any]


@pytest.fixture(scope='module')
def controller(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Call]:
    """Yield a function that calls parameter services of a single controller."""
    folder = tmp_path_factory.mktemp('nodes')
    with processes(folder) as started, peer(started.domain) as tester:
        started.start('controller', *ros_arguments(None, k_s1=120.0))
        names = {
            SetParametersAtomically: 'set_parameters_atomically',
            GetParameters: 'get_parameters',
            DescribeParameters: 'describe_parameters',
        }

        def call(kind: Any, field: str, value: Any) -> Any:
            request = kind.Request()
            setattr(request, field, value)
            return tester.call(kind, f'controller/{names[kind]}', request)

        yield call


def change(call: Call, **values: Any) -> Any:
    changes = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
    return call(SetParametersAtomically, 'parameters', changes).result


def read(call: Call, name: str) -> Any:
    value = call(GetParameters, 'names', [name]).values[0]
    if value.type == ParameterType.PARAMETER_DOUBLE_ARRAY:
        return list(value.double_array_value)
    if value.type == ParameterType.PARAMETER_DOUBLE:
        return value.double_value
    return value.string_value


def test_controller_command_line_value_active(controller: Call) -> None:
    assert read(controller, 'k_s1') == 120.0


@pytest.mark.parametrize(
    ('value', 'stored'),
    [
        (150, 150.0),
        (150.5, 150.5),
        ([150.0, 150.0, 80.0, 80.0], [150.0, 150.0, 80.0, 80.0]),
        ([150, 150, 80, 80], [150.0, 150.0, 80.0, 80.0]),
    ],
)
def test_set_parameters_gain_number_or_array_accepted(
    controller: Call, value: Any, stored: Any
) -> None:
    assert change(controller, k_s1=value).successful
    assert read(controller, 'k_s1') == stored


def test_set_parameters_integer_converted_to_double(controller: Call) -> None:
    assert change(controller, observer_gain=1).successful
    assert read(controller, 'observer_gain') == 1.0


@pytest.mark.parametrize(
    ('name', 'value', 'expected'),
    [
        ('k_s1', -1.0, ('k_s1', '-1.0', '>= 0')),
        ('k_s2', [1.0, 2.0], ('k_s2', '[1.0, 2.0]', '4 numbers')),
        ('sigma', float('nan'), ('sigma', '.nan', 'number')),
        ('gamma', 0.0, ('gamma', '0.0', '> 0')),
        ('law', 'lqr', ('law', 'lqr', 'smc, rasmc')),
        ('switching', 'soft', ('switching', 'soft', 'implicit')),
        ('boundary_layer', 'thin', ('boundary_layer', 'thin', '> 0')),
        ('k_s1', 'strong', ('k_s1', 'strong', '4 numbers')),
        ('observer_gain', 2.0, ('observer_gain', '2.0', '1.0')),
        ('control_period', 0.02, ('control_period', 'read-only')),
    ],
)
def test_set_parameters_invalid_value_rejected_with_reason(
    controller: Call, name: str, value: Any, expected: tuple[str, ...]
) -> None:
    previous = read(controller, name)
    result = change(controller, **{name: value})
    assert not result.successful
    for part in expected:
        assert part in result.reason
    assert read(controller, name) == previous
    described = controller(DescribeParameters, 'names', [name]).descriptors[0].type
    assert described == controller(GetParameters, 'names', [name]).values[0].type


def test_set_parameters_one_invalid_value_nothing_changed(controller: Call) -> None:
    previous = read(controller, 'k_s1'), read(controller, 'sigma')
    assert not change(controller, k_s1=77.0, sigma=-1.0).successful
    assert (read(controller, 'k_s1'), read(controller, 'sigma')) == previous
    assert change(controller, k_s1=77.0, sigma=3.0).successful
    assert (read(controller, 'k_s1'), read(controller, 'sigma')) == (77.0, 3.0)


def test_describe_parameters_all_match_declaration(controller: Call) -> None:
    parameters = declared('controller')
    names = [parameter.name for parameter in parameters]
    descriptors = controller(DescribeParameters, 'names', names).descriptors
    for parameter, descriptor in zip(parameters, descriptors, strict=True):
        assert parameter.description in descriptor.description
        assert parameter.unit in descriptor.description
        assert descriptor.additional_constraints == parameter.expected
        assert descriptor.read_only == parameter.read_only
