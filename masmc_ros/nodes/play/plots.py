# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Plots of the page: errors, torques and parameter estimates over the last seconds.

Their robot and references follow from the parameters of the nodes of a run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.loop.records import nominal_theta
from masmc_ros.loop.simulated_robot import disturbance_waves
from masmc_ros.nodes.play.samples import SampleWindow
from masmc_ros.params.declaration import check_all, MutableValues, Values
from masmc_ros.report.measure.adaptation import divisors, TrueTheta
from masmc_ros.robot.declaration import MASS, Mechanism, shown_parameters
from masmc_ros.robot.mechanisms import joint_names, mechanism_from
from masmc_ros.robot.robot import Robot, robot_description, robot_of
from masmc_ros.scenario.node_parameters import declared
import numpy as np
from viser import GuiApi
from viser.uplot import Series, Series_Points

DESCRIBING = ('plant', 'controller')
"""Nodes that describe the robot, first the one with the true robot."""


TRUE_VALUE = 'true value'
"""Meaning of the reference of the estimates in a run with a plant."""


class ShownRobot(NamedTuple):
    """Robot of the scene."""

    robot: Robot
    description: str
    """URDF whose links have the names of the frames."""
    joints: tuple[str, ...]
    """Names of the positions in joint_states."""
    plant: Values | None
    """Checked values of the plant; None without one."""

    def disturbance(self, time: float) -> Array:
        """Return the disturbance torque (joints) in N·m at a time in s; 0 without a plant."""
        if self.plant is None:
            return np.zeros(len(self.robot.mechanism.joints))
        wave = disturbance_waves(self.plant)
        torque: Array = wave['amplitude'] * np.sin(wave['frequency'] * time + wave['phase'])
        return torque


class EstimateReference(NamedTuple):
    """Values by which estimates are divided."""

    mechanism: Mechanism
    theta: Callable[[Array], Array]
    """Function from times (n) in s to the values (n, parameters)."""
    meaning: str
    values: Values
    """Checked values of the controller."""


def shown_robot(parameters: Mapping[str, Values]) -> ShownRobot | None:
    """
    Return the robot of a run; None if no node describes it.

    Parameters
    ----------
    parameters
        Values by node and by name.

    Raises
    ------
    InputError
        If the robot is invalid, or its description is not on this machine.

    """
    node = next((node for node in DESCRIBING if node in parameters), None)
    if node is None:
        return None
    values = checked_values(node, parameters[node])
    plant = values if node == 'plant' else None
    return ShownRobot(robot_of(values), robot_description(values), joint_names(values), plant)


def estimate_reference(
    parameters: Mapping[str, Values], robot: Robot
) -> EstimateReference | None:
    """
    Return the reference of the estimates; None without a controller.

    It is the true robot with its payload if a plant describes it, otherwise the nominal robot of
    the controller.

    Parameters
    ----------
    parameters
        Values by node and by name.
    robot
        Robot of `shown_robot`.

    """
    if 'controller' not in parameters:
        return None
    values = checked_values('controller', parameters['controller'])
    nominal = robot_of(values)
    if 'plant' in parameters and robot.mechanism.theta == nominal.mechanism.theta:
        true = TrueTheta(robot, parameters['plant'])
        return EstimateReference(nominal.mechanism, true.at, TRUE_VALUE, values)
    theta = nominal_theta(nominal, values)
    return EstimateReference(
        nominal.mechanism, lambda times: np.tile(theta, (len(times), 1)), 'nominal value', values
    )


def checked_values(node: str, values: Values) -> MutableValues:
    """Return those of a node's values that this version declares; InputError for a wrong one."""
    declarations = declared(node, mechanism_from(values))
    known = {p.name: values[p.name] for p in declarations if p.name in values}
    return check_all(declarations, known, integers_for_doubles=True)


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
