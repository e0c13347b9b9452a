# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Exported numbers against those of the log."""

from __future__ import annotations

import csv
from dataclasses import replace
import importlib.util
from pathlib import Path
from typing import Any

from helpers.logged_runs import Numbers, numbers, write_run
from helpers.report_runs import none, paper_like, run_of, series, telling
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.log.read.reader import read_run, Run
from masmc_ros.report.export import FORMATS, table_of, write_export
import numpy as np
from numpy.typing import NDArray
import pytest

COUNT = 60
ROOT = Path(__file__).resolve().parents[2]
NAMES = [column.name for column in table_of(paper_like()).columns]


@pytest.fixture
def logged(tmp_path: Path) -> tuple[Numbers, Path]:
    recorded, path = numbers(COUNT), tmp_path / 'my run.mcap'
    write_run(path, recorded)
    return recorded, path


def read_csv(path: Path) -> dict[str, list[float | None]]:
    """Return the columns of a table, with None for empty cells."""
    with path.open(newline='', encoding='utf-8') as stream:
        head, *rows = csv.reader(stream)
    columns = zip(*rows, strict=True)
    return {
        name: [float(text) if text else None for text in column]
        for name, column in zip(head, columns, strict=True)
    }


def read_parquet(path: Path) -> dict[str, list[float | None]]:
    """Return the columns of a table, with None for nulls."""
    parquet = pytest.importorskip('pyarrow.parquet')
    table: dict[str, list[float | None]] = parquet.read_table(path).to_pydict()
    return table


def expected(recorded: Numbers) -> NDArray[np.float64]:
    """Return the expected table of a run."""
    return np.column_stack(
        (
            recorded.stamps / 1e9,
            recorded.position,
            recorded.velocity,
            recorded.effort[:, 3:],
            recorded.torque,
            recorded.reference,
            *recorded.telemetry.values(),
        )
    )


@pytest.mark.parametrize(('kind', 'read'), [('csv', read_csv), ('parquet', read_parquet)])
def test_export_table_equals_log(logged: tuple[Numbers, Path], kind: str, read: Any) -> None:
    recorded, log = logged
    folder = log.parent / 'new' / 'folder'
    assert main(['export', str(log), '--output', str(folder), '--format', kind]) == 0
    assert [path.name for path in folder.iterdir()] == [f'my_run.{kind}']
    table = read(folder / f'my_run.{kind}')
    assert list(table) == NAMES
    assert np.array_equal(np.array(list(table.values())).T, expected(recorded))


def test_export_parquet_columns_have_units(logged: tuple[Numbers, Path]) -> None:
    parquet = pytest.importorskip('pyarrow.parquet')
    write_export([read_run(logged[1])], logged[1].parent, 'parquet', overwrite=False)
    schema = parquet.read_schema(logged[1].parent / 'my_run.parquet')
    assert schema.field('surface_x_E_m_per_s').metadata[b'unit'] == b'm_per_s'
    assert all(
        name.endswith('_' + schema.field(name).metadata[b'unit'].decode()) for name in NAMES
    )


def test_export_npz_arrays_equal_log(logged: tuple[Numbers, Path]) -> None:
    run = read_run(logged[1])
    (path,) = write_export([run], logged[1].parent, 'npz', overwrite=False)
    with np.load(path) as arrays:
        read_back = dict(arrays)
    recorded = logged[0]
    assert np.array_equal(read_back['time_s'], recorded.stamps / 1e9)
    for name, values in (
        ('position', recorded.position),
        ('velocity', recorded.velocity),
        ('applied_effort', recorded.effort[:, 3:]),
        ('command', recorded.torque),
        ('reference', recorded.reference),
        ('error', recorded.telemetry['tracking_error']),
        ('surface', recorded.telemetry['sliding_surface']),
        ('estimate', recorded.telemetry['parameter_estimate']),
        ('raw_torque', recorded.telemetry['raw_torque']),
    ):
        assert np.array_equal(read_back.pop(name), values), name
    assert {name for name, values in read_back.items() if np.array_equal(values, run.times)} == {
        'time_s', 'command_time_s', 'error_time_s', 'surface_time_s', 'estimate_time_s',
        'raw_torque_time_s',
    } == set(read_back)  # fmt: skip


ANY = st.floats(allow_nan=True, allow_infinity=True, width=64)


@given(hnp.arrays(float, (3, 4), elements=ANY))
def test_export_csv_any_number_is_restored(
    tmp_path_factory: pytest.TempPathFactory, error: np.ndarray
) -> None:
    run = run_of(error, np.array([0.0, 0.1, 0.2]))
    (path,) = write_export([run], tmp_path_factory.mktemp('x'), 'csv', overwrite=False)
    table = read_csv(path)
    read_back = np.array([table[name] for name in NAMES if name.startswith('error_')]).T
    assert np.array_equal(read_back, error, equal_nan=True)
    assert np.array_equal(np.signbit(read_back), np.signbit(error)) or np.isnan(error).any()


