# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Mistakes in mechanisms of other packages: one line with place, mistake and known names."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import cart_arm
from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import is_interpreted
from masmc_ros.robot.declaration import Mechanism, register
from masmc_ros.robot.mechanism_dry_run import run_dry
from masmc_ros.robot.mechanisms import ENTRY_POINTS
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
import pytest

SOURCE = Path(cart_arm.__file__).read_text(encoding='utf-8')

MISTAKES = {
    'unknown length': (
        'return position[0] + model.arm *', 'return position[0] + model.arms *',
        "lengths has no 'arms': did you mean arm",
    ),
    'unknown field of the posture': (
        'bend = -posture.s', 'bend = -posture.sine', "posture has no 'sine'",
    ),
    'unknown field of the record': (
        'lengths = record.geometry', 'lengths = record.geometries', 'did you mean geometry',
    ),
    'unknown parameter': ("values['pulley_radius']", "values['radius']", "KeyError: 'radius'"),
    'missing formula': ('def forces(', 'def force(', "no 'forces': expected all names of"),
    'missing helper of the task': ('def task_drift(', 'def drift(', "has no 'task_drift'"),
    'too few components': (
        'return model.pulley * rates[0], rates[0], rates[1]',
        'return model.pulley * rates[0], rates[0]',
        'position_rates returns a tuple of 2: expected a vector of 3 numbers, the positions',
    ),
    'too few components of an entry': (
        'return theta[2] - part * theta[1], (-part, 1.0)',
        'return theta[2] - part * theta[1], (-part,)',
        'weakest_motion, entry 1, returns a tuple of 1: expected a vector of 2 numbers',
    ),
    'too few entries': (
        'return theta[2] - part * theta[1], (-part, 1.0)', 'return -part, 1.0, part',
        'weakest_motion returns a tuple of 3: expected a tuple of 2',
    ),
    'number instead of vector': (
        'return model.pulley * forces[0], forces[1]', 'return model.pulley * forces[0]',
        'joint_torques returns float',
    ),
    'nothing is returned': (
        'return -theta[1] * posture.c * motion[1] * motion[1], 0.0', 'theta[1] * motion[1], 0.0',
        'coriolis returns nothing: expected a vector of 2 numbers, the joints',
    ),
    'number times vector': (
        'return command[0] / model.pulley, command[1]', 'return 2.0 * command',
        'elementwise(formula, a, b)',
    ),
    'formula without decorator': (
        '@formula\ndef motion(', 'def motion(', 'motion is an ordinary function; expected',
    ),
    'helper without decorator': (
        '@formula\ndef _inverse_cosine', 'def _inverse_cosine',
        '_inverse_cosine is an ordinary function; expected',
    ),
    'missing argument': ('_inverse_cosine(posture) / model.arm', '_inverse_cosine() / model.arm',
                         'missing 1 required positional argument'),
    'arguments of a formula': (
        'def counts_turns(model: Lengths, resolution: Pair)', 'def counts_turns(model: Lengths)',
        'takes 1 positional argument but 2 were given',
    ),
    'missing import': (
        'from masmc_ros.numerics.portable_math import sin_cos\n', '', 'sin_cos is not defined',
    ),
    'index out of range': ('sin_cos(position[2])', 'sin_cos(position[3])', 'index out of range'),
    'too few lengths': (
        "lengths=('pulley_radius', 'arm_length')", "lengths=('pulley_radius',)",
        'MODEL has the fields pulley, arm: expected 1',
    ),
    'too few parameters': (
        '(mass, m * half, values', '(m * half, values',
        'constants returns a tuple of 2: expected a vector of 3 numbers, theta',
    ),
    'origins of too few frames': (
        '[0.0, 0.0, 0.1], [lengths[1]', '[lengths[1]',
        'frame_origins returns the shape (2, 3): expected (3, 3)',
    ),
    'shape of the twists': (
        'np.zeros((len(position), 6))', 'np.zeros((len(position), 3))',
        'base_motion, twists, returns the shape (2, 3): expected (2, 6)',
    ),
    'no outline': (
        'return Outline((x, 0.0), shapes, below=0.1, text=0.05)', 'return shapes',
        'outline returns a tuple of 2: expected an Outline',
    ),
}  # fmt: skip


def defaults(mechanism: Mechanism) -> dict[str, object]:
    return {p.name.removeprefix('robot.'): p.default for p in mechanism.parameters}


def write(folder: Path, source: str, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Write the module of a mechanism into a folder of modules."""
    path = folder / f'cart_{abs(hash(source))}.py'
    path.write_text(source, encoding='utf-8')
    monkeypatch.syspath_prepend(folder)
    return path


@pytest.mark.parametrize('name', MISTAKES)
def test_dry_run_mistake_in_mechanism_is_one_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if 'without decorator' in name and is_interpreted():
        pytest.skip('formulas are interpreted')
    correct, wrong, text = MISTAKES[name]
    assert SOURCE.count(correct) == 1
    path = write(tmp_path, SOURCE.replace(correct, wrong), monkeypatch)
    mechanism = register(import_module(path.stem).CART_ARM)
    with pytest.raises(InputError) as raised:
        run_dry(mechanism, defaults(mechanism))
    message = str(raised.value)
    assert message.startswith(f'robot.mechanism = cart_arm: {path}')
    assert text in message
    assert '\n' not in message


def test_dry_run_correct_mechanisms_pass() -> None:
    for mechanism in (TWO_LINK, cart_arm.CART_ARM):
        run_dry(register(mechanism), defaults(mechanism))


@pytest.mark.skipif(is_interpreted(), reason='formulas are interpreted')
def test_dry_run_of_installed_mechanism_ends_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    source = SOURCE.replace("'cart_arm'", "'wrong_cart'").replace('model.pulley *', 'model.r *')
    path = write(tmp_path, source, monkeypatch)
    package = tmp_path / 'wrong_cart-1.0.dist-info'
    package.mkdir()
    (package / 'METADATA').write_text('Name: wrong_cart\nVersion: 1.0\n')
    (package / 'entry_points.txt').write_text(
        f'[{ENTRY_POINTS}]\nwrong_cart = {path.stem}:CART_ARM\n'
    )
    file = tmp_path / 'cart.yaml'
    file.write_text('/**:\n  ros__parameters:\n    robot: {mechanism: wrong_cart}\n')
    assert main(['simulate', str(file)]) == 2
    message = capsys.readouterr().err.removesuffix('\n')
    assert f"robot.mechanism = wrong_cart: {path}:" in message
    assert "lengths has no 'r': known are pulley, arm in: return model.r * rates[0]" in message
    assert '\n' not in message
