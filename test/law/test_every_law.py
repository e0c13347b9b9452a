# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Properties of every law: identical results tick by tick, limits, pauses, changes of the law."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import re
from typing import Any

from helpers.law_bench import PAPER
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import interpreted
from masmc_ros.law import registry
from masmc_ros.law.registry import LAWS
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.simulation import Simulation
from masmc_ros.robot.robot import robot_of
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

DOCS = Path(__file__).parents[2] / 'docs' / 'reference' / 'laws'
OTHERS = [name for name in LAWS if name not in ('smc', 'rasmc')]
SHORT = 'duration=0.4'
SECTIONS = [
    'Summary',
    'Equations',
    'Reference',
    'Assumptions',
    'Discretisation',
    'Tuning',
    'Results',
    'Parameters',
]


@pytest.fixture
def uncompiled() -> Iterator[None]:
    """Run formulas as plain Python, which has the same bits; compiling takes longer."""
    with interpreted(), np.errstate(all='ignore'):
        yield


def scenario(law: str, *settings: str) -> Any:
    """Return a short run of the paper's experiment with a law."""
    return load_scenario(PAPER, (SHORT, f'controller.law={law}', *settings))


@pytest.mark.parametrize('law', LAWS)
def test_law_documentation_has_all_sections(law: str) -> None:
    text = (DOCS / f'{law}.md').read_text(encoding='utf-8')
    assert text.startswith(f'# `{law}`')
    assert re.findall('^## (.*)$', text, re.MULTILINE) == SECTIONS
    assert f'--set controller.law={law}' in text
    sections = dict(zip(SECTIONS, re.split('^## .*$', text, flags=re.MULTILINE)[1:], strict=True))
    assert '\n**Differences.** ' in sections['Reference']
    conditions, _, experiment = sections['Assumptions'].partition("\n**Paper's experiment:** ")
    assert '\n**Conditions.** ' in conditions
    assert experiment
    assert LAWS[law].summary
    assert LAWS[law].source


@pytest.mark.slow
@pytest.mark.parametrize('law', OTHERS)
def test_law_single_ticks_equal_compiled_run(law: str) -> None:
    """Single ticks, as in the nodes, are bitwise identical to the compiled run."""
    values = scenario(law)
    whole = next(Simulation(values).run())
    controller = Controller(robot_of(values['controller']), 1e-3, values['controller'])
    for k in range(len(whole)):
        controller.tick(whole.position[k], whole.velocity[k], whole.reference[k])
        np.testing.assert_array_equal(controller.torque, whole.torque[k])
        np.testing.assert_array_equal(controller.used_estimate, whole.estimate[k])


@pytest.mark.usefixtures('uncompiled')
@pytest.mark.parametrize('law', OTHERS)
def test_law_limited_torque_keeps_run_finite(law: str) -> None:
    """Torques and their rates stay within limits; states and estimates stay finite."""
    limits = ('controller.torque_limit=1.0', 'controller.torque_rate_limit=50.0')
    run = next(Simulation(scenario(law, 'duration=0.1', *limits)).run())
    assert np.abs(run.torque).max() <= 1.0
    assert np.abs(np.diff(run.torque, axis=0)).max() <= 50.0 * 1e-3 * (1.0 + 1e-12)
    assert np.isfinite(run.position).all()
    assert np.isfinite(run.estimate).all()


@pytest.mark.usefixtures('uncompiled')
@pytest.mark.parametrize('law', OTHERS)
def test_law_after_pause_or_reset_has_no_old_state(law: str) -> None:
    """After a pause or skipped ticks torques are finite; a reset restarts the law."""
    values = scenario(law)['controller']
    controller = Controller(robot_of(values), 1e-3, values)
    run = next(Simulation(scenario(law, 'duration=0.1')).run())

    def torque(k: int) -> Any:
        controller.tick(run.position[k], run.velocity[k], run.reference[k])
        return controller.torque.copy()

    first = [torque(k) for k in range(20)]
    controller.skip(5)
    assert np.isfinite(torque(26)).all()
    controller.output_not_applied()
    assert np.isfinite(torque(90)).all()
    controller.reset()
    np.testing.assert_array_equal([torque(k) for k in range(20)], first)


def test_registry_plug_in_with_built_in_name_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plug-in does not replace a built-in law; the user of that name gets an error."""
    monkeypatch.setattr(registry, 'plugged_in', lambda group: ('mine', 'smc'))
    assert registry.names() == (*LAWS, 'mine')
    with pytest.raises(InputError, match=r'law = smc: an installed package brings'):
        registry.load_for('smc', TWO_LINK)
    # Other laws are not affected.
    assert registry.load_for('rasmc', TWO_LINK) is LAWS['rasmc']


@pytest.mark.usefixtures('uncompiled')
def test_law_change_keeps_torque_rate_limit() -> None:
    """The torque rate stays within its limit while the law changes through all laws in one run."""
    limit = 2000.0
    values = scenario('rasmc', f'controller.torque_rate_limit={limit}')
    plant = Simulation(values)
    controller, robot = plant.controller, plant.plant
    plant.plant.reset()
    before = None
    for number, law in enumerate(LAWS):
        controller.change({'law': law})
        for k in range(15):
            reference = plant.trajectory.sample(15 * number + k, 1)[0]
            controller.tick(robot.position, robot.velocity, reference)
            if before is not None:
                step = np.abs(controller.torque - before).max()
                assert step <= limit * 1e-3 * (1.0 + 1e-12), law
            before = controller.torque.copy()
            assert np.isfinite(before).all()
            robot.advance(before)


@pytest.mark.usefixtures('uncompiled')
def test_law_after_plain_python_starts_without_old_disturbance(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Plain Python continues neither predictions nor the estimate of the implicit law."""
    settings = ('controller.switching=implicit', 'controller.observer_gain=0.5')
    values = scenario('smc', *settings)['controller']

    class Still:
        parameters = ()

        def step(self, tick: Any) -> Any:
            return np.zeros(4), tick.estimate

    load = registry.load_for
    monkeypatch.setattr(
        registry, 'load_for', lambda name, kind: Still if name == 'still' else load(name, kind)
    )
    run = next(Simulation(scenario('smc', 'duration=0.2', *settings)).run())
    controller = Controller(robot_of(values), 1e-3, values)
    fresh = Controller(robot_of(values), 1e-3, values)

    def tick(law: Controller, k: int) -> Any:
        law.tick(run.position[k], run.velocity[k], run.reference[k])
        return law.torque.copy()

    for k in range(20):
        tick(controller, k)
    controller.change({'law': 'still'})
    tick(controller, 20)
    controller.change({'law': 'smc'})
    np.testing.assert_allclose(tick(controller, 190), tick(fresh, 190), rtol=1e-9)
    assert not controller.memory['disturbance_torque'].any()
