# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Bitwise identical results for split runs, other CPUs and the interpreter."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache
import json
import os
from pathlib import Path
import subprocess
import sys
from typing import Any

from helpers import closed_loop_bits
from helpers.closed_loop_bits import digest, scenarios
from helpers.scenario import in_pieces, Run, tick_by_tick, whole
from helpers.target_cpus import host_has, OTHERS
import numpy as np
import pytest

SCRIPT = Path(closed_loop_bits.__file__)
ROOT = Path(__file__).parents[2]
TICKS = 2001
INTERPRETED_TICKS = 201
TIMEOUT = 900.0

RECORDED = {
    'smc sign': 'ea8430c4471f1d7210886339b9bf1ecc362115953632af2e6d296096c779a3d0',
    'smc saturation': 'd338313f7677d308faaa6429ee8e9662f94f39237866b63ce7a2cdefaf87f771',
    'smc tanh': '31c4a1e17b001e553f536c515cb36bbedf794c6e418920794748eadf9e4071d1',
    'smc sigmoid': '80764ec67914aaffb6558c8694b7198ad1ba96f5da033381dd101e68e6953c0c',
    'smc implicit': '9267b261d3bdf19bdfa0c2708b0d215fb3a8151a611dc0587e6a65b7eacd5bdc',
    'rasmc sign': '814947cc03fceaac3c40a85e2699424a7873da6ad7230f80bf2b070303c1b4eb',
    'rasmc saturation': '46b8fa63857475a5569a1da58a23beacc62d0ea7c1e93450727c2913a23fa91a',
    'rasmc tanh': '24759fea646de5b9d705a8c0d19a47e56c634c6c5ef0eb710fa567ffab5ccd8d',
    'rasmc sigmoid': '70305963a479fd82951591f7a2aec0d0acf005f2eb646b94f09a5f7a3a343306',
    'rasmc implicit': '6918e5ad1dfc065d5de7e8b9b5249138b96291023016dbbf95ae783e2986cdb7',
    'everything on': '53eac9bff7414c27a801bfee2db1ab140f863e46f1522c2e856737a18b3b5685',
    'imperfect': '61d7d0d117a14824069094ae06f98c1e426f96d14f7ccd0f02654f42423ac0b5',
}
"""Digests that every machine must produce; after a change of formulas, see same_bits.md."""


COMPILED = 'smc tanh', 'rasmc sigmoid', 'imperfect'
"""
Scenarios compiled for other CPUs: both laws, and each term that computes more than a comparison;
the last one is implicit.
"""

FAST = 'smc sign', 'rasmc tanh', 'smc implicit', 'everything on', 'imperfect'
"""Scenarios compiled by `make test`."""

SCENARIO_NAMES = [
    pytest.param(name, marks=() if name in FAST else pytest.mark.slow) for name in RECORDED
]


def start(ticks: int, names: Sequence[str], cache: Path, **settings: str) -> subprocess.Popen[str]:
    """Start a process that computes the digests with its own code cache."""
    path = os.pathsep.join([str(ROOT), str(SCRIPT.parent), *filter(None, sys.path)])
    environment = {**os.environ, 'PYTHONPATH': path, 'XDG_CACHE_HOME': str(cache), **settings}
    return subprocess.Popen(
        [sys.executable, str(SCRIPT), str(ticks), *names],
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
    )


@pytest.fixture(scope='module')
def children(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, dict[str, Any]]]:
    """Yield reports of processes compiled for other CPUs, and of an interpreted one."""
    cache = tmp_path_factory.mktemp
    running = {
        name: start(TICKS, COMPILED, cache(cpu), NUMBA_CPU_NAME=cpu, NUMBA_CPU_FEATURES='')
        for name, cpu in OTHERS.items()
        if host_has(cpu)
    }
    running['interpreted'] = start(INTERPRETED_TICKS, (), cache('none'), NUMBA_DISABLE_JIT='1')
    try:
        yield {
            name: json.loads(process.communicate(timeout=TIMEOUT)[0])
            for name, process in running.items()
        }
    finally:
        for process in running.values():
            process.kill()
            process.wait()


@pytest.fixture(scope='module')
def digest_of() -> Callable[[str], str]:
    """Return a function that computes digests of this process by scenario name."""
    known = scenarios(TICKS)
    return cache(lambda name: digest(whole(known[name])))


def test_digests_every_scenario_is_recorded() -> None:
    assert list(scenarios(TICKS)) == list(RECORDED)
    assert len(set(RECORDED.values())) == len(RECORDED)


@pytest.mark.parametrize('name', SCENARIO_NAMES)
def test_closed_loop_on_this_machine_equals_recorded_digest(
    name: str, digest_of: Callable[[str], str]
) -> None:
    assert digest_of(name) == RECORDED[name]


@pytest.mark.slow
@pytest.mark.parametrize('name', OTHERS)
def test_closed_loop_on_other_cpu_equals_this_machine(
    name: str, children: dict[str, dict[str, Any]], digest_of: Callable[[str], str]
) -> None:
    if name not in children:
        pytest.skip(f'this machine cannot run code for {OTHERS[name]}')
    assert children[name]['digests'] == {scenario: digest_of(scenario) for scenario in COMPILED}


@pytest.mark.slow
def test_compiled_code_for_other_cpus_uses_other_instructions(
    children: dict[str, dict[str, Any]]
) -> None:
    """The compiled codes use different multiplications, and none contracts into an FMA."""
    if 'AVX2 and FMA' not in children:
        pytest.skip('needs an x86-64 machine with AVX2')
    plain, vector = (children[name]['machine code'] for name in OTHERS)
    assert plain['sse'] > 100
    assert plain['avx'] == 0
    assert vector['avx'] > 100
    assert vector['sse'] == 0
    assert vector['fma'] == 0


@pytest.mark.slow
def test_closed_loop_interpreted_equals_compiled(children: dict[str, dict[str, Any]]) -> None:
    """Plain Python neither reorders nor contracts; its results equal those of LLVM's code."""
    expected = {n: digest(whole(s)) for n, s in scenarios(INTERPRETED_TICKS).items()}
    assert children['interpreted']['digests'] == expected


SHORT = scenarios(401)


def assert_same(one: Run, other: Run) -> None:
    """Compare two runs bitwise, and report the first difference."""
    for name, values in vars(one).items():
        np.testing.assert_array_equal(values, getattr(other, name), err_msg=name)
    assert digest(one) == digest(other)


@pytest.mark.parametrize('name', SCENARIO_NAMES)
def test_closed_loop_tick_by_tick_equals_whole_run(name: str) -> None:
    assert_same(tick_by_tick(SHORT[name]), whole(SHORT[name]))


@pytest.mark.parametrize('name', SCENARIO_NAMES)
@pytest.mark.parametrize('cut', [1, 200, 400])
def test_closed_loop_in_two_pieces_equals_whole_run(name: str, cut: int) -> None:
    assert_same(in_pieces(SHORT[name], cut), whole(SHORT[name]))


def test_digest_one_bit_changed_differs() -> None:
    """One bit of one number changes the digest."""
    run = whole(next(iter(SHORT.values())))
    before = digest(run)
    run.torque[200, 2] = np.nextafter(run.torque[200, 2], np.inf)
    assert digest(run) != before