def bare() -> Run:
    """Return a run whose log has states, and three errors at other times."""
    times = np.array([1.0, 1.1, 1.2, 1.3])
    run = run_of(np.arange(12.0).reshape(3, 4), times)
    assert run.reference is not None
    reference = run.reference.copy()
    reference[:2] = np.nan
    run = telling(run, error=(np.array([0.9, 1.2, 1.25]), run.telemetry['error'].values))
    return replace(
        run,
        position=run.position[:4],
        reference=reference,
        torque=none(4),
    )


@pytest.mark.parametrize(('kind', 'read'), [('csv', read_csv), ('parquet', read_parquet)])
def test_export_table_missing_signals_are_empty(tmp_path: Path, kind: str, read: Any) -> None:
    (path,) = write_export([bare()], tmp_path, kind, overwrite=False)
    table = read(path)
    for name, column in table.items():
        if name.startswith(('command', 'surface', 'estimate', 'raw_torque')):
            assert column == [None] * 4, name
        elif name.startswith('reference'):
            assert [value is None for value in column] == [True, True, False, False], name
        elif not name.startswith('error'):
            assert None not in column, name
    # An error belongs to the last state before it; an error before every state has no row.
    assert table['error_x_E_m'] == [None, None, 8.0, None]


def test_export_npz_missing_signals_have_no_array(tmp_path: Path) -> None:
    (path,) = write_export([bare()], tmp_path, 'npz', overwrite=False)
    with np.load(path) as arrays:
        assert 'surface' not in arrays
        assert arrays['error_time_s'].tolist() == [0.9, 1.2, 1.25]


def test_export_existing_file_is_kept_without_overwrite(
    logged: tuple[Numbers, Path], capsys: Any
) -> None:
    folder = logged[1].parent
    (folder / 'my_run.csv').write_text('mine')
    command = ['export', str(logged[1]), '--output', str(folder)]
    assert main(command) == 2
    message = capsys.readouterr().err
    assert message.count('\n') == 1
    assert 'my_run.csv: exists already; add --overwrite' in message
    assert (folder / 'my_run.csv').read_text() == 'mine'
    assert main([*command, '--overwrite']) == 0
    assert len(read_csv(folder / 'my_run.csv')['time_s']) == COUNT


def test_export_logs_of_equal_name_get_separate_files(tmp_path: Path) -> None:
    runs = [replace(bare(), path=Path(name)) for name in ('a/x.mcap', 'b/x.mcap', 'c/X.mcap')]
    paths = write_export(runs, tmp_path, 'npz', overwrite=False)
    assert [path.name for path in paths] == ['x.npz', 'x_2.npz', 'X_3.npz']


def test_export_current_folder_is_named_by_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    run = replace(bare(), path=Path('.'))
    path, = write_export([run], tmp_path / 'out', 'npz', overwrite=False)
    assert path.name == f'{tmp_path.name}.npz'


@pytest.mark.parametrize('kind', list(FORMATS))
def test_export_write_fails_leaves_no_file(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: Run, stream: Any) -> None:
        stream.write(b'half')
        raise OSError(28, 'No space left on device')

    monkeypatch.setitem(FORMATS, kind, fail)
    with pytest.raises(InputError, match=r'cannot be written \(No space left on device\)'):
        write_export([bare()], tmp_path, kind, overwrite=False)
    assert not list(tmp_path.iterdir())


def test_export_parquet_without_pyarrow_prints_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(
        'masmc_ros.report.export.find_spec', lambda name: None if name == 'pyarrow' else find(name)
    )
    status = main(['export', 'none.mcap', '--output', str(tmp_path / 'x'), '--format', 'parquet'])
    assert status == 2
    message = capsys.readouterr().err
    assert message.count('\n') == 1
    assert 'pip install' in message
    assert not (tmp_path / 'x').exists()


def test_export_missing_log_prints_one_line(tmp_path: Path, capsys: Any) -> None:
    assert main(['export', str(tmp_path / 'none.mcap'), '--output', str(tmp_path / 'x')]) == 2
    message = capsys.readouterr().err
    assert message.startswith(f'masmc export: {tmp_path / "none.mcap"}: cannot be read')
    assert message.count('\n') == 1
    assert not (tmp_path / 'x').exists()


def test_export_documentation_names_every_column() -> None:
    text = (ROOT / 'docs' / 'guides' / 'reports.md').read_text(encoding='utf-8')
    run = paper_like()
    both = replace(run, cmd_vel=series(run.times[:1], np.zeros((1, 2))))
    for column in table_of(both).columns:
        assert column.name.split('_')[0] in text
        assert f'`{column.unit}`' in text
