# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Single runs with their signals as named arrays, and figures in the style of the reports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, TYPE_CHECKING

from masmc_ros.aliases import Array
from masmc_ros.api.scenario import load, Scenario
from masmc_ros.errors import InputError
from masmc_ros.loop.signals import Signal, SIGNALS
from masmc_ros.loop.simulation import Simulation
from masmc_ros.params.declaration import Values
from masmc_ros.report.measure.adaptation import Adaptation, relative, TrueTheta
from masmc_ros.report.measure.labels import law_label
from masmc_ros.report.measure.metrics import Metrics, MetricSamples
from masmc_ros.report.measure.table import html_table, text_table
from masmc_ros.report.measure.tracking import Tracking
from masmc_ros.robot.declaration import Coordinate, Mechanism, Point, Quantity
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.scenario import activation
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    import pandas as pd
    import pyarrow as pa


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


_SIGNALS = {signal.name: signal for signal in SIGNALS}

_LOGGED = {
    'applied_effort': '; its name here is `applied`',
    'cmd_vel': '; `rates` contains it',
    'arm_rates': '; `rates` contains them',
    'telemetry': '; its signals are attributes here',
}
"""Ends of messages about attributes that only logged runs have."""


@dataclass(frozen=True, repr=False)
class SimulatedRun:
    """
    Run of the closed loop, with every signal of `loop.signals.SIGNALS` as an attribute.

    Such an attribute, as `run.error`, is an array (n, components) of n ticks.

    Attributes
    ----------
    scenario
        Parameter file and changed values.
    times
        (n) Times of the ticks in s.
    signals
        Arrays (n, components) by name, in SI units.
    metrics
        Metrics of `masmc simulate`.
    mechanism
        Type of the robot.

    """

    scenario: Scenario
    times: Array
    signals: Mapping[str, NDArray[Any]]
    metrics: Metrics
    mechanism: Mechanism

    def __getattr__(self, name: str) -> NDArray[Any]:
        """Return a signal (n, components) by its name; AttributeError for another name."""
        if name not in _SIGNALS:
            raise AttributeError(
                f'{name}: no signal; known are times, {", ".join(_SIGNALS)}'
                + _LOGGED.get(name, '')
            )
        return self.signals[name]

    def __dir__(self) -> list[str]:
        """Return the attributes with the signals, for completion."""
        return [*super().__dir__(), *self.signals]

    def __repr__(self) -> str:
        """Return the table of the metrics."""
        return text_table({self.label: self.metrics})

    def _repr_html_(self) -> str:
        """Return the table of the metrics for notebooks."""
        return html_table({self.label: self.metrics})

    @property
    def label(self) -> str:
        """Return the law with its switching term, as in tables and figures."""
        return law_label(self.scenario.controller)

    @property
    def plot(self) -> Plots:
        """Return the figures of the run."""
        plant = self.scenario.plant
        robot = robot_of(plant)
        theta = TrueTheta(robot, plant).at(self.times)
        adapted = relative(self.times, self.estimate, theta, self.mechanism.theta)
        return Plots(
            self.label,
            self.times,
            self.error,
            self.metrics,
            adapted,
            torque=self._columns('torque'),
            surface_values=self._columns('surface'),
            estimate=self._columns('estimate'),
            places=self.mechanism.places,
            actual=robot.task_positions(self.true_position),
            desired=self.reference[:, :len(self.mechanism.axes)],
        )

    def _columns(self, signal: str) -> Columns:
        names = self.components(signal)
        if signal == 'torque':
            names = tuple(joint.short for joint in self.mechanism.joints)
        return Columns(self.signals[signal], names, self.units(signal))

    def components(self, signal: str) -> tuple[str, ...]:
        """
        Return the names of the components of a signal, such as joints or task axes.

        A signal with a single component has one empty name. KeyError for an unknown signal.
        """
        size = _SIGNALS[signal].size
        named: dict[str, Sequence[Coordinate | Quantity]] = {
            'positions': self.mechanism.positions,
            'joints': self.mechanism.joints,
            'axes': self.mechanism.axes,
            'parameters': self.mechanism.theta,
        }
        if size == 'desired':
            names = [axis.name for axis in self.mechanism.axes]
            return tuple(f'{name}{part}' for part in ('', '_velocity', '_acceleration')
                         for name in names)  # fmt: skip
        return tuple(entry.name for entry in named[str(size)]) if size else ('',)

    def units(self, signal: str) -> tuple[str, ...]:
        """
        Return the units of the components of a signal.

        KeyError for an unknown signal.
        """
        declared, mechanism = _SIGNALS[signal], self.mechanism
        size = str(declared.size)
        joints = [joint.unit for joint in mechanism.joints]
        if size == 'desired':
            axes = [axis.unit for axis in mechanism.axes]
            return tuple(f'{unit}{per}' for per in ('', '/s', '/s²') for unit in axes)
        if signal in ('position', 'true_position'):
            return tuple(position.unit for position in mechanism.positions)
        if signal in ('velocity', 'true_velocity'):
            return tuple(f'{position.unit}/s' for position in mechanism.positions)
        if signal == 'rates':
            twist = [velocity.unit for velocity in mechanism.twist]
            return (*twist, *(f'{unit}/s' for unit in joints[len(twist):]))
        if size == 'joints':
            return tuple(joint.effort_unit for joint in mechanism.joints)
        named = {'axes': mechanism.axes, 'parameters': mechanism.theta}
        if size in named:
            return tuple(declared.unit_of(quantity.unit) for quantity in named[size])
        return (declared.unit,)

    def to_arrow(self) -> pa.Table:
        """
        Return all signals as an Arrow table of n rows, with a column for each component.

        The columns are `time` and SIGNAL_COMPONENT, such as `error_x_E`; their units are metadata
        of the fields. It needs pyarrow.
        """
        import pyarrow as pa

        columns, fields = [pa.array(self.times)], [('time', 's')]
        for name, values in self.signals.items():
            heads = zip(self.components(name), self.units(name), values.T, strict=True)
            for component, unit, column in heads:
                columns.append(pa.array(np.ascontiguousarray(column)))
                fields.append(('_'.join(filter(None, (name, component))), unit))
        schema = [
            pa.field(name, column.type, metadata={'unit': unit})
            for column, (name, unit) in zip(columns, fields, strict=True)
        ]
        return pa.Table.from_arrays(columns, schema=pa.schema(schema))

    def to_pandas(self) -> pd.DataFrame:
        """
        Return all signals as a pandas data frame over time, with the columns of `to_arrow`.

        It needs pyarrow and pandas.
        """
        frame: pd.DataFrame = self.to_arrow().to_pandas().set_index('time')
        return frame

    def to_xarray(self) -> Any:
        """
        Return all signals as an xarray dataset over time, with units and component names.

        The attribute `units` is the unit of a signal; if components have different units, these
        are the coordinate SIGNAL_unit, and `units` contains all of them.
        """
        import xarray

        data = {}
        for name, values in self.signals.items():
            dimensions = ['time', f'{name}_component']
            units, text = self.units(name), _SIGNALS[name].description
            different = list(dict.fromkeys(units))
            coordinates: dict[str, Any] = {
                'time': self.times, dimensions[1]: list(self.components(name)),
            }
            if len(different) > 1:
                coordinates[f'{name}_unit'] = (dimensions[1], list(units))
            attributes = {'units': ', '.join(different), 'long_name': text}
            data[name] = xarray.DataArray(values, coordinates, dimensions, attrs=attributes)
        dataset = xarray.Dataset(data)
        dataset['time'].attrs['units'] = 's'
        return dataset


