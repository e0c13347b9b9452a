# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Declarations of a law: classes and tuples, and mistakes in them."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

from helpers.law_module import module_of
from masmc_ros.jit.field import Field
from masmc_ros.law.declared import PerEntry
from masmc_ros.loop.law_dry_run import run_dry
from masmc_ros.mistakes import MistakeError, place_and_text
from masmc_ros.params.declaration import Parameter
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
import pytest

FORMULAS = '''
@formula
def force(s, w, k):
    return w - k * s


@formula
def torque(settings, tick, memory):
    memory.mine_count = memory.mine_count + 1
    u = elementwise(force, tick.surface, memory.mine_w, settings.mine_k)
    return model_torque(tick, memory.estimate, u)
'''

CLASSES = f'''
import math

from masmc_ros import aliases
from masmc_ros.aliases import Axes, Joints, Numbers, Positions
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law import fields
from masmc_ros.law.fields import field, gain
from masmc_ros.law.law import Law
from masmc_ros.law.parts.model import model_torque
from masmc_ros.law.parts.surface import SIGMA


class Settings(fields.Settings, group='mine'):
    mine_k: Axes = gain(60.0, 'Gain k', 'N·s/m', note='; 0: nothing')
    mine_inner_k: aliases.Joints = gain('torque_limit', 'Limit', 'N·m', is_positive=True)
    mine_rate: float = gain(2, 'Rate', '1/s', minimum=1.0, maximum=3.0)
    mine_mode: int = gain('slow', 'Mode', choices=('slow', 'fast'))
    mine_is_on: int = gain(True, 'Switch')
    mine_point: Numbers = gain((0.1, 0.2), 'Point', 'm', minimum=-1.0)


class Memory(fields.Memory):
    mine_w: Axes = field('w', 'N', initial=math.nan)
    mine_count: int = field('Number of ticks')
    mine_table: Numbers = field('Table', size=('axes', 3))

{FORMULAS}

MINE = Law('mine', torque, (*Settings, SIGMA), Memory)
'''

TUPLES = f'''
import math

from masmc_ros.jit.compiled import formula
from masmc_ros.jit.field import Field
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law.declared import PerEntry
from masmc_ros.law.law import Law
from masmc_ros.law.parts.model import ESTIMATE, model_torque
from masmc_ros.law.parts.surface import SIGMA
from masmc_ros.params.declaration import Parameter

PARAMETERS = (
    PerEntry('mine.k', 'axes', 60.0, 'Gain k', 'N·s/m', '; 0: nothing'),
    PerEntry('mine.inner_k', 'joints', 'torque_limit', 'Limit', 'N·m', is_positive=True),
    Parameter('mine.rate', 2.0, 'Rate', '1/s', minimum=1.0, maximum=3.0, read_only=False),
    Parameter('mine.mode', 'slow', 'Mode', choices=('slow', 'fast'), read_only=False),
    Parameter('mine.is_on', True, 'Switch', read_only=False),
    Parameter('mine.point', (0.1, 0.2), 'Point', 'm', length=2, minimum=-1.0, read_only=False),
    SIGMA,
)

MEMORY = (
    ESTIMATE,
    Field('mine_w', 'axes', 'w', 'N', initial=math.nan),
    Field('mine_count', description='Number of ticks', kind='i8'),
    Field('mine_table', ('axes', 3), 'Table'),
)

{FORMULAS}

MINE = Law('mine', torque, PARAMETERS, MEMORY)
'''

