# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Single runs with their signals as named arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TYPE_CHECKING

from masmc_ros.aliases import Array
from masmc_ros.api.plots import Plots
from masmc_ros.api.scenario import load, Scenario
from masmc_ros.loop.signals import Signal, SIGNALS
from masmc_ros.loop.simulation import Simulation
from masmc_ros.params.declaration import Values
from masmc_ros.params.scenario import activation
from masmc_ros.report.measure.labels import law_label
from masmc_ros.report.measure.metrics import Metrics, Samples
from masmc_ros.report.measure.table import text_table
from masmc_ros.robot.declaration import Coordinate, Mechanism, Quantity
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pyarrow as pa


_SIGNALS = {signal.name: signal for signal in SIGNALS}


@dataclass(frozen=True, repr=False)
class SimulatedRun:
    """
    Run of the closed loop, with every signal of `loop.signals.SIGNALS` as an attribute.

    Such an attribute, as `run.error`, is an array (n, components) of n ticks.

    Attributes
    ----------
    scenario
        Parameter file and changed values.
    time
        (n) Times of the ticks in s.
    signals
        Arrays (n, components) by name, in SI units.
    metrics
        Metrics of `masmc simulate`.
    mechanism
        Type of the robot.

    """

    scenario: Scenario
    time: Array
    signals: Mapping[str, NDArray[Any]]
    metrics: Metrics
    mechanism: Mechanism

    def __getattr__(self, name: str) -> NDArray[Any]:
        """Return a signal (n, components) by its name; AttributeError for another name."""
        if name not in _SIGNALS:
            raise AttributeError(f'{name}: no signal; known are {", ".join(_SIGNALS)}')
        return self.signals[name]

    def __dir__(self) -> list[str]:
        """Return the attributes with the signals, for completion."""
        return [*super().__dir__(), *self.signals]

    def __repr__(self) -> str:
        """Return the table of the metrics."""
        return text_table({self.label: self.metrics})

    @property
    def label(self) -> str:
        """Return the law with its switching term, as in tables and figures."""
        return law_label(self.scenario.values['controller'])

    @property
    def plot(self) -> Plots:
        """Return the figures of the run."""
        return Plots(self.label, self.time, self.error, self.metrics)

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

    def to_arrow(self) -> pa.Table:
        """
        Return all signals as an Arrow table of n rows, with a column for each component.

        The columns are `time` and SIGNAL_COMPONENT, such as `error_x_E`. It needs pyarrow.
        """
        import pyarrow as pa

        columns = {'time': self.time}
        for name, values in self.signals.items():
            for component, column in zip(self.components(name), values.T, strict=True):
                columns['_'.join(filter(None, (name, component)))] = np.ascontiguousarray(column)
        return pa.table(columns)

    def to_xarray(self) -> Any:
        """Return all signals as an xarray dataset over time, with units and component names."""
        import xarray

        data = {}
        for name, values in self.signals.items():
            dimensions = ['time', f'{name}_component']
            unit, text = _SIGNALS[name].unit, _SIGNALS[name].description
            coordinates = {'time': self.time, dimensions[1]: list(self.components(name))}
            attributes = {'units': unit, 'long_name': text}
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
    checked = loaded.values
    simulation = Simulation(checked, activation(checked))
    blocks = list(simulation.run())
    signals = {
        name: np.concatenate([getattr(block, name) for block in blocks])
        for name in map(_name, SIGNALS)
    }
    error, mechanism = signals['error'], simulation.controller.mechanism
    has_torques = not blocks[0].commands_rates
    samples = Samples.of_ticks(
        error,
        signals['torque'] if has_torques else np.zeros((0, len(mechanism.joints))),
        simulation.timing.period,
        mechanism.points,
        active=np.concatenate([block.active for block in blocks]),
        estimate=signals['estimate'][-1:],
    )
    time = np.arange(len(error), dtype=np.float64) * simulation.timing.period
    return SimulatedRun(loaded, time, signals, samples.metrics(), mechanism)


def _name(signal: Signal) -> str:
    return signal.name
