# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Changes of the law whose code must be made first, step by step, without compiling any."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from masmc_ros.law import registry
from masmc_ros.loop import preparation
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.preparation import Code, Effect, LawChange
from masmc_ros.params.scenario import load_scenario
from masmc_ros.robot.robot import robot_of
import pytest

PAPER = Path(__file__).resolve().parents[2] / 'config' / 'paper.yaml'
START = ('rasmc', 'tanh')


class Making:
    """Code that is made as fast as a test wants it."""

    made: list[Making]

    def __init__(self, mechanism: Any, code: Code, values: dict[str, Any]) -> None:
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
    """A controller and its changes; the code of `loaded` is loaded."""

    def __init__(self) -> None:
        values = load_scenario(str(PAPER))['controller']
        self.controller = Controller(robot_of(values), 1e-3, values)
        self.loaded = {START}
        self.made: list[Making] = []

    def make_ready(self, failure: str | None = None) -> None:
        making = self.made[-1]
        making.is_ready, making.failure = True, failure
        if failure is None:
            self.loaded.add(making.code.name)

    def values(self, *names: str) -> tuple[Any, ...]:
        return tuple(self.controller.values[name] for name in names)


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    made = Bench()
    monkeypatch.setattr(preparation, '_Making', type('_', (Making,), {'made': made.made}))
    monkeypatch.setattr(Code, 'is_loaded', property(lambda code: code.name in made.loaded))
    monkeypatch.setattr(Code, 'is_on_disk', property(lambda code: False))
    monkeypatch.setattr(Code, 'load', lambda code: None)
    return made


def test_change_of_loaded_code_applies_at_once(bench: Bench) -> None:
    bench.loaded.add(('smc', 'tanh'))
    change = LawChange(bench.controller)
    assert change.request({'law': 'smc'}) == Effect({'law': 'smc'})
    assert bench.values('law') == ('smc',)
    assert not change.is_pending
    assert change.poll() is None


def test_change_of_missing_code_waits_until_it_is_ready(bench: Bench) -> None:
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
    found = change.poll()
    assert found is not None
    assert found.values == {'law': 'pid'}
    assert found.text == 'law = pid: ready after 2.0 s; now in force'
    assert bench.values('law') == ('pid',)
    assert change.awaited == ''
    assert change.poll() is None


def test_change_with_switching_names_what_continues(bench: Bench) -> None:
    change = LawChange(bench.controller)
    effect = change.request({'switching': 'sign'}, waits=True)
    assert effect.text == 'switching = sign: compiling; the run waits until the code is ready'
    assert 'tanh continues' in change.request({'switching': 'sigmoid'}).text


def test_change_while_one_is_pending_replaces_it(bench: Bench) -> None:
    change = LawChange(bench.controller)
    change.request({'law': 'pid'})
    change.request({'law': 'smc', 'switching': 'sign'})
    assert [making.is_stopped for making in bench.made] == [True, False]
    bench.make_ready()
    found = change.poll()
    assert found is not None
    assert found.values == {'law': 'smc', 'switching': 'sign'}
    assert bench.values('law', 'switching') == ('smc', 'sign')


def test_change_back_to_law_in_force_ends_pending_one(bench: Bench) -> None:
    change = LawChange(bench.controller)
    change.request({'law': 'pid'})
    assert change.request({'law': 'rasmc'}) == Effect({})
    assert bench.made[-1].is_stopped
    assert not change.is_pending
    bench.make_ready()
    assert change.poll() is None
    assert bench.values('law') == ('rasmc',)


def test_other_parameter_while_pending_applies_at_once(bench: Bench) -> None:
    change = LawChange(bench.controller)
    change.request({'law': 'pid', 'sigma': (1.0,) * 4})
    new = {'observer_gain': 0.5}
    assert change.request(new) == Effect(new)
    assert bench.values('law', 'observer_gain', 'sigma') == ('rasmc', 0.5, (2.0,) * 4)
    # One that was requested with the law, and alone since, counts at once.
    assert change.request({'sigma': (3.0,) * 4}) == Effect({'sigma': (3.0,) * 4})
    bench.make_ready()
    found = change.poll()
    assert found is not None
    assert found.values == {'law': 'pid'}
    assert bench.values('law', 'observer_gain', 'sigma') == ('pid', 0.5, (3.0,) * 4)


def test_values_requested_together_apply_together(bench: Bench) -> None:
    change = LawChange(bench.controller)
    change.request({'law': 'pid', 'observer_gain': 0.5})
    assert bench.values('law', 'observer_gain') == ('rasmc', 0.0)
    bench.make_ready()
    assert change.poll() is not None
    assert bench.values('law', 'observer_gain') == ('pid', 0.5)


def test_failure_to_compile_keeps_law_in_force(bench: Bench) -> None:
    change = LawChange(bench.controller)
    for _ in range(2):
        change.request({'law': 'pid', 'observer_gain': 0.5})
        bench.make_ready(failure='NameError: no such name')
        found = change.poll()
        assert found is not None
        assert (found.values, found.withdrawn) == ({}, ('law', 'observer_gain'))
        assert 'failed: NameError: no such name; rasmc continues' in found.text
        assert bench.values('law', 'observer_gain') == ('rasmc', 0.0)
        assert not change.is_pending
    assert len(bench.made) == 2


def test_failure_to_make_law_keeps_law_in_force(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Failing:
        def __init__(self) -> None:
            raise ValueError('no such file')

    bench.loaded.add(('pid', 'tanh'))
    change = LawChange(bench.controller)
    memory = bench.controller.memory
    monkeypatch.setattr(registry, 'load_for', lambda name, mechanism: Failing)
    found = change.request({'law': 'pid'})
    assert found.withdrawn == ('law',)
    assert 'ValueError: no such file; rasmc continues' in found.text
    assert bench.values('law') == ('rasmc',)
    assert bench.controller.memory is memory


def test_close_ends_pending_change(bench: Bench) -> None:
    change = LawChange(bench.controller)
    change.close()
    change.request({'law': 'pid'})
    change.close()
    assert bench.made[-1].is_stopped
    assert not change.is_pending
