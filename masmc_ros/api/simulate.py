# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Single runs with their signals as named arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TYPE_CHECKING

from masmc_ros.api.settings import settings_of
from masmc_ros.loop.signals import Signal, SIGNALS
from masmc_ros.loop.simulation import Simulation
from masmc_ros.numerics.aliases import Array
from masmc_ros.params.declaration import Values
from masmc_ros.params.scenario import activation, load_scenario
from masmc_ros.report.measure.labels import law_label
from masmc_ros.report.measure.metrics import Metrics, Samples
from masmc_ros.report.measure.table import text_table
from masmc_ros.robot.declaration import Coordinate, Mechanism, Quantity
from masmc_ros.share import scenario_file
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pyarrow as pa


_SIGNALS = {signal.name: signal for signal in SIGNALS}


@dataclass(frozen=True, repr=False)
class SimulatedRun:
    """
    Run of the closed loop; each of `loop.signals.SIGNALS` is an attribute (n, components).

    Attributes
    ----------
    scenario
        checked values by node and name.
    time
        (n) s.
    signals
        arrays (n, components) by name, SI units.
    metrics
        metrics of `masmc simulate`.
    mechanism
        type of the robot.

    """

    scenario: Mapping[str, Values]
    time: Array
    signals: Mapping[str, NDArray[Any]]
    metrics: Metrics
    mechanism: Mechanism

    def __getattr__(self, name: str) -> NDArray[Any]:
        """Return a signal by its name."""
        if name not in _SIGNALS:
            raise AttributeError(f'{name}: no signal; known are {", ".join(_SIGNALS)}')
        return self.signals[name]

    def __dir__(self) -> list[str]:
        """Return the attributes with the signals, for completion."""
        return [*super().__dir__(), *self.signals]

    def __repr__(self) -> str:
        """Return the table of the metrics."""
        return text_table({law_label(self.scenario['controller']): self.metrics})

    def components(self, signal: str) -> tuple[str, ...]:
        """Return the names of the components of a signal, such as joints or task axes."""
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
        """Return all signals as an Arrow table, a column for each component."""
        import pyarrow as pa

        columns = {'time': self.time}
        for name, values in self.signals.items():
            for component, column in zip(self.components(name), values.T, strict=True):
                columns['_'.join(filter(None, (name, component)))] = np.ascontiguousarray(column)
        return pa.table(columns)


def simulate(
    scenario: str = 'paper', settings: Values | None = None, **values: object
) -> SimulatedRun:
    """
    Compute a run, as `masmc simulate` does.

    Parameters
    ----------
    scenario
        parameter file, or name of an installed one.
    settings
        values by name as in `--set`: `{'plant.robot.link_2_mass': 1.2}`.
    values
        the same by the name without its node: `k_s1=150`; two underscores stand for a dot.

    Returns
    -------
        Run with its signals and metrics.

    Raises
    ------
    InputError
        If a name is unknown or a value out of range, or if the run diverges.

    """
    file = scenario_file(scenario)
    checked = load_scenario(file, settings_of(file, settings, values))
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
    return SimulatedRun(checked, time, signals, samples.metrics(), mechanism)


def _name(signal: Signal) -> str:
    return signal.name
