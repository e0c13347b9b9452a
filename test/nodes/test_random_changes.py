# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""10 000 random parameter changes in a run: no invalid value becomes active."""

from __future__ import annotations

from collections.abc import Iterator
import math
from typing import Any

from helpers.live_run import live_run, LiveRun
from hypothesis import given, HealthCheck, Phase, settings
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.messages.parameter_record import read_record
from masmc_ros.scenario.node_parameters import declared
import pytest
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.parameter import Parameter, parameter_value_to_python
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

EXAMPLES, FEW, CHANGES = 80, 12, 25
AT_ONCE = 5
"""Number of simultaneous requests; a service queues at most ten."""
DECLARED = {p.name: p for p in declared('controller') if not p.read_only}
numbers = st.floats(-10.0, 300.0) | st.floats() | st.sampled_from([0.0, -0.0, 1e-308, 1e308])
anything = st.one_of(
    numbers,
    st.integers(-(2**40), 2**40),
    st.booleans(),
    st.text(st.characters(exclude_categories=['Cs'], exclude_characters='\0'), max_size=8),
    st.lists(numbers, min_size=1, max_size=8),
    st.lists(st.integers(-3, 300), min_size=1, max_size=8),
)


def fitting(name: str) -> st.SearchStrategy[Any]:
    """Return a strategy of valid values of a parameter, including its limits."""
    parameter = DECLARED[name]
    if parameter.choices:
        return st.sampled_from(parameter.choices)
    low = (parameter.minimum or 0.0) + (1e-3 if parameter.exclusive_minimum else 0.0)
    number = st.floats(low, min(parameter.maximum or 200.0, 200.0))
    if parameter.length:
        size = parameter.length
        return number | st.lists(number, min_size=size, max_size=size)
    return number


changes = st.dictionaries(st.sampled_from(sorted(DECLARED)), st.none(), min_size=1, max_size=3)
change = changes.flatmap(
    lambda names: st.fixed_dictionaries({n: fitting(n) | anything for n in names})
)


@pytest.fixture(scope='module')
def served(
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[tuple[LiveRun, Any, Any]]:
    """Yield a run, and clients that set and get parameters of its controller."""
    folder = tmp_path_factory.mktemp('run')
    wait_for = '[controller, trajectory, peer]'
    # The limit of the commands is one of the parameters that change; the plant's is not.
    settings = {'plant__wait_for': wait_for, 'torque_limit': 0.0}
    with live_run(folder, 'plant', 'trajectory', 'controller', **settings) as run:
        run.wait_for_progress()
        run.tester.subscribe(String, 'controller/parameters', check_record)
        known = run.tester.known_client
        set_ = known(SetParametersAtomically, '/controller/set_parameters_atomically')
        yield run, set_, known(GetParameters, '/controller/get_parameters')
        run.end()
        assert sum(active) > len(active) // 4, 'the controller was rarely active'


active: list[bool] = []
"""Whether the controller was active at the end of each batch."""


def check_record(message: String) -> None:
    """Check that all active values in a record are valid."""
    record = read_record(message.data)
    values = {name: value for name, value in record.parameters.items() if name in DECLARED}
    assert set(values) == set(DECLARED)
    assert is_valid(values), values


def make_active(run: LiveRun) -> None:
    """Clear the effects of the last changes: a fault, or a robot far from the path."""
    if run.states[-1] == 'active':
        return
    run.tester.call(Trigger, '/plant/reset', Trigger.Request())
    run.tester.call(SetBool, '/controller/enable', SetBool.Request(data=True))


def is_valid(values: dict[str, Any]) -> bool:
    """Return True if every value conforms to its declaration; integers are valid doubles."""
    try:
        for name, value in values.items():
            DECLARED[name].check(value, integers_for_doubles=True)
    except InputError:
        return False
    return True


def same(first: Any, second: Any) -> bool:
    """Return True if two numbers or arrays are equal; NaN equals NaN."""
    first = list(first) if isinstance(first, (list, tuple)) else first
    second = list(second) if isinstance(second, (list, tuple)) else second
    return repr(first) == repr(second) or first == second


def change_parameters(served: tuple[LiveRun, Any, Any], many: list[dict[str, Any]]) -> None:
    """Make many changes; check responses, active values and torques."""
    run, set_, get = served
    make_active(run)
    commands = run.commands
    results = []
    for first in range(0, len(many), AT_ONCE):
        futures = [
            set_.call_async(
                SetParametersAtomically.Request(
                    parameters=[
                        Parameter(n, value=v).to_parameter_msg() for n, v in values.items()
                    ]
                )
            )
            for values in many[first : first + AT_ONCE]
        ]
        run.tester.until(lambda futures=futures: all(f.done() for f in futures), 'answers')
        results += [future.result().result for future in futures]
    expected: dict[str, Any] = {}
    for values, result in zip(many, results, strict=True):
        assert result.successful == is_valid(values), (values, result.reason)
        assert result.successful or result.reason
        expected.update(values if result.successful else {})
    names = sorted(DECLARED)
    future = get.call_async(GetParameters.Request(names=names))
    run.tester.until(future.done, 'values')
    read = dict(zip(names, map(parameter_value_to_python, future.result().values), strict=True))
    assert is_valid(read), read
    for name, value in expected.items():
        assert same(read[name], value), (name, read[name], value)
        assert not isinstance(read[name], float) or math.isfinite(read[name])
    run.tester.until(lambda: run.commands > commands, 'commands')
    active.append(run.states[-1] == 'active')
    assert run.wrong == []


some = given(st.lists(change, min_size=CHANGES, max_size=CHANGES))
at_random = settings(
    database=None, phases=[Phase.generate], suppress_health_check=list(HealthCheck)
)


@settings(at_random, max_examples=FEW)
@some
def test_controller_few_random_changes_only_valid_active(
    served: tuple[LiveRun, Any, Any], many: list[dict[str, Any]]
) -> None:
    change_parameters(served, many)


@pytest.mark.slow
@settings(at_random, max_examples=EXAMPLES)
@some
def test_controller_many_random_changes_only_valid_active(
    served: tuple[LiveRun, Any, Any], many: list[dict[str, Any]]
) -> None:
    change_parameters(served, many)
