# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Mistakes in paths of other packages: one line with place, mistake and known names."""

from __future__ import annotations

from pathlib import Path

from masmc_ros.cli.main import main
from masmc_ros.reference.trajectory import ENTRY_POINTS
import pytest

SOURCE = '''
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.numerics.portable_math import sin_cos
from masmc_ros.params.declaration import Parameter
import numpy as np


@formula
def swing(time, amplitude):
    s, c = sin_cos(time)
    return amplitude * s, amplitude * c, -amplitude * s


@kernel
def samples(times, at, amplitude):
    out = np.zeros((len(times), 12))
    for k in range(len(times)):
        x, v, a = swing(times[k], amplitude)
        out[k, :4] = at
        out[k, 0] += x
        out[k, 4], out[k, 8] = v, a
    return out


class Swing:
    axes = 'x_E', 'y_E', 'x_F', 'y_F'
    parameters = (
        Parameter('swing.at', (0.3, 0.5, 0.0, 0.0), 'Centre', unit='m', length=4),
        Parameter('swing.amplitude', 0.05, 'Amplitude', unit='m'),
    )

    def __init__(self, values):
        self._at = np.array(values['at'])
        self._amplitude = values['amplitude']

    def sample(self, times):
        return samples(times, self._at, self._amplitude)
'''

MISTAKES = {
    'unknown parameter': ("values['at']", "values['centre']", "KeyError: 'centre' in: self._at"),
    'unknown attribute': ('times, self._at,', 'times, self._et,', "no attribute '_et'"),
    'unknown function': ('x, v, a = swing', 'x, v, a = swung', 'swung is not defined'),
    'missing import': ('import numpy as np\n', '', 'np is not defined'),
    'missing module': ('numerics.portable_math', 'numerics.portable_maths', 'No module named'),
    'wrong shape': ('(len(times), 12)', '(len(times), 13)', 'shape (3, 13): expected (3, 12)'),
    'nothing is returned': ('    return out\n', '    out\n', 'returns the shape ()'),
    'missing argument': ('swing(times[k], amplitude)', 'swing(times[k])', 'missing 1 required'),
    'result of another length': ('return amplitude * s, ', 'return ', 'not enough values'),
    'index out of range': ('out[k, 8] = v, a', 'out[k, 12] = v, a', 'out of bounds'),
    'vectors of different lengths': ('length=4', 'length=3', 'swing.at'),
    'no sample': ('def sample(', 'def sampled(', "object has no attribute 'sample'"),
    'no parameters': ('    parameters =', '    parameter =', "Swing has no 'parameters'"),
    'syntax': ('return samples(', 'return samples((', "'(' was never closed in:"),
    'other axes': ("'y_F'", "'z_F'", 'the task axes of two_link'),
}  # fmt: skip


def install(folder: Path, source: str, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Write a package with a path, as if installed, and return its file."""
    name = f'swing_{abs(hash(source))}'
    package = folder / f'{name}-1.0.dist-info'
    package.mkdir(parents=True)
    (package / 'METADATA').write_text(f'Name: {name}\nVersion: 1.0\n')
    (package / 'entry_points.txt').write_text(f'[{ENTRY_POINTS}]\nswing = {name}:Swing\n')
    file = folder / f'{name}.py'
    file.write_text(source)
    monkeypatch.syspath_prepend(folder)
    return file


def simulate() -> int:
    """Simulate the path for a moment; return the exit status."""
    return main(['simulate', 'paper', '--set', 'trajectory.type=swing', '--set', 'duration=0.01'])


def test_dry_run_correct_path_is_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(tmp_path, SOURCE, monkeypatch)
    assert simulate() == 0


@pytest.mark.parametrize('name', MISTAKES)
def test_dry_run_mistake_in_path_is_one_line(
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    correct, wrong, text = MISTAKES[name]
    assert SOURCE.count(correct) == 1
    file = install(tmp_path, SOURCE.replace(correct, wrong), monkeypatch)
    assert simulate() == 2
    message = capsys.readouterr().err.removesuffix('\n')
    assert text in message
    assert '\n' not in message
    if name not in ('vectors of different lengths', 'other axes'):  # mistakes in declarations
        assert f'{file}:' in message
