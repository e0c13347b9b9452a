# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Which figures a set of runs gives, and what they are called."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from masmc_ros.log.read.reader import Run
from masmc_ros.report.comparison_figure import Compared, comparison_figure
from masmc_ros.report.error_figure import end_effector_figure, platform_figure
from masmc_ros.report.files import file_stem
from masmc_ros.report.labels import law_of
from masmc_ros.report.metrics import Metrics
from masmc_ros.report.path_figure import path_figure
from masmc_ros.report.style import paper_style, png
from matplotlib.figure import Figure

KINDS = ('path', 'end_effector', 'platform')
"""The figures of one run, in the order of the paper's."""

PAPER_FIGURES = {'smc': 3, 'rasmc': 6}
"""Number of the first of the paper's three figures of each law."""


def draw_figures(
    compared: Sequence[Compared], reached: Sequence[Metrics]
) -> Iterator[tuple[str, bytes]]:
    """
    Yield file name and PNG of every figure: three a run, then all runs in one.

    A run whose log does not tell the positions has no figure of its path, one whose log does
    not tell the errors none of these.
    """
    runs = [each.run for each in compared]
    with paper_style():
        for each, metrics, names in zip(compared, reached, figure_names(runs), strict=True):
            label, run, tracked = each
            figures: tuple[Figure | None, ...] = (
                path_figure(run, tracked, label),
                end_effector_figure(tracked, metrics, label),
                platform_figure(tracked, metrics, label),
            )
            for name, figure in zip(names, figures, strict=True):
                if figure is not None:
                    yield name, png(figure)
        yield 'comparison.png', png(comparison_figure(compared))


def figure_names(runs: Sequence[Run]) -> list[list[str]]:
    """
    Return the file names of each run's figures, of which there is one of each of KINDS.

    The first run under each law of the paper has the paper's: figure_3_smc_path.png. The
    others are named by their logs: RUN_path.png.
    """
    numbers = dict(PAPER_FIGURES)
    # A log may be named like one of the paper's figures.
    taken = {
        f'figure_{n + i}_{law}' for law, n in PAPER_FIGURES.items() for i in range(len(KINDS))
    }
    names = []
    for run in runs:
        law = law_of(run)
        first = None if law is None else numbers.pop(law, None)
        if first is None:
            stem = file_stem(run.path.stem, taken)
            names.append([f'{stem}_{kind}.png' for kind in KINDS])
        else:
            names.append([f'figure_{first + i}_{law}_{kind}.png' for i, kind in enumerate(KINDS)])
    return names
