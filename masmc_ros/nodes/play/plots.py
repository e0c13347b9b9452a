# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Plots of the page: errors, torques and parameter estimates over the last seconds."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.nodes.play.samples import SampleWindow
from masmc_ros.report.measure.adaptation import divisors
from masmc_ros.report.panels import MASS, shown_parameters
from masmc_ros.robot.declaration import Mechanism
import numpy as np
from viser import GuiApi
from viser.uplot import Series, Series_Points

SMALL = 1e3
"""Factor of errors in mm and mrad."""

_COLOURS = (
    '#0072b2', '#d55e00', '#009e73', '#cc79a7', '#e69f00', '#56b4e9', '#555555', '#9467bd',
)  # fmt: skip
"""Colours of lines, which repeat: Okabe and Ito's, and one more."""

_NO_POINTS = Series_Points(show=False)

_MARK = '#b0b0b0'

_CLOSE = 1.0
"""Time in s between two changes of one drag of a slider, whose start counts."""


class _Before(NamedTuple):
    """Samples until a change at a time in s."""

    change: float
    times: Array
    values: Array


class _Plot:
    """Lines over the window, with a mark at each change of a parameter."""

    def __init__(self, gui: GuiApi, title: str, names: Sequence[str], most: int) -> None:
        """
        Add an empty plot.

        Parameters
        ----------
        gui
            Panel of the plot.
        title
            Title with the unit.
        names
            Names of the lines.
        most
            Largest number of samples.

        """
        self.samples = SampleWindow(len(names), most)
        self.before: _Before | None = None
        self._is_compared = False
        lines = [
            Series(label=name, stroke=_COLOURS[i % len(_COLOURS)], width=1.5, points=_NO_POINTS)
            for i, name in enumerate(names)
        ]
        marks = Series(label='change', stroke=_MARK, width=1, scale='marks', points=_NO_POINTS)
        self._series = Series(label='t (s)'), marks, *lines
        self._earlier = tuple(
            Series(**{**line, 'label': f'{name} before', 'dash': (6, 4)})
            for name, line in zip(names, lines, strict=True)
        )
        self._handle = gui.add_uplot(
            self._data(()),
            series=self._series,
            title=title,
            scales={'x': {'time': False}, 'marks': {'range': (0.0, 1.0)}},
            aspect=2.3,
        )

    def compare(self, *, is_on: bool) -> None:
        """Draw the samples before the last change, if any, as dashed lines, or no longer."""
        is_on = is_on and self.before is not None
        if is_on != self._is_compared:
            self._is_compared = is_on
            self._handle.series = (*self._series, *self._earlier) if is_on else self._series

    def send(self, changes: Iterable[float]) -> None:
        """Show the samples, and marks at the times of changes in s."""
        self._handle.data = self._data(changes)

    def _data(self, changes: Iterable[float]) -> tuple[Array, ...]:
        samples = self.samples
        earlier = self._earlier_values() if self._is_compared else ()
        if not len(samples.times):
            return tuple(np.zeros((2 + samples.values.shape[1] + len(earlier), 1)))
        lines = np.ascontiguousarray(samples.values.T)
        return samples.times, samples.marks(changes), *lines, *earlier

    def _earlier_values(self) -> Array:
        """
        Return the lines (width, k) before the last change, which end at the last sample.

        A shorter past is continued by the current lines, which cover the dashed ones there.
        """
        times, before, lines = self.samples.times, self.before, self.samples.values.T
        if before is None or not len(times):
            return lines
        shifted = times - (times[-1] - before.change)
        earlier = [np.interp(shifted, before.times, line) for line in before.values.T]
        return np.where(shifted >= before.times[0], earlier, lines)


class Plots:
    """
    Plots of one robot.

    Attributes
    ----------
    theta
        Function from times (n) in s to the references (n, parameters) of the estimates.

    """

    def __init__(
        self,
        gui: GuiApi,
        mechanism: Mechanism,
        theta: Callable[[Array], Array],
        meaning: str,
        most: int,
    ) -> None:
        """
        Add the plots.

        Parameters
        ----------
        gui
            Panel of the plots.
        mechanism
            Type of the robot.
        theta
            Function from times (n) in s to the references (n, parameters) of the estimates.
        meaning
            Its meaning, such as 'true value'.
        most
            Largest number of samples of a plot.

        """
        self.theta = theta
        self._last_change = -np.inf
        self._points = mechanism.points
        errors = [f'|e_{point.symbol}| ({point.small_unit})' for point in self._points]
        self._errors = _Plot(gui, 'Tracking error', errors, most)
        units = dict.fromkeys(joint.effort_unit for joint in mechanism.joints)
        names = [joint.short for joint in mechanism.joints]
        self._torques = _Plot(gui, f'Torques ({", ".join(units)})', names, most)
        known = set(divisors(theta(np.zeros(1))).tolist())
        shown = [i for i in shown_parameters(mechanism.theta) if i in known]
        self._shown = np.array(shown, dtype=np.intp)
        names = [mechanism.theta[i].symbol or mechanism.theta[i].name for i in shown]
        title = f'Estimates / {meaning}'
        self._ratios = _Plot(gui, title, [name.removesuffix(MASS) for name in names], most)

    def add_error(self, time: float, error: Array) -> None:
        """Add the task error (axes) in m and rad at a time in s."""
        norms = [np.linalg.norm(error[point.axes]) * SMALL for point in self._points]
        self._errors.samples.append(time, norms)

    def note_change(self, time: float) -> None:
        """Store the errors before a change of a parameter at a time in s."""
        samples, last = self._errors.samples, self._last_change
        self._last_change = time
        if 0.0 <= time - last < _CLOSE:
            return
        is_before = samples.times < time
        if is_before.any():
            self._errors.before = _Before(
                time, samples.times[is_before], samples.values[is_before]
            )

    def compare(self, *, is_on: bool) -> str:
        """
        Draw the errors before the last change next to those since, or no longer.

        Returns the RMS of both as text; empty without a comparison.
        """
        self._errors.compare(is_on=is_on)
        before, samples = self._errors.before, self._errors.samples
        if not is_on:
            return ''
        since = 0 if before is None else int(np.searchsorted(samples.times, before.change))
        if before is None or since == len(samples.times):
            return 'no change of a parameter in this run yet'
        length = samples.times[-1] - max(before.change, samples.times[0])
        parts = [
            f'|e_{point.symbol}| {_rms(old):.3g} → {_rms(new):.3g} {point.small_unit}'
            for point, old, new in zip(
                self._points, before.values.T, samples.values[since:].T, strict=True
            )
        ]
        return f'RMS before → since the last change ({length:.0f} s): {", ".join(parts)}'

    def add_torque(self, time: float, torque: Array) -> None:
        """Add the torques (joints) at a time in s."""
        self._torques.samples.append(time, torque)

    def add_estimate(self, time: float, estimate: Array) -> None:
        """Add the estimated parameters (parameters) at a time in s."""
        ratios = estimate[self._shown] / self.theta(np.array([time]))[0, self._shown]
        self._ratios.samples.append(time, ratios)

    def send(self, changes: Sequence[float]) -> None:
        """Show the samples, and marks at the times of changes in s."""
        for plot in (self._errors, self._torques, self._ratios):
            plot.send(changes)


def _rms(values: Array) -> float:
    """Return the root mean square of values (n)."""
    return float(np.sqrt(np.mean(values**2)))
