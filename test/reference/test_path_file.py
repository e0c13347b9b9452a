# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Paths of files: the same as of their numbers, replayed runs, and rejected files."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path

from helpers.robots import between
from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.campaign.tune import BaseFile
from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.log.read.reader import read_run
from masmc_ros.reference.path_file import PathFile
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.reference.waypoints import Waypoints
from masmc_ros.robot.robot import robot_of
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
from numpy.typing import NDArray
import pytest
import yaml

Array = NDArray[np.float64]

PAPER = str(Path(__file__).resolve().parents[2] / 'config' / 'paper.yaml')
AXES = [axis.name for axis in TWO_LINK.axes]
HEADS = ['time_s', *(f'{name}_m' for name in AXES)]
RATES = [f'velocity_{name}_m_per_s' for name in AXES]
CHANGES = [f'acceleration_{name}_m_per_s2' for name in AXES]
ROW = '0,0.3,0.5,0,0'
STEP = 1e-4


def csv_text(heads: list[str], rows: Array) -> str:
    lines = [','.join(map(repr, row)) for row in rows.tolist()]
    return '\n'.join([','.join(heads), *lines]) + '\n'


def path_of(file: Path, *, stops: bool = False) -> PathFile:
    return PathFile.of({'path': str(file), 'stops': stops}, TWO_LINK)


@st.composite
def tables(draw: st.DrawFn, orders: int) -> Array:
    """Return times and 4 axes of positions, and perhaps derivatives, at rest at the ends."""
    count = draw(st.integers(1, 6))
    times = np.cumsum([draw(between(0.2, 3.0)) for _ in range(count)])
    numbers = [draw(between(-2.0, 2.0)) for _ in range(count * 4 * orders)]
    values = np.array(numbers).reshape(count, -1)
    values[[0, -1], 4:] = 0.0
    return np.hstack([times[:, None], values])


@given(tables(1), st.booleans())
def test_path_file_positions_equal_waypoints(
    tmp_path_factory: pytest.TempPathFactory, rows: Array, stops: bool
) -> None:
    file = tmp_path_factory.mktemp('csv') / 'points.csv'
    file.write_text(csv_text(HEADS, rows))
    times = np.linspace(0.0, rows[-1, 0] + 1.0, 57)
    waypoints = Waypoints({'times': rows[:, 0], 'points': rows[:, 1:].ravel(), 'stops': stops})
    # At a point its own velocity is the sample; the interpolated one has rounding errors.
    expected = pytest.approx(waypoints.sample(times), rel=1e-9, abs=1e-9)
    assert path_of(file, stops=stops).sample(times) == expected


@given(st.data(), st.sampled_from([2, 3]))
def test_path_file_derivatives_are_consistent(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, orders: int
) -> None:
    """Velocities and accelerations are derivatives, and continuous at the points."""
    rows = data.draw(tables(orders))
    file = tmp_path_factory.mktemp('csv') / 'points.csv'
    file.write_text(csv_text([*HEADS, *RATES, *CHANGES][: rows.shape[1]], rows))
    path = path_of(file)
    assert np.array_equal(path.sample(rows[:, 0])[:, : 4 * orders], rows[:, 1:])
    times = np.linspace(rows[0, 0] - 0.3, rows[-1, 0] + 0.3, 41)
    before, at, after = (path.sample(times + shift) for shift in (-STEP, 0.0, STEP))
    size = 1.0 + np.abs(at).max()
    for order in (4, 8):
        difference = (after - before)[:, order - 4:order] / (2 * STEP)
        assert np.abs(difference - at[:, order:order + 4]).max() < 1e-2 * size
    jump = np.abs(path.sample(rows[:, 0] + 1e-7) - path.sample(rows[:, 0] - 1e-7))
    assert jump.max() < 1e-3 * size


def write_parquet(file: Path, rows: Array) -> None:
    pa = pytest.importorskip('pyarrow')
    from pyarrow import parquet

    parquet.write_table(pa.table(dict(zip(HEADS, rows.T.copy(), strict=True))), file)


def write_yaml(file: Path, rows: Array) -> None:
    order = [2, 0, 3, 1]
    content = {
        'axes': [AXES[k] for k in order],
        'times': rows[:, 0].tolist(),
        'points': rows[:, 1:][:, order].tolist(),
    }
    file.write_text(yaml.safe_dump(content))


def write_tabs(file: Path, rows: Array) -> None:
    text = csv_text(['t', *AXES], rows).replace(',', ';')
    file.write_bytes(text.replace('\n', '\r\n').encode('utf-8-sig'))


@pytest.mark.parametrize(
    ('name', 'write'),
    [('a.parquet', write_parquet), ('a.yaml', write_yaml), ('a.csv', write_tabs)],
)
def test_path_file_formats_are_equal(
    tmp_path: Path, name: str, write: Callable[[Path, Array], None]
) -> None:
    rows = np.array([[0.5, 0.3, 0.5, 0.0, 0.1], [1.0, 0.4, 0.6, 0.1, 0.2]])
    (tmp_path / 'plain.csv').write_text(csv_text(HEADS, rows))
    write(tmp_path / name, rows)
    times = np.linspace(0.0, 2.0, 33)
    expected = path_of(tmp_path / 'plain.csv').sample(times)
    assert np.array_equal(path_of(tmp_path / name).sample(times), expected)


