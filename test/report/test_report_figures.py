# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Figures and folder of a report."""

from __future__ import annotations

from dataclasses import replace
import io
from itertools import chain
from pathlib import Path

from helpers.logged_runs import numbers, write_run
from helpers.report_runs import none, paper_like, run_of, series, telling, ticks, without_error
from helpers.robots import all_angles, Angles, Machine, machines, PROPERTY, task_positions
from hypothesis import given
from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.log.read.reader import Run
from masmc_ros.report.digest import digests_of
from masmc_ros.report.draw.figures import draw_figures, figure_names
from masmc_ros.report.draw.run_figures import comparison_figure, error_figure
from masmc_ros.report.draw.style import figure_file, paper_style
from masmc_ros.report.measure.labels import labels
from masmc_ros.report.measure.metrics import metrics
from masmc_ros.report.measure.tracking import tracking
from masmc_ros.report.report import write_report
from masmc_ros.robot.declaration import Point
from masmc_ros.robot.mechanisms import DEFAULT
from masmc_ros.robot.two_link.description import arm_points
import matplotlib
from matplotlib.image import imread
import numpy as np
import pytest

COLUMN_PIXELS, PAGE_PIXELS = 1039, 2125  # 88 mm and 180 mm at 300 dpi, truncated
BLUE, VERMILLION, BLACK = (0, 114, 178), (213, 94, 0), (0, 0, 0)


def figures(runs: list[Run]) -> dict[str, bytes]:
    """Draw all figures of runs."""
    return dict(draw_figures(runs, labels(runs), digests_of(runs)))


def pixels(data: bytes) -> np.ndarray:
    """Return the colours of a PNG file as (height, width, 3) from 0 to 255."""
    return np.round(imread(io.BytesIO(data), format='png')[..., :3] * 255).astype(int)


def share(image: np.ndarray, colour: tuple[int, int, int]) -> float:
    """Return the share of pixels of a colour."""
    return float((image == colour).all(axis=-1).mean())


@pytest.fixture(scope='module')
def two_runs() -> list[Run]:
    return [paper_like('a.mcap'), paper_like('b.mcap', law='rasmc', scale=0.5)]


@pytest.fixture(scope='module')
def two_runs_figures(two_runs: list[Run]) -> dict[str, bytes]:
    return figures(two_runs)


def test_report_figures_of_two_runs_match_paper(two_runs_figures: dict[str, bytes]) -> None:
    assert list(two_runs_figures) == [
        'figure_3_smc_path.png',
        'figure_4_smc_end_effector.png',
        'figure_5_smc_platform.png',
        'figure_6_rasmc_path.png',
        'figure_7_rasmc_end_effector.png',
        'figure_8_rasmc_platform.png',
        'comparison.png',
    ]


def test_report_figures_have_sizes_of_printed_page(two_runs_figures: dict[str, bytes]) -> None:
    for name, data in two_runs_figures.items():
        height, width, _ = pixels(data).shape
        is_narrow = name.endswith(('end_effector.png', 'platform.png'))
        assert width == (COLUMN_PIXELS if is_narrow else PAGE_PIXELS)
        assert 0.25 * width < height < 1.0 * width


def test_report_figures_show_all_lines(two_runs_figures: dict[str, bytes]) -> None:
    for name, data in two_runs_figures.items():
        image = pixels(data)
        assert share(image, BLUE) > 1e-3, name
        assert share(image, VERMILLION) > 1e-3, name
        assert share(image, BLACK) > 1e-3, name
        # No line reaches the edges.
        edges = np.concatenate((image[0], image[-1], image[:, 0], image[:, -1]))
        assert (edges == 255).all(), name


@pytest.mark.slow
def test_report_figures_different_runs_differ() -> None:
    calm, rough = figures([paper_like()]), figures([paper_like(scale=2.0)])
    same = {name for name in calm if calm[name] == rough[name]}
    assert same == {'figure_3_smc_path.png'}  # drawn from the states, which are equal


