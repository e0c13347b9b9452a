# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Mistakes in laws and reaching terms: one line with place, mistake and known names."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

from helpers.law_module import module_of
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import is_interpreted, kernel
from masmc_ros.law import registry
from masmc_ros.law.law import Law
from masmc_ros.law.registry import LAWS, OF_RATES
from masmc_ros.loop.law_dry_run import run_dry
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
import numpy as np
import pytest

SOURCE = '''
import math

from masmc_ros.law.law import Law
from masmc_ros.law.parts.model import ESTIMATE, model_torque
from masmc_ros.law.reaching.reaching import GAINS, reach, Reaching
from masmc_ros.law.reaching.sign import sign
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.field import Field
from masmc_ros.jit.tuples import elementwise
from masmc_ros.params.declaration import Parameter
from masmc_ros.robot import mechanism

K_1 = Parameter('mine.k_1', 60.0, 'Gain of the root', minimum=0.0, read_only=False)
MEMORY = (
    ESTIMATE,
    Field('mine_w', 'axes', 'Integral part of u', 'N'),
    Field('mine_count', description='Number of ticks', kind='i8'),
)


@formula
def force(s, w, k_1):
    return w - k_1 * math.sqrt(abs(s)) * sign(s)


@formula
def following(w, s, period):
    return w - period * sign(s)


@formula
def term_reach(settings, tick, memory):
    u = elementwise(force, tick.surface, tick.surface, settings.boundary_layer)
    return u


@formula
def torque(settings, tick, memory):
    w = memory.mine_w
    u = elementwise(force, tick.surface, w, settings.mine_k_1)
    v = reach(settings, tick, memory)
    theta = memory.estimate
    raw = model_torque(tick, theta, u)
    return raw


@formula
def learn(settings, tick, memory, raw, torque):
    w = elementwise(following, memory.mine_w, tick.surface, tick.period)
    memory.mine_w = w
    memory.mine_count = 1


TERM = Reaching('mine_term', term_reach, parameters=GAINS)
MINE = Law('mine', torque, (K_1,), MEMORY, learn)
'''

MISTAKES = {
    'unknown setting': ('settings.mine_k_1', 'settings.mine_k1', 'did you mean mine_k_1'),
    'undeclared memory': ('memory.mine_w = w', 'memory.mine_x = w', "no 'mine_x': did you mean"),
    'memory that is read is undeclared': (
        'theta = memory.estimate', 'theta = memory.estimates', 'did you mean estimate',
    ),
    'unknown field of the tick': (
        'w = elementwise(following, memory.mine_w, tick.surface, tick.period)',
        'w = elementwise(following, memory.mine_w, tick.surfaces, tick.period)',
        "tick has no 'surfaces': did you mean surface",
    ),
    'number instead of vector': (
        'memory.mine_w = w', 'memory.mine_w = w[0]', 'expected a vector of 4 numbers',
    ),
    'vector instead of number': (
        'memory.mine_count = 1', 'memory.mine_count = w', 'a tuple of 4: expected one number',
    ),
    'parameters instead of axes': (
        'memory.mine_w = w', 'memory.mine_w = memory.estimate', 'a tuple of 7: expected a vector',
    ),
    'fraction in a whole number': (
        'memory.mine_count = 1', 'memory.mine_count = 0.5', 'expected a whole number',
    ),
    'vectors of different lengths': (
        'w, settings.mine_k_1)', 'memory.estimate, settings.mine_k_1)', 'got [4, 7]',
    ),
    'settings are written': (
        'memory.mine_count = 1', 'settings.mine_k_1 = 2.0', 'settings.mine_k_1 is read-only',
    ),
    'tick is written': ('memory.mine_count = 1', 'tick.period = 2.0', "can't set attribute"),
    'nothing is returned': ('    return raw\n', '    raw\n', 'torque returns nothing'),
    'one number is returned': ('return raw', 'return raw[0]', 'one per joint'),
    'number times vector': ('raw = model', 'raw = 2.0 * model', 'elementwise(formula, a, b)'),
    'method of a vector': ('raw = model', 'raw = w.sum() + model', 'vectors have no methods'),
    'function without decorator': (
        '@formula\ndef force', 'def force', 'force is an ordinary function; expected',
    ),
    'missing argument': ('w, settings.mine_k_1)', 'w)', "missing 1 required positional argument"),
    'argument too many': ('tick, theta, u)', 'tick, theta, u, u)', 'positional arguments'),
    'missing import': ('import math\n', '', 'math is not defined'),
    'entry beyond the end': ('raw = model', 'w[9]; raw = model', 'index out of range'),
    'unknown function of the robot': (
        'raw = model_torque(tick, theta, u)', 'raw = mechanism.inertial(tick.model)',
        "mechanism has no 'inertial': did you mean inertia",
    ),
    'arguments of learn': ('memory, raw, torque):', 'memory):', 'takes 3 positional arguments'),
    'mistake in the reaching term': (
        'settings.boundary_layer', 'settings.boundary_layers', 'did you mean boundary_layer',
    ),
}  # fmt: skip


def run(module: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run the law of a module dry, with its reaching term."""
    monkeypatch.setitem(registry.REACHING, 'mine_term', module.TERM)
    run_dry(module.MINE, TWO_LINK, 'mine_term')


@pytest.mark.parametrize('name', MISTAKES)
def test_dry_run_mistake_is_one_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if name == 'function without decorator' and is_interpreted():
        pytest.skip('formulas are interpreted')
    correct, wrong, text = MISTAKES[name]
    assert SOURCE.count(correct) == 1
    path = tmp_path / 'mine.py'
    with pytest.raises(InputError) as raised:
        run(module_of(path, SOURCE.replace(correct, wrong)), monkeypatch)
    message = str(raised.value)
    assert message.startswith(f'law = mine: {path}:')
    assert text in message
    assert '\n' not in message


def test_dry_run_names_line_and_source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / 'mine.py'
    source = SOURCE.replace('memory.mine_w = w', 'memory.mine_v = w')
    line = source.splitlines().index('    memory.mine_v = w') + 1
    with pytest.raises(InputError) as raised:
        run(module_of(path, source), monkeypatch)
    assert str(raised.value).startswith(f"law = mine: {path}:{line}: memory has no 'mine_v'")
    assert str(raised.value).endswith('in: memory.mine_v = w')


def test_dry_run_correct_law_passes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run(module_of(tmp_path / 'mine.py', SOURCE), monkeypatch)


@pytest.mark.parametrize('law', [*LAWS.values(), OF_RATES], ids=lambda law: law.name)
def test_dry_run_built_in_law_passes(law: Law) -> None:
    for switching in registry.SWITCHING if law.name == 'smc' else ('implicit',):
        run_dry(law, TWO_LINK, switching)


@kernel
def _of_two_types(values: np.ndarray) -> float:
    if values[0] > 0.0:
        return (1.0, 2.0)
    return 1.0


def test_compiler_error_is_one_line() -> None:
    if not hasattr(_of_two_types, 'compile'):
        pytest.skip('formulas are interpreted')
    with pytest.raises(InputError) as raised:
        _of_two_types(np.ones(2))
    assert str(raised.value).startswith(f'{Path(__file__).resolve()}:')
    assert "Can't unify return type" in str(raised.value)
    assert '\n' not in str(raised.value)
