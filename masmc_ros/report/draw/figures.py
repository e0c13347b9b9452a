# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Figures of a set of runs, and their names."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from masmc_ros.files import file_stem
from masmc_ros.log.read.reader import Run
from masmc_ros.report.digest import compared_runs, Digest
from masmc_ros.report.draw.path_figures import path_figure
from masmc_ros.report.draw.run_figures import adaptation_figure, comparison_figure, error_figure
from masmc_ros.report.draw.style import figure_file, paper_style
from masmc_ros.report.measure.labels import law_of, log_name
from masmc_ros.report.measure.tracking import tracking
from masmc_ros.report.panels import adaptation_panels
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.mechanisms import DEFAULT
from matplotlib.figure import Figure

_NUMBERED = 'figure_'
"""Start of the names of the paper's figures."""

PAPER_FIGURES = {'smc': 3, 'rasmc': 6}
"""Number of the first of the paper's three figures of each law, for its robot."""


FEW = 6
"""Maximum number of runs with figures of their own, unless all are requested."""


def draw_figures(
    runs: Sequence[Run],
    names: Sequence[str],
    digests: Sequence[Digest],
    file_format: str = 'png',
    *,
    has_all: bool = True,
) -> Iterator[tuple[str, bytes]]:
    """
    Yield file name and content of every figure: path and points of each run, then of all runs.

    Without positions in the log there is no figure of the path, without errors none of the points,
    without estimates none of the adaptation.

    Parameters
    ----------
    runs
        Runs; of many runs only those with figures are used.
    names, digests
        Names and digests of the runs.
    file_format
        One of `style.FORMATS`.
    has_all
        Whether every run has its figures; otherwise, of more than FEW runs only those with the
        numbers of the paper's figures have them.

    """
    all_files = figure_names([entry.run for entry in digests], file_format)
    with paper_style():
        for place, (name, entry, files) in enumerate(zip(names, digests, all_files, strict=True)):
            if not (has_all or len(runs) <= FEW or files[0].startswith(_NUMBERED)):
                continue
            run, points = runs[place], entry.metrics.points
            tracked = tracking(run)
            figures: tuple[Figure | None, ...] = (
                path_figure(run, tracked, name),
                *(error_figure(tracked, entry.metrics, name, point) for point in points),
            )
            for file, figure in zip(files, figures, strict=True):
                if figure is not None:
                    yield file, figure_file(figure, file_format)
        drawn = [(names[i], digests[i]) for i in compared_runs(digests)]
        comparison = comparison_figure(
            [(name, entry.distances) for name, entry in drawn],
            [entry.metrics.torque_variation or 0.0 for _, entry in drawn],
        )
        yield f'comparison.{file_format}', figure_file(comparison, file_format)
        adapted = adaptation_figure(
            adaptation_panels([(name, entry.adapted) for name, entry in drawn]),
            [name for name, _ in drawn],
        )
        if adapted is not None:
            yield f'adaptation.{file_format}', figure_file(adapted, file_format)


def figure_names(runs: Sequence[Run], file_format: str = 'png') -> list[list[str]]:
    """
    Return the file names of each run's figures, of its path and of each of its points.

    The first run of each law of the paper has the names of the paper's figures:
    figure_3_smc_path.png. The others have the names of their logs: RUN_path.png.
    """
    numbers = dict(PAPER_FIGURES)
    # A log may have the name of one of the paper's figures.
    taken = {
        f'{_NUMBERED}{n + i}_{law}'
        for law, n in PAPER_FIGURES.items()
        for i in range(len(_kinds(DEFAULT)))
    }
    names = []
    for run in runs:
        law = law_of(run)
        kinds = _kinds(run.mechanism)
        is_paper = run.mechanism.name == DEFAULT.name
        first = numbers.pop(law, None) if law is not None and is_paper else None
        if first is None:
            stem = file_stem(log_name(run), taken)
            names.append([f'{stem}_{kind}.{file_format}' for kind in kinds])
        else:
            names.append([
                f'{_NUMBERED}{first + i}_{law}_{kind}.{file_format}'
                for i, kind in enumerate(kinds)
            ])
    return names


def _kinds(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the subjects of the figures of a run, in the order of the paper."""
    return ('path', *(point.key for point in mechanism.points))
