# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Figures of campaigns with numbers that a scale of Matplotlib cannot show."""

from __future__ import annotations

from masmc_ros.report.draw.campaign_figures import draws_figure, front_figure, map_figure, MapAxis
from masmc_ros.report.draw.style import figure_file
import numpy as np
import pytest

AXES = [MapAxis('k', (1, 2, 3)), MapAxis('law', ('smc',))]


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('largest', [1e300, np.inf, np.nan])
def test_figures_of_runs_that_almost_diverged_are_drawn(largest: float) -> None:
    values = np.array([1.0, 20.0, largest])
    pairs = np.stack([values, values], axis=1)
    for figure in (
        draws_figure({'m': values[:2]}, values[[0, 2]], np.array([False, True]), 'x'),
        map_figure(AXES, values[:, np.newaxis], 'x'),
        map_figure(AXES[:1], values, 'x'),
        front_figure(pairs, pairs[:1], pairs[:1], pairs[2:], 'x', 'y'),
    ):
        assert figure_file(figure).startswith(b'\x89PNG')
