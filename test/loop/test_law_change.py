# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Changes of the law that require compilation, step by step and without a compiler."""

from __future__ import annotations

import os
from pathlib import Path
import subprocess
import sys
import time
from typing import Any

from helpers import small_tree
from masmc_ros.law import registry
from masmc_ros.loop import law_change
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.law_change import Effect, LawChange
from masmc_ros.loop.law_code import Code
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

PAPER = Path(__file__).resolve().parents[2] / 'config' / 'paper.yaml'
START = ('rasmc', 'tanh', False)


class FakeCompilation:
    """Compilation that a test completes on request."""

    made: list[FakeCompilation]

    def __init__(
        self,
        mechanism: Any,
        code: Code,
        values: dict[str, Any],
        preparation: Any,
        *,
        is_awaited: bool,
    ) -> None:
        self.code, self.values = code, values
        self.failure: str | None = None
        self.duration = 2.0
        self.is_stopped, self.is_ready = False, False
        self.made.append(self)

    def is_alive(self) -> bool:
        return not self.is_ready

    def stop(self) -> None:
        self.is_stopped = True

    def join(self) -> None:
        assert self.is_stopped


class Bench:
    """A controller and its pending change; the code of laws in `loaded` is available."""

    def __init__(self) -> None:
        values = load_scenario(str(PAPER))['controller']
        self.controller = Controller(robot_of(values), 1e-3, values)
        self.loaded = {START}
        self.made: list[FakeCompilation] = []

    def make_ready(self, failure: str | None = None) -> None:
        compilation = self.made[-1]
        compilation.is_ready, compilation.failure = True, failure
        if failure is None:
            self.loaded.add(compilation.code.name)

    def values(self, *names: str) -> tuple[Any, ...]:
        return tuple(self.controller.values[name] for name in names)


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    harness = Bench()
    fake = type('_', (FakeCompilation,), {'made': harness.made})
    monkeypatch.setattr(law_change, '_Making', fake)
    monkeypatch.setattr(Code, 'is_loaded', property(lambda code: code.name in harness.loaded))
    monkeypatch.setattr(Code, 'is_on_disk', property(lambda code: False))
    monkeypatch.setattr(Code, 'load', lambda code: None)
    return harness


def test_law_change_code_loaded_applies_at_once(bench: Bench) -> None:
    bench.loaded.add(('smc', 'tanh', False))
    change = LawChange(bench.controller)
    assert change.request({'law': 'smc'}) == Effect({'law': 'smc'})
    assert bench.values('law') == ('smc',)
    assert not change.is_pending
    assert change.poll() is None


def test_law_change_code_missing_waits_for_compilation(bench: Bench) -> None:
    change = LawChange(bench.controller)
    effect = change.request({'law': 'pid'})
    text = 'law = pid: compiling; rasmc continues until the code is ready'
    assert effect == Effect({}, text=text)
    assert change.request({'law': 'pid'}) == effect
    assert len(bench.made) == 1
    for _ in range(10):
        assert change.poll() is None
        assert bench.values('law') == ('rasmc',)
    assert change.awaited == 'the compiled code of law = pid'
    bench.make_ready()
    applied = change.poll()
    assert applied is not None
    assert applied.values == {'law': 'pid'}
    assert applied.text == 'law = pid: ready after 2.0 s; now active'
    assert bench.values('law') == ('pid',)
    assert change.awaited == ''
    assert change.poll() is None


def test_law_change_switching_message_names_continuing_term(bench: Bench) -> None:
    change = LawChange(bench.controller)
    effect = change.request({'switching': 'sign'}, waits=True)
    assert effect.text == 'switching = sign: compiling; the run waits until the code is ready'
    assert 'tanh continues' in change.request({'switching': 'sigmoid'}).text


def test_law_change_while_pending_replaces_earlier_one(bench: Bench) -> None:
    change = LawChange(bench.controller)
    change.request({'law': 'pid'})
    change.request({'law': 'smc', 'switching': 'sign'})
    assert [compilation.is_stopped for compilation in bench.made] == [True, False]
    bench.make_ready()
    applied = change.poll()
    assert applied is not None
    assert applied.values == {'law': 'smc', 'switching': 'sign'}
    assert bench.values('law', 'switching') == ('smc', 'sign')


def test_law_change_back_to_active_law_cancels_pending_one(bench: Bench) -> None:
    change = LawChange(bench.controller)
    change.request({'law': 'pid'})
    assert change.request({'law': 'rasmc'}) == Effect({})
    assert bench.made[-1].is_stopped
    assert not change.is_pending
    bench.make_ready()
    assert change.poll() is None
    assert bench.values('law') == ('rasmc',)


def test_law_change_pending_other_parameter_applies_at_once(bench: Bench) -> None:
    change = LawChange(bench.controller)
    change.request({'law': 'pid', 'sigma': (1.0,) * 4})
    new = {'observer_gain': 0.5}
    assert change.request(new) == Effect(new)
    assert bench.values('law', 'observer_gain', 'sigma') == ('rasmc', 0.5, (2.0,) * 4)
    # A parameter requested with the law and then alone applies at once.
    assert change.request({'sigma': (3.0,) * 4}) == Effect({'sigma': (3.0,) * 4})
    bench.make_ready()
    applied = change.poll()
    assert applied is not None
    assert applied.values == {'law': 'pid'}
    assert bench.values('law', 'observer_gain', 'sigma') == ('pid', 0.5, (3.0,) * 4)


