# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Random requests and messages to all services and topics of all nodes: no node exits."""

from __future__ import annotations

from pathlib import Path
import signal
import time
import tracemalloc

from benchmarks.hostile import RandomInput
from benchmarks.hostile_client import HostileClient
from builtin_interfaces.msg import Time
from helpers.processes import BOUNDED, PATIENCE, Peer, peer, processes, ros_arguments
from masmc_ros.messages.parameter_record import ParameterRecord
from masmc_ros.nodes.middleware.ros_topics import _DuplicateFilter
from masmc_ros.nodes.recorder.output import Attachments
import pytest
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from rosgraph_msgs.msg import Clock

NODES = ('plant', 'trajectory', 'controller', 'recorder', 'play')

COMPILED = ('law', 'switching', 'type', 'velocity_source')
"""Parameters whose changes compile code, which takes minutes; other tests change them."""


def survive(folder: Path, *, seed: int, seconds: float, **settings: object) -> None:
    """Send random input to all nodes; all continue, respond, and exit with status 0."""
    with processes(folder) as started, peer(started.domain) as tester:
        arguments = ros_arguments(
            duration=0.0,
            control_period=0.002,
            plant__wait_for='[]',
            play__port=0,
            recorder__output=folder / 'run.mcap',
            **BOUNDED,
            **settings,
        )
        nodes = started.start_all(*arguments, nodes=NODES)
        client = HostileClient(tester.node, RandomInput(seed), NODES, COMPILED)
        actions: list[str] = []
        try:
            for name in NODES:
                tester.call(GetParameters, f'{name}/get_parameters', GetParameters.Request())
                client.learn_parameters(name)
                tester.until(lambda n=name: client.is_known(n), f'parameters of {name}')
            client.discover()
            assert {service.node for service in client.services} == set(NODES)
            start, number, untried = time.monotonic(), 0, {''}
            # A busy machine needs longer to try everything.
            while time.monotonic() < start + (PATIENCE if untried else seconds):
                actions.append(_act(client, number))
                _spin(tester, 0.005)
                number += 1
                for name, node in nodes.items():
                    assert node.process.poll() is None, f'{name} has exited'
                untried = {service.name for service in client.services} - client.requests.keys()
                untried |= {topic.name for topic in client.topics} - client.messages.keys()
            assert untried == set()
            for name in NODES:
                request = GetParameters.Request(names=['use_sim_time'])
                tester.call(GetParameters, f'{name}/get_parameters', request)
        except BaseException:
            print(f'seed {seed}; the last of {len(actions)} actions:', *actions[-20:], sep='\n')
            raise
        started.signal(signal.SIGINT)
        assert started.wait() == dict.fromkeys(NODES, 0), started.output()
        assert 'Traceback' not in started.output()


def _act(client: HostileClient, number: int) -> str:
    """Send one request or message; the first ones cover all services and topics."""
    if number < len(client.services):
        return client.request(client.services[number])
    number -= len(client.services)
    if number < len(client.topics):
        return client.publish(client.topics[number])
    return client.random_request() if number % 3 == 0 else client.random_message()


def _spin(tester: Peer, seconds: float) -> None:
    end = time.monotonic() + seconds
    tester.until(lambda: time.monotonic() > end)


@pytest.mark.slow
def test_nodes_random_input_stay_alive(tmp_path: Path) -> None:
    survive(tmp_path, seed=1, seconds=4.0)


@pytest.mark.slow
@pytest.mark.parametrize(('pacing', 'seed'), [('realtime', 2), ('lockstep', 3)])
def test_nodes_long_random_input_stay_alive(pacing: str, seed: int, tmp_path: Path) -> None:
    survive(tmp_path, seed=seed, seconds=30.0, pacing=pacing)


@pytest.mark.slow
def test_set_parameters_unknown_type_rejected(tmp_path: Path) -> None:
    """Each parameter of a request has a result; valid ones after an invalid one are set."""
    wrong = Parameter(name='start_time', value=ParameterValue(type=77))
    missing = Parameter(name='nothing', value=ParameterValue(type=2))
    with processes(tmp_path) as started, peer(started.domain) as tester:
        node = started.start('trajectory', *ros_arguments())
        name = 'trajectory/get_parameters'
        request = GetParameters.Request(names=['start_time'])
        (value,) = tester.call(GetParameters, name, request).values
        right = Parameter(name='start_time', value=value)
        response = tester.call(
            SetParameters,
            'trajectory/set_parameters',
            SetParameters.Request(parameters=[wrong, missing, right]),
        )
        results = [(result.successful, result.reason) for result in response.results]
        assert results[0][1].startswith('start_time: type 77 is unknown; expected one of')
        assert results[1][1].startswith("unknown parameter 'nothing'")
        assert [successful for successful, _ in results] == [False, False, True]
        result = tester.call(
            SetParametersAtomically,
            'trajectory/set_parameters_atomically',
            SetParametersAtomically.Request(parameters=[right, wrong]),
        ).result
        assert (result.successful, result.reason) == (False, results[0][1])
        node.signal(signal.SIGINT)
        assert node.wait() == 0, started.output()


def test_clock_wrong_time_rejected(tmp_path: Path) -> None:
    """With `use_sim_time`, the node rejects a negative time and bytes that are no message."""
    with processes(tmp_path) as started, peer(started.domain) as tester:
        node = started.start('trajectory', *ros_arguments(use_sim_time='true'))
        clock = tester.publisher(Clock, '/clock')
        tester.wait_for_subscribers(clock)
        wrong = (
            (Clock(clock=Time(sec=-1)), '-1 s is negative'),
            (b'\0\1\0\0\1', '8 bytes that are no Clock'),  # filled up by the middleware
        )
        for message, reason in wrong:

            def is_rejected(message: object = message, reason: str = reason) -> bool:
                clock.publish(message)
                return bool(node.logged('ERROR', f'/clock rejected: {reason}'))

            tester.until(is_rejected, reason)
        clock.publish(Clock(clock=Time(sec=2**31 - 1, nanosec=2**32 - 1)))
        tester.call(GetParameters, 'trajectory/get_parameters', GetParameters.Request())
        node.signal(signal.SIGINT)
        assert node.wait() == 0, started.output()


def test_once_large_messages_are_not_kept() -> None:
    """Large messages of two subscriptions are recognised without storing them."""
    passed: list[int] = []
    once = _DuplicateFilter(lambda raw: passed.append(raw[0]), capacity=200)
    tracemalloc.start()
    try:
        for number in range(100):
            once.process(bytes([number]) * 10**6, once.by_volatile, once.by_past)
        used, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert used < 2 * 10**6
    for number in range(100):
        once.process(bytes([number]) * 10**6, once.by_past, once.by_volatile)
    assert passed == list(range(100))


def test_attachments_keep_only_changed_parameters() -> None:
    """The recorder keeps only changed parameters, which it writes at its end."""
    kept = Attachments({}, dict)
    everything = {f'parameter_{number}': float(number) for number in range(200)}
    start = ParameterRecord('/controller', 0, 0, everything, ())
    kept.add_parameters('/controller', start)
    kept.add_parameters('/controller', start._replace(tick=1, changed=('parameter_7',)))
    (change,) = kept._changes
    assert change.parameters == change.changes == {'parameter_7': 7.0}
    assert kept.parameters == {'/controller': everything}