@pytest.mark.slow
def test_report_figures_user_settings_have_no_effect(
    two_runs: list[Run], two_runs_figures: dict[str, bytes]
) -> None:
    with matplotlib.rc_context({'font.size': 20.0, 'axes.grid': False, 'axes.facecolor': 'red'}):
        assert figures(two_runs) == two_runs_figures
        assert matplotlib.rcParams['font.size'] == 20.0


@pytest.mark.parametrize('point', DEFAULT.points)
def test_report_error_figure_is_in_mm_with_enlarged_axes(point: Point) -> None:
    run = paper_like()
    tracked = tracking(run)
    error = 1000.0 * tracked.error[:, point.axes]
    with paper_style():
        figure = error_figure(tracked, metrics(run), 'run', point)
    assert figure is not None
    upper, lower = figure.axes
    for axes in (upper, lower):
        _, x, y = axes.get_lines()
        np.testing.assert_allclose(np.stack([x.get_ydata(), y.get_ydata()], axis=1), error)
    assert upper.get_ylim()[1] >= error.max()
    assert lower.get_xlim() == (10.0, 20.0)
    settled = error[(tracked.times >= 10.0) & (tracked.times < 20.0)]
    low, high = min(settled.min(), 0.0), max(settled.max(), 0.0)
    assert lower.get_ylim() == pytest.approx((low, high), abs=0.1 * (high - low))
    assert lower.get_ylim()[0] < low
    assert lower.get_ylim()[1] > high


def test_report_figure_names_further_runs_follow_logs() -> None:
    runs = [
        paper_like('first.mcap'),
        paper_like('x/my run.mcap'),
        paper_like('y/my run.mcap'),
        replace(paper_like('bag.mcap'), parameters={}),
        paper_like('z.mcap', law='rasmc'),
    ]
    assert [names[0] for names in figure_names(runs)] == [
        'figure_3_smc_path.png',
        'my_run_path.png',
        'my_run_2_path.png',
        'bag_path.png',
        'figure_6_rasmc_path.png',
    ]


def test_report_figure_names_are_unique() -> None:
    stems = ('q', 'a', 'A', 'a_2', 'a', 'a b', 'a_b', 'figure_3_smc')
    runs = [paper_like(f'{stem}.mcap') for stem in stems]
    names = list(chain.from_iterable(figure_names(runs)))
    assert len({name.lower() for name in names}) == len(names)


def test_report_figures_log_without_positions_has_no_path() -> None:
    bare = replace(paper_like('bag.mcap'), parameters={}, reference=None)
    assert list(figures([bare])) == ['bag_end_effector.png', 'bag_platform.png', 'comparison.png']


@pytest.mark.slow
def test_report_figures_any_file_name_is_drawn() -> None:
    stems = ('_hidden', 'cost $x_{$', '$\\frac$', 'a' * 150, '%s {} "')
    runs = [
        replace(paper_like(f'{stem}.mcap', scale=2.0**i), parameters={})
        for i, stem in enumerate(stems)
    ]
    distances = [entry.distances for entry in digests_of(runs)]
    with paper_style():
        of_runs = list(zip(labels(runs), distances, strict=True))
        figure = comparison_figure(of_runs, [0.0] * len(runs))
        assert share(pixels(figure_file(figure)), BLUE) > 1e-3
        (legend,) = filter(None, (axes.get_legend() for axes in figure.axes))
        texts = [text.get_text() for text in legend.get_texts()]
        assert texts == ['_hidden', r'cost \$x_{\$', r'\$\frac\$', f'…{"a" * 39}', '%s {} "']
        for label, run in zip(labels(runs), runs, strict=True):
            drawn = error_figure(tracking(run), metrics(run), label, DEFAULT.points[0])
            image = pixels(figure_file(drawn))
            assert share(image, BLUE) > 1e-3
            assert (image[:, -1] == 255).all()  # the name is complete


def test_report_figure_letters_outside_font_give_no_warning(
    recwarn: pytest.WarningsRecorder,
) -> None:
    run = paper_like()
    with paper_style():
        figure_file(error_figure(tracking(run), metrics(run), '机器人', DEFAULT.points[0]))
    assert not recwarn.list