def test_law_change_values_requested_together_apply_together(bench: Bench) -> None:
    change = LawChange(bench.controller)
    change.request({'law': 'pid', 'observer_gain': 0.5})
    assert bench.values('law', 'observer_gain') == ('rasmc', 0.0)
    bench.make_ready()
    assert change.poll() is not None
    assert bench.values('law', 'observer_gain') == ('pid', 0.5)


def test_law_change_compilation_fails_keeps_active_law(bench: Bench) -> None:
    change = LawChange(bench.controller)
    for _ in range(2):
        change.request({'law': 'pid', 'observer_gain': 0.5})
        bench.make_ready(failure='NameError: no such name')
        applied = change.poll()
        assert applied is not None
        assert (applied.values, applied.withdrawn) == ({}, ('law', 'observer_gain'))
        assert 'failed: NameError: no such name; rasmc continues' in applied.text
        assert bench.values('law', 'observer_gain') == ('rasmc', 0.0)
        assert not change.is_pending
    assert len(bench.made) == 2


def test_law_change_law_raises_keeps_active_law(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Failing:
        def __init__(self) -> None:
            raise ValueError('no such file')

    bench.loaded.add(('pid', 'tanh', False))
    change = LawChange(bench.controller)
    memory = bench.controller.memory
    monkeypatch.setattr(registry, 'load_for', lambda name, mechanism: Failing)
    effect = change.request({'law': 'pid'})
    assert effect.withdrawn == ('law',)
    assert 'ValueError: no such file; rasmc continues' in effect.text
    assert bench.values('law') == ('rasmc',)
    assert bench.controller.memory is memory


def test_law_change_closed_cancels_pending_one(bench: Bench) -> None:
    change = LawChange(bench.controller)
    change.close()
    change.request({'law': 'pid'})
    change.close()
    assert bench.made[-1].is_stopped
    assert not change.is_pending


def test_law_change_first_latency_waits_for_compilation(bench: Bench) -> None:
    change = LawChange(bench.controller)
    effect = change.request({'latency': 0.01})
    assert effect.text == 'latency = 0.01: compiling; rasmc continues until the code is ready'
    assert bench.values('latency') == (0.0,)
    # Any later latency has the same code.
    change.request({'latency': 0.02})
    assert len(bench.made) == 1
    bench.make_ready()
    assert change.poll() is not None
    assert bench.values('latency') == (0.02,)
    assert bench.controller.is_compensated
    assert change.request({'latency': 0.03}) == Effect({'latency': 0.03})


BUSY = 300.0
"""Limit in s for a compilation on a processor that another process uses as well."""

LATE = 0.02
"""Largest permitted lateness of a tick in s."""


@pytest.mark.slow
def test_law_change_compiled_meanwhile_no_tick_is_late(tmp_path: Path) -> None:
    """A process compiles the code and a thread loads it, while this thread computes ticks."""
    path = small_tree.write_scenario(tmp_path, small_tree.hand_at_start(), 1.0)
    values = load_scenario(str(path))['controller']
    robot = robot_of(values)
    controller = Controller(robot, 1e-3, values)
    change = LawChange(controller)
    position = np.array(robot.start((0.0, 0.0, 0.0), small_tree.START))
    velocity = np.zeros(len(position))
    reference = np.zeros(3 * len(robot.mechanism.axes))
    reference[:len(robot.mechanism.axes)] = robot.task_positions(position[None])[0]
    controller.tick(position, velocity, reference)
    latest, busiest = {}, 0.0
    try:
        for law in ('pid', 'computed_torque', 'super_twisting'):
            start = time.thread_time()
            effect = change.request({'law': law})
            applied = effect if effect.values else None
            late, due = time.thread_time() - start, time.monotonic()
            while applied is None:
                due = max(due + 2e-3, time.monotonic())
                used = time.process_time()
                time.sleep(max(0.0, due - time.monotonic()))
                start = time.thread_time()
                applied = change.poll()
                controller.tick(position, velocity, reference)
                busiest = max(busiest, time.thread_time() - start)
                # Time in which other processes have the processors is no work of this one.
                late = max(late, min(time.monotonic() - due, time.process_time() - used))
            assert not applied.withdrawn, applied.text
            latest[law] = late
    finally:
        change.close()
    assert busiest < LATE
    # Other processes of the machine may delay single ticks, but not those of every change.
    assert min(latest.values()) < LATE, latest


BUSY_PROCESSOR = """
import os, subprocess, sys, time
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.law_change import LawChange
from masmc_ros.scenario.scenario import load_scenario
from masmc_ros.robot.robot import robot_of

values = load_scenario(sys.argv[1])['controller']
controller = Controller(robot_of(values), 1e-3, values)
change = LawChange(controller)
os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # of this process and those it starts
loop = 'import os; node = os.getppid()\\nwhile os.getppid() == node: pass'
busy = subprocess.Popen([sys.executable, '-c', loop])
try:
    print(change.request({'law': 'pid'}).text)
    while (applied := change.poll()) is None:
        time.sleep(0.05)
    print(applied.text)
finally:
    change.close()
    busy.kill()
    busy.wait()
"""


@pytest.mark.slow
def test_law_change_no_idle_processor_compiles_nevertheless(tmp_path: Path) -> None:
    """The process of the first attempt has a three-hundredth of the processor's time."""
    if not hasattr(os, 'sched_setaffinity'):
        pytest.skip('no permission to choose a processor')
    done = subprocess.run(
        [sys.executable, '-c', BUSY_PROCESSOR, PAPER],
        env={**os.environ, 'XDG_CACHE_HOME': str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=BUSY,
    )
    first, last = done.stdout.splitlines()
    assert 'compiling' in first, done.stderr
    assert last.endswith('now active'), done.stderr
