# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Interactive plots of the page, of a run and of all runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from html import escape
from itertools import compress, cycle
from typing import NamedTuple

from masmc_ros.log.read.decode import Series
from masmc_ros.log.read.reader import Run
from masmc_ros.loop.signals import CONTACT, PUBLISHED, Signal
from masmc_ros.report.measure.adaptation import Adaptation
from masmc_ros.report.measure.parameters import run_changes, run_robot
from masmc_ros.report.measure.tracking import Compared, Tracking
from masmc_ros.report.page.packed_samples import packed_path, packed_robot, REPLAYED
from masmc_ros.report.page.time_plot import Figure, panel_plot, time_plot
from masmc_ros.report.panels import (
    adaptation_panels,
    COLOURS,
    comparison_panels,
    error_panel,
    Line,
    lines,
    MULTIPLES,
    Panel,
    path_panel,
)
import numpy as np

_ESTIMATE = 'estimate'
"""Name of the panel of the estimates in SI units."""

NAMED = 8
"""Maximum number of runs of a plot with a legend; pointing at a line shows its run."""


class Plot(NamedTuple):
    """
    A plot of the page.

    Attributes
    ----------
    name
        identifier within the run, without spaces.
    title
        title above the plot.
    figure
        the plot.
    is_over_time
        whether its abscissa is the time that all such plots share.

    """

    name: str
    title: str
    figure: Figure
    is_over_time: bool = True


def comparison_plots(
    of_runs: Sequence[tuple[str, Sequence[Panel]]], span: tuple[float, float]
) -> list[Plot]:
    """Return the panels of a comparison, without those that no run has."""
    plots = []
    for panel in comparison_panels(of_runs):
        # A logarithmic axis does not show zero.
        drawn = [
            line._replace(y=np.where(line.y == 0.0, np.nan, line.y))
            for line in panel.lines
            if len(line.x)
        ]
        if drawn:
            figure = time_plot(panel._replace(lines=drawn), span, is_logarithmic=True)
            figure['layout']['showlegend'] = len(drawn) <= NAMED
            plots.append(Plot(panel.name, f'{panel.title}, all runs', figure))
    return plots


def adaptation_plots(
    adapted: Sequence[tuple[str, Adaptation | None]], span: tuple[float, float]
) -> list[Plot]:
    """Return a small plot for each parameter, with the estimates of all runs."""
    plots = []
    for panel in adaptation_panels(adapted):
        figure = time_plot(panel, span)
        figure['layout']['showlegend'] = len(panel.lines) <= NAMED
        plots.append(Plot(panel.name, panel.title, figure))
    return plots


def run_plots(compared: Compared, ranges: int, *, has_estimates: bool) -> list[Plot]:
    """
    Return the plots of all signals in the log of a run.

    Parameters
    ----------
    compared
        the run.
    ranges
        maximum number of ranges of samples of a line.
    has_estimates
        whether the estimates are drawn; the plots of the adaptation contain them otherwise.

    """
    run, changes = compared.run, run_changes(compared.run)
    span = (0.0, float(run.times[-1] - run.times[0]))
    path = path_panel(run, compared.tracked)
    plane = panel_plot(path, '<i>x</i> (m)', partial(packed_path, most=ranges))
    plane['layout']['yaxis']['scaleanchor'] = 'x'
    robot = run_robot(run)
    if robot is not None and ranges >= REPLAYED:
        replayed = packed_robot(robot, run.times - run.times[0], run.position)
        plane['layout']['meta'] = {'robot': replayed}
    return [Plot(path.name, path.title, plane, is_over_time=False)] + [
        Plot(panel.name, panel.title, time_plot(panel, span, changes, ranges=ranges))
        for panel in _shown(run, compared.tracked)
        if has_estimates or panel.name != _ESTIMATE
    ]