@pytest.mark.slow
def test_report_figures_zero_error_is_drawn() -> None:
    t = ticks(1.0)
    still = replace(run_of(np.zeros((len(t), 4)), t), torque=none(4))
    assert len(figures([still])) == 4


def test_report_figures_diverged_run_is_drawn() -> None:
    run = paper_like()
    error = run.telemetry['error'].values.copy()
    error[1500:1700], error[1700:] = np.inf, np.nan
    unknown = series(run.times, np.full_like(run.torque.values, np.nan))
    diverged = replace(telling(run, error=(run.times, error)), torque=unknown)
    assert len(figures([diverged])) == 4


@PROPERTY
@given(machines(), all_angles())
def test_report_arm_points_equal_kinematics(machine: Machine, angles: Angles) -> None:
    position = np.array([0.7, -1.1, angles.yaw, 0.0, 0.0, angles.arm_1, angles.arm_2])
    base, _, end = arm_points(machine.geometry, position)
    (task,) = task_positions(np.array(machine.geometry), position[None])
    np.testing.assert_allclose([*end, *base], task, rtol=0, atol=1e-12)


def test_write_report_returns_written_files(two_runs: list[Run], tmp_path: Path) -> None:
    folder = tmp_path / 'new' / 'report'
    written = write_report(two_runs, folder).files
    assert sorted(written) == sorted(folder.iterdir())
    assert [path.name for path in written[:4]] == [
        'report.html',
        'table.txt',
        'table.md',
        'metrics.csv',
    ]
    assert 'smc, tanh δ 0.2' in written[1].read_text()
    assert sum(path.suffix == '.png' for path in written) == 7


@pytest.mark.slow
def test_write_report_replaces_earlier_report(two_runs: list[Run], tmp_path: Path) -> None:
    (tmp_path / 'table.txt').write_text('old')
    (tmp_path / 'notes.txt').write_text('mine')
    write_report(two_runs, tmp_path)
    assert 'rasmc' in (tmp_path / 'table.txt').read_text()
    assert (tmp_path / 'notes.txt').read_text() == 'mine'


@pytest.mark.parametrize(
    ('place', 'named'),
    [('file', 'file'), ('file/folder', 'file/folder'), ('folder', 'folder/report.html')],
)
def test_write_report_unwritable_folder_raises(
    two_runs: list[Run], tmp_path: Path, place: str, named: str
) -> None:
    (tmp_path / 'file').write_text('mine')
    (tmp_path / 'folder' / 'report.html').mkdir(parents=True)
    with pytest.raises(InputError) as caught:
        write_report(two_runs[:1], tmp_path / place)
    assert str(caught.value).startswith(f'{tmp_path / named}: cannot be written (')
    assert '\n' not in str(caught.value)
    assert (tmp_path / 'file').read_text() == 'mine'
    assert [path.name for path in (tmp_path / 'folder').iterdir()] == ['report.html']


def test_report_command_invalid_log_leaves_no_folder(tmp_path: Path) -> None:
    write_run(tmp_path / 'good.mcap', numbers(40))
    (tmp_path / 'bad.mcap').write_text('no log')
    logs = [str(tmp_path / name) for name in ('good.mcap', 'bad.mcap')]
    assert main(['report', *logs, '--output', str(tmp_path / 'report')]) == 2
    assert not (tmp_path / 'report').exists()


def test_write_report_run_without_errors_is_in_table(two_runs: list[Run], tmp_path: Path) -> None:
    bare = replace(without_error(paper_like('bag.mcap')), parameters={}, reference=None)
    names = [path.name for path in write_report([*two_runs, bare], tmp_path).files]
    assert 'comparison.png' in names
    assert not any(name.startswith('bag') for name in names)
    (line,) = (tmp_path / 'table.md').read_text().splitlines()[4:]
    assert line.startswith('| bag | 10-20 | - | - | - | - | - | - | ')


def test_write_report_without_runs_raises(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'^no runs to report; expected at least one log$'):
        write_report([], tmp_path)