def test_path_of_exported_run_is_followed_bitwise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    short = ('--set', 'duration=0.4')
    assert main(['simulate', PAPER, *short, '--output', 'first.mcap']) == 0
    assert main(['export', 'first.mcap']) == 0
    path = ('--path', 'export/first.csv')
    assert main(['simulate', PAPER, *path, *short, '--output', 'second.mcap']) == 0
    first, second = read_run('first.mcap'), read_run('second.mcap')
    assert second.parameters['trajectory']['type'] == 'file'
    for name in ('reference', 'position', 'velocity'):
        assert np.array_equal(getattr(first, name), getattr(second, name)), name
    assert np.array_equal(first.torque.values, second.torque.values)


HEAD = ','.join(HEADS)
REJECTED = {
    'no column y_F_m; expected columns time_s, x_E_m': f'{HEAD[:-6]}\n0,1,2,3\n',
    "unknown column 'y_E_mm'; did you mean y_E_m": f'{HEAD},y_E_mm\n{ROW},1\n',
    'two columns for x_E_m': f'{HEAD},x_E\n{ROW},1\n',
    'no column velocity_y_E_m_per_s': f'{HEAD},{RATES[0]}\n{ROW},1\n',
    'accelerations without velocities': f'{HEAD},{",".join(CHANGES)}\n{ROW},0,0,0,0\n',
    "line 3: y_F_m = 'a'; expected a number": f'{HEAD}\n{ROW}\n1,0.3,0.5,0,a\n',
    'line 3: 4 fields; expected 5': f'{HEAD}\n{ROW}\n1,0.3,0.5,0\n',
    'line 2: 6 fields; expected 5': f'{HEAD}\n0,3,0,5,0,0\n{ROW}\n',  # 0,3 with a decimal comma
    'point 2 has a number that is not finite': f'{HEAD}\n{ROW}\n1,0.3,nan,0,0\n',
    'point 2 at t = 0 s follows 0 s': f'{HEAD}\n{ROW}\n{ROW}\n',
    'no points': f'{HEAD}\n',
    'it starts at t = 1.7e+09 s': f'{HEAD}\n17{ROW.replace("0,", "00000000,", 1)}\n',
    'it starts at t = -1 s': f'{HEAD}\n-1{ROW[1:]}\n',
    'no column time_s': f'{ROW}\n1{ROW[1:]}\n',
    '': '',
}  # fmt: skip


@pytest.mark.parametrize(('message', 'text'), REJECTED.items())
def test_path_file_wrong_csv_rejected_in_one_line(
    tmp_path: Path, message: str, text: str
) -> None:
    file = tmp_path / 'points.csv'
    file.write_text(text)
    with pytest.raises(InputError) as error:
        path_of(file)
    assert str(error.value).startswith(f'file.path = {file}')
    assert message in str(error.value)
    assert '\n' not in str(error.value)


WRONG_YAML = ('[1, 2]', 'times: [0]', 'times: [0]\npoint: [[1]]', 'a: [', 'times: [0]\npoints: x')


@pytest.mark.parametrize(
    ('name', 'content'),
    [
        *product(['points.yaml'], WRONG_YAML),
        ('points.yaml', 'times: [0, 1]\npoints: [[0, 0, 0, 0]]'),
        ('points.yaml', 'times: [0]\npoints: [[0, 0, 0]]'),
        ('points.yaml', 'axes: [x_E]\ntimes: [0]\npoints: [[0, 0, 0, 0]]'),
        ('points.parquet', 'no Parquet'),
        ('points.mcap', ''),
        ('points.csv', None),
    ],
)
def test_path_file_wrong_file_rejected_in_one_line(
    tmp_path: Path, name: str, content: str | None
) -> None:
    file = tmp_path / name
    if content is not None:
        file.write_text(content)
    with pytest.raises(InputError) as error:
        path_of(file)
    assert str(error.value).startswith(f'file.path = {file}')
    assert '\n' not in str(error.value)


def test_path_file_that_moves_at_its_end_must_last(tmp_path: Path) -> None:
    file = tmp_path / 'points.csv'
    moving = [[0.0, *[0.0] * 8], [1.0, 1.0, *[0.0] * 3, 1.0, *[0.0] * 3]]
    file.write_text(csv_text([*HEADS, *RATES], np.array(moving)))
    path = path_of(file)
    assert path.sample(np.array([1.0]))[0, 4] == 1.0
    with pytest.raises(InputError, match=r'moves when it ends at t = 1 s.*needed at t = 1.5 s'):
        path.sample(np.array([0.5, 1.5]))


def test_path_in_parameter_file_is_relative_to_it(tmp_path: Path) -> None:
    (tmp_path / 'points.csv').write_text(f'{HEAD}\n{ROW}\n')
    file = tmp_path / 'run.yaml'
    file.write_text('/**/trajectory:\n  ros__parameters: {type: file, file.path: points.csv}\n')
    values = load_scenario(str(file))['trajectory']
    assert values['file.path'] == str(tmp_path / 'points.csv')
    # A file of tuned gains may be in another folder.
    base = BaseFile.read(str(file), [f'trajectory.file.path={tmp_path}/./points.csv'])
    assert f'path: {tmp_path / "points.csv"}' in base.tuned([], {})
    assert f'path: {tmp_path / "points.csv"}' in BaseFile.read(str(file), []).tuned([], {})
    robot = robot_of(load_scenario(str(file))['plant'])
    assert Trajectory(values, 0.001, robot).sample(0, 1)[0, :2].tolist() == [0.3, 0.5]