def simulate(
    scenario: str | Path | Scenario = 'paper', settings: Values | None = None, **values: object
) -> SimulatedRun:
    """
    Compute a run, as `masmc simulate` does.

    Parameters
    ----------
    scenario, settings, values
        As in `load`.

    Returns
    -------
        Run with its signals and metrics.

    Raises
    ------
    InputError
        if a name is unknown, belongs to several nodes, or has a value out of range, or if the run
        diverges.

    """
    loaded = load(scenario, settings, **values)
    simulation = Simulation(loaded, activation(loaded))
    blocks = list(simulation.run())
    signals = {
        name: np.concatenate([getattr(block, name) for block in blocks])
        for name in map(_name, SIGNALS)
    }
    error, mechanism = signals['error'], simulation.controller.mechanism
    has_torques = not blocks[0].commands_rates
    samples = MetricSamples.of_ticks(
        error,
        signals['torque'] if has_torques else np.zeros((0, len(mechanism.joints))),
        simulation.timing.period,
        mechanism.points,
        active=np.concatenate([block.active for block in blocks]),
        estimate=signals['estimate'][-1:],
    )
    times = np.arange(len(error), dtype=np.float64) * simulation.timing.period
    return SimulatedRun(loaded, times, signals, samples.metrics(), mechanism)


def _name(signal: Signal) -> str:
    return signal.name