def _shown(run: Run, tracked: Tracking) -> Iterator[Panel]:
    """Yield all panels over time."""
    mechanism, start = run.mechanism, run.times[0]
    if len(tracked.error):
        for point in mechanism.points:
            names = [f'e of {axis.html}' for axis in mechanism.axes[point.axes]]
            yield error_panel(tracked, point, names)
    signals = [signal for signal in PUBLISHED if signal.title and signal.name in run.telemetry]
    yield from (_published(run, signal) for signal in signals if signal.size == 'axes')
    if run.commands_rates or len(run.cmd_vel):
        yield from _velocities(run)
    units = [joint.effort_unit for joint in mechanism.joints]
    drives, quantity = [joint.label for joint in mechanism.joints], f'torque ({units[0]})'
    if len(set(units)) > 1:
        drives = [f'{name} ({unit})' for name, unit in zip(drives, units, strict=True)]
        quantity = 'torque or force'
    title, drawn = 'Applied torques', lines(drives, run.times - start, run.applied_effort)
    if len(run.torque):
        title, drawn = 'Commanded torques', lines(
            drives, run.torque.times - start, run.torque.values
        )
        drawn += _raw_torques(run)
    yield Panel('torque', title, quantity, drawn, has_peaks=True)
    yield from (_published(run, signal) for signal in signals if signal.size != 'axes')
    if run.contact is not None:
        yield from _contacts(run, run.contact)


def _published(run: Run, signal: Signal) -> Panel:
    """Return the panel of a signal of the controller."""
    series, components = run.telemetry[signal.name], run.components(signal)
    quantity = symbol = signal.symbol or signal.name
    units = [signal.unit_of(component.unit) for component in components]
    names = [f'{c.html} ({unit})' for c, unit in zip(components, units, strict=True)]
    if len(set(units)) == 1:
        quantity = f'{symbol} ({units[0]})'
        names = [f'{symbol} of {c.html}' if c.html else symbol for c in components]
    title, values = signal.title, series.values
    if len(names) > MULTIPLES:
        title = f'{title}: the {MULTIPLES} of {len(names)} that move most'
        chosen = np.sort(np.argsort(np.nan_to_num(np.ptp(values, axis=0)))[-MULTIPLES:])
        names, values = [names[i] for i in chosen], values[:, chosen]
    drawn = lines(names, series.times - run.times[0], values)
    return Panel(signal.name, title, quantity, drawn, has_peaks=signal.size == 'axes')


def _raw_torques(run: Run) -> list[Line]:
    """Return the torques of the law, of the joints whose torques were limited."""
    raw = run.telemetry.get('raw_torque')
    if raw is None:
        return []
    _, sent, requested = np.intersect1d(run.torque.times, raw.times, return_indices=True)
    is_limited = (run.torque.values[sent] != raw.values[requested]).any(axis=0)
    names = [f'{joint.label}, requested' for joint in run.mechanism.joints]
    drawn = lines(names, raw.times - run.times[0], raw.values)
    return [line._replace(dash='dot') for line in compress(drawn, is_limited)]


def _contacts(run: Run, contact: Series) -> Iterator[Panel]:
    """Yield slip and forces of the wheels on the ground."""
    names = run.contact_names
    values = contact.values.reshape(len(contact), len(names), len(CONTACT))
    for name, title, quantity, unit in (
        ('slip', 'Slip of wheels on the ground', 'slip', 'm/s'),
        ('contact_force', 'Forces on wheels from the ground', 'force', 'N'),
    ):
        parts = [part for part, signal in enumerate(CONTACT) if signal.unit == unit]
        labels = [
            f'{escape(place)}, {CONTACT[part].description}' for place in names for part in parts
        ]
        shown = values[:, :, parts].reshape(len(contact), -1)
        drawn = lines(labels, contact.times - run.times[0], shown)
        yield Panel(name, title, f'{quantity} ({unit})', drawn)


def _velocities(run: Run) -> Iterator[Panel]:
    """Yield the commanded velocities, in m/s and in rad/s, each with its own times."""
    mechanism, start = run.mechanism, run.times[0]
    entries = [(velocity.name, velocity.unit) for velocity in mechanism.twist]
    entries += [(joint.label, f'{joint.unit}/s') for joint in mechanism.own_rates]
    columns = [
        (series.times - start, values)
        for series in (run.cmd_vel, run.arm_rates)
        for values in series.values.T
    ]
    drawn = [
        (unit, Line(name, times, values, colour))
        for (name, unit), (times, values), colour in zip(entries, columns, cycle(COLOURS))
        if len(times)  # with command_interface hybrid only the base has velocities
    ]
    speeds = [line for unit, line in drawn if unit == 'm/s']
    rates = [line for unit, line in drawn if unit != 'm/s']
    if speeds:
        yield Panel('speed', 'Commanded speed', 'speed (m/s)', speeds)
    if rates:
        yield Panel('rates', 'Commanded rates', 'rate (rad/s)', rates)