MISTAKES = {
    'unknown annotation': ('mine_k: Axes', 'mine_k: Axis', 'did you mean Axes?'),
    'name without its group': ('mine_k: Axes', 'k: Axes', 'a name that starts with mine_'),
    'missing annotation': ('mine_k: Axes =', 'mine_k =', 'mine_k: expected an annotation'),
    'missing description': ("60.0, 'Gain k', 'N·s/m'", '60.0', "'description'"),
    'missing declaration': (
        " = gain(60.0, 'Gain k', 'N·s/m', note='; 0: nothing')", '', 'mine_k: expected gain',
    ),
    'number without declaration': (
        "gain(60.0, 'Gain k', 'N·s/m', note='; 0: nothing')", '60.0', 'mine_k = 60.0: expected',
    ),
    'default of two entries': ('gain(60.0', 'gain((60.0, 1.0)', 'one number for all axes'),
    'default out of range': ('gain(60.0', 'gain(-1.0', 'mine.k = -1.0: expected a number >= 0'),
    'text without choices': ("gain('torque_limit'", 'gain(0.0', 'expected a number > 0'),
    'fraction for a whole number': ('gain(True', 'gain(0.5', 'expected int or str, as annotated'),
    'number for an array': ('gain((0.1, 0.2)', 'gain(0.1', 'expected tuple, as annotated'),
    'default beyond the maximum': ('gain(2,', 'gain(4,', 'mine.rate = 4.0: expected a number in'),
    'bound of a vector': ("note='; 0: nothing'", 'maximum=5.0', 'maximum: only for one number'),
    'vector without a size': (", size=('axes', 3)", '', 'expected Numbers = field(..., size=...)'),
    'two sizes': ("field('w', 'N'", "field('w', 'N', size=3", 'such as Axes, without it'),
    'vector of another kind': ('mine_k: Axes', 'mine_k: Positions', 'expected float, int, Axes'),
    'class without base': ('class Memory(fields.Memory)', 'class Memory', 'derived from fields.M'),
    'gain in the memory': ("field('Number of ticks')", "gain(1, 'Number')", 'mine: memory:'),
    'memory in the parameters': ('SIGMA), Memory', '*Memory), Memory', 'parameters:'),
}  # fmt: skip


@pytest.fixture
def classes(tmp_path: Path) -> ModuleType:
    """Return the module of the law that declares its fields in classes."""
    return module_of(tmp_path / 'classes.py', CLASSES)


@pytest.fixture
def tuples(tmp_path: Path) -> ModuleType:
    """Return the module of the law that declares its fields in tuples, as earlier ones."""
    return module_of(tmp_path / 'tuples.py', TUPLES)


def test_declared_classes_equal_tuples(classes: ModuleType, tuples: ModuleType) -> None:
    assert classes.MINE.parameters == tuples.MINE.parameters
    assert classes.MINE.memory == tuples.MINE.memory[1:]
    assert {type(p) for p in classes.MINE.parameters} == {Parameter, PerEntry}
    assert {type(f) for f in classes.MINE.memory} == {Field}


@pytest.mark.parametrize('form', ['classes', 'tuples'])
def test_declared_law_passes_dry_run(form: str, request: pytest.FixtureRequest) -> None:
    run_dry(request.getfixturevalue(form).MINE, TWO_LINK, 'implicit')


def test_declared_annotations_as_objects_equal_texts(tmp_path: Path) -> None:
    future = 'from __future__ import annotations\n'
    one, other = (
        module_of(tmp_path / f'{name}.py', text + CLASSES)
        for name, text in (('texts', future), ('objects', ''))
    )
    assert one.MINE.parameters == other.MINE.parameters
    assert one.MINE.memory == other.MINE.memory


def test_declared_class_of_class_has_fields_of_both(classes: ModuleType, tmp_path: Path) -> None:
    source = CLASSES + '''

class More(Settings, group='more'):
    more_k: float = gain(1.0, 'More')
'''
    module = module_of(tmp_path / 'more.py', source)
    assert (*module.More,)[:-1] == classes.MINE.parameters[:-1]
    assert (*module.More,)[-1].name == 'more.k'


@pytest.mark.parametrize('name', MISTAKES)
@pytest.mark.parametrize('future', ['', 'from __future__ import annotations\n'])
def test_declared_mistake_is_one_line(name: str, future: str, tmp_path: Path) -> None:
    correct, wrong, text = MISTAKES[name]
    assert CLASSES.count(correct) == 1
    path = tmp_path / 'mine.py'
    with pytest.raises((MistakeError, TypeError, NameError)) as raised:
        module_of(path, future + CLASSES.replace(correct, wrong))
    message = place_and_text(raised.value)
    assert message.startswith(f'{path}:')
    assert ' in: ' in message
    assert '\n' not in message
    if not isinstance(raised.value, NameError):
        assert text in message


def test_declared_mistake_names_line_of_field(tmp_path: Path) -> None:
    path = tmp_path / 'mine.py'
    source = CLASSES.replace('gain(60.0', 'gain(-1.0')
    with pytest.raises(MistakeError) as raised:
        module_of(path, source)
    line = next(n for n, text in enumerate(source.splitlines(), 1) if 'gain(-1.0' in text)
    assert str(raised.value).startswith(f'{path}:{line}: mine.k = -1.0: expected a number >= 0')
