# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Figures of a run, in the style of the reports."""

from __future__ import annotations

from typing import NamedTuple, TYPE_CHECKING

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.report.measure.metrics import Metrics
from masmc_ros.report.measure.tracking import Tracking

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Plots(NamedTuple):
    """
    Figures of a run.

    Attributes
    ----------
    label
        Law, for the caption.
    time
        (n) s.
    error
        (n, axes) e = x - x_d in m and rad.
    metrics
        Metrics of the run.

    """

    label: str
    time: Array
    error: Array
    metrics: Metrics

    def errors(self, point: str = '') -> Figure:
        """
        Draw the errors of a point over time, and enlarged after settling.

        Parameters
        ----------
        point
            Key of the point, such as `end_effector`; empty: the first one.

        Raises
        ------
        InputError
            if the robot has no such point, or the run is too short to be settled.

        """
        # matplotlib takes a second to import.
        from masmc_ros.report.draw.error import error_figure
        from masmc_ros.report.draw.style import paper_style

        known = {entry.key: entry for entry in self.metrics.points}
        if point and point not in known:
            raise InputError(f'{point}: no point of the robot; expected one of {", ".join(known)}')
        chosen = known[point] if point else next(iter(self.metrics.points))
        tracked = Tracking(self.time, self.error, None, None)
        with paper_style():
            figure = error_figure(tracked, self.metrics, self.label, chosen)
        if figure is None:
            raise InputError('the run is too short: no error after its start')
        return figure
