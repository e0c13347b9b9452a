# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Figures of a run, in the style of the reports."""

from __future__ import annotations

from typing import NamedTuple, TYPE_CHECKING

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError
from masmc_ros.report.measure.adaptation import Adaptation
from masmc_ros.report.measure.metrics import Metrics
from masmc_ros.report.measure.tracking import Tracking
from masmc_ros.robot.declaration import Point

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Columns(NamedTuple):
    """
    Signal with the names of its components.

    Attributes
    ----------
    values
        (n, components).
    names, units
        (components).

    """

    values: Array
    names: tuple[str, ...]
    units: tuple[str, ...]


class Plots(NamedTuple):
    """
    Figures of a run.

    Attributes
    ----------
    label
        Law, for the caption.
    times
        (n) s.
    error
        (n, axes) e = x - x_d in m and rad.
    metrics
        Metrics of the run.
    adapted
        Estimates relative to the true parameters.
    torque, surface_values, estimate
        Signals of the controller.
    places
        Points of the task that have a position.
    actual, desired
        (n, axes) task coordinates in m and rad, of the true state and of the reference.

    """

    label: str
    times: Array
    error: Array
    metrics: Metrics
    adapted: Adaptation
    torque: Columns
    surface_values: Columns
    estimate: Columns
    places: tuple[Point, ...]
    actual: Array
    desired: Array

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
        from masmc_ros.report.draw.run_figures import error_figure
        from masmc_ros.report.draw.style import paper_style

        known = {entry.key: entry for entry in self.metrics.points}
        if point and point not in known:
            raise InputError(f'{point}: no point of the robot; expected one of {", ".join(known)}')
        chosen = known[point] if point else next(iter(self.metrics.points))
        tracked = Tracking(self.times, self.error, None, None)
        with paper_style():
            figure = error_figure(tracked, self.metrics, self.label, chosen)
        if figure is None:
            raise InputError('the run is too short: no error after its start')
        return figure

    def adaptation(self) -> Figure:
        """
        Draw the estimates relative to the true parameters, a panel for each, with final errors.

        Raises
        ------
        InputError
            if the robot has no base inertial parameters.

        """
        from masmc_ros.report.draw.run_figures import adaptation_figure
        from masmc_ros.report.draw.style import paper_style
        from masmc_ros.report.panels import adaptation_panels

        with paper_style():
            figure = adaptation_figure(adaptation_panels([(self.label, self.adapted)]))
        if figure is None:
            raise InputError('the robot has no base inertial parameters')
        return figure

    def torques(self) -> Figure:
        """Draw the commanded torques; velocities are 0 here if they are commanded instead."""
        return self._signal('torque', self.torque)

    def surface(self) -> Figure:
        """Draw the sliding surface s, a panel for each unit."""
        return self._signal('sliding surface', self.surface_values)

    def estimates(self) -> Figure:
        """Draw the estimated parameters in SI units, a panel for each unit."""
        return self._signal('estimate', self.estimate)

    def path(self) -> Figure:
        """
        Draw the desired and actual paths of the points of the task in top view.

        Raises
        ------
        InputError
            if the task of the robot has no positions.

        """
        from masmc_ros.report.draw.run_figures import plane_figure
        from masmc_ros.report.draw.style import paper_style
        from masmc_ros.report.panels import place_lines

        if not self.places:
            raise InputError('the task of the robot has no positions; expected a task with points')
        with paper_style():
            return plane_figure(place_lines(self.places, self.actual, self.desired), self.label)

    def _signal(self, title: str, columns: Columns) -> Figure:
        from masmc_ros.report.draw.run_figures import signal_figure
        from masmc_ros.report.draw.style import paper_style
        from masmc_ros.report.panels import signal_panels

        with paper_style():
            return signal_figure(signal_panels(title, self.times, *columns), self.label)
