# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The interactive plots of the page: which there are for a run, and for all of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from itertools import cycle, product
from typing import NamedTuple

from masmc_ros.log.read.reader import Run
from masmc_ros.loop.signals import CONTACT, PUBLISHED, Signal
from masmc_ros.numerics.aliases import Array
from masmc_ros.report.measure.parameters import Change, run_changes
from masmc_ros.report.measure.tracking import Compared, Tracking
from masmc_ros.report.page.samples import packed_path
from masmc_ros.report.page.time_plot import (
    COLOURS,
    INK,
    Line,
    lines,
    page_layout,
    scatter,
    time_plot,
)
from masmc_ros.robot.declaration import Velocity
import numpy as np
import plotly.graph_objects as go

_SMALL = 1.0e3
"""Errors are drawn in mm and mrad."""

_MOST = 14
"""Lines of a plot of controller signals."""
_DASHES = ('solid', 'dash', 'dot', 'dashdot')


class Plot(NamedTuple):
    """
    A plot of the page.

    Attributes
    ----------
    name
        without spaces, unlike that of the run's other plots.
    title
        what it shows.
    figure
        the plot.
    is_over_time
        whether its abscissa is the time that all such plots share.

    """

    name: str
    title: str
    figure: go.Figure
    is_over_time: bool = True


def span_of(runs: Sequence[Run]) -> tuple[float, float]:
    """Return the time from the first state to the last of the longest run, s."""
    return 0.0, max(float(run.times[-1] - run.times[0]) for run in runs)


def comparison_plots(compared: Sequence[Compared], span: tuple[float, float]) -> list[Plot]:
    """Return the points' distances in all runs that have errors; none where no run has."""
    told = [each for each in compared if len(each.tracked.error)]
    if not told:
        return []
    plots = []
    for point in dict.fromkeys(p for each in told for p in each.run.mechanism.points):
        drawn = []
        styles = cycle(product(_DASHES, COLOURS))
        for each, (dash, colour) in zip(told, styles, strict=False):
            if point not in each.run.mechanism.points:
                continue
            errors = each.tracked.error[:, point.axes] * _SMALL
            size = np.linalg.norm(errors, axis=1)
            # A logarithm has no place for zero.
            size[size == 0.0] = np.nan
            drawn.append(Line(escape(each.label), each.tracked.times, size, colour, dash))
        quantity = f'|e<sub>{point.symbol}</sub>| ({point.small_unit})'
        figure = time_plot(drawn, quantity, span, is_logarithmic=True)
        name = point.title.removeprefix('the ')
        title = f'Distance of the {name} from its reference, all runs'
        plots.append(Plot(f'comparison_{point.symbol}', title, figure))
    return plots


def run_plots(each: Compared, span: tuple[float, float]) -> list[Plot]:
    """Return the plots of all signals in the log of a run."""
    run, tracked = each.run, each.tracked
    changes = run_changes(run)
    begun = run.times[0]
    axes = [axis.html for axis in run.mechanism.axes]
    drives = [joint.label for joint in run.mechanism.joints]
    plots = [Plot('path', 'Paths in the plane', _path(run, tracked), is_over_time=False)]

    def add(
        name: str, title: str, quantity: str, names: Sequence[str], times: Array, values: Array
    ) -> None:
        figure = time_plot(lines(names, times, values), quantity, span, changes)
        plots.append(Plot(name, title, figure))

    def add_told(signals: Iterable[Signal]) -> None:
        for signal in signals:
            series, of = run.telemetry[signal.name], run.components(signal)
            quantity = symbol = signal.symbol or signal.name
            units = [signal.unit_of(each.unit) for each in of]
            names = [f'{each.html} ({unit})' for each, unit in zip(of, units, strict=True)]
            if len(set(units)) == 1:
                quantity = f'{symbol} ({units[0]})'
                names = [f'{symbol} of {each.html}' if each.html else symbol for each in of]
            title, values = signal.title, series.values
            if len(names) > _MOST:
                title = f'{title}: the {_MOST} of {len(names)} that move most'
                chosen = np.sort(np.argsort(np.nan_to_num(np.ptp(values, axis=0)))[-_MOST:])
                names, values = [names[i] for i in chosen], values[:, chosen]
            add(signal.name, title, quantity, names, series.times - begun, values)

    if len(tracked.error):
        for point in run.mechanism.points:
            errors = tracked.error[:, point.axes] * _SMALL
            names = [f'e of {axis}' for axis in axes[point.axes]]
            title = f'Tracking error of {point.title}'
            quantity = f'error ({point.small_unit})'
            add(f'error_{point.symbol}', title, quantity, names, tracked.times, errors)
    told = [signal for signal in PUBLISHED if signal.title and signal.name in run.telemetry]
    of_task = [signal for signal in told if signal.size == 'axes']
    add_told(of_task)
    if run.commands_rates:
        plots += _rates(run, span, changes)
    if len(run.torque):
        times = run.torque.times - begun
        drawn = [*lines(drives, times, run.torque.values), *_raw_torques(run)]
        figure = time_plot(drawn, 'torque (N·m)', span, changes)
        plots.append(Plot('torque', 'Torques commanded', figure))
    else:
        times = run.times - begun
        add('torque', 'Torques applied', 'torque (N·m)', drives, times, run.applied_effort)
    add_told(signal for signal in told if signal not in of_task)
    plots += _contacts(run, span, changes)
    return plots


def _raw_torques(run: Run) -> list[Line]:
    """Return what the law asked for, of the joints where limits cut some of it."""
    raw = run.telemetry.get('raw_torque')
    if raw is None:
        return []
    _, sent, asked = np.intersect1d(run.torque.times, raw.times, return_indices=True)
    is_cut = (run.torque.values[sent] != raw.values[asked]).any(axis=0)
    times = raw.times - run.times[0]
    names = [f'{joint.label}, asked for' for joint in run.mechanism.joints]
    return [
        line._replace(dash='dot')
        for line, cut in zip(lines(names, times, raw.values), is_cut, strict=True)
        if cut
    ]


def _contacts(run: Run, span: tuple[float, float], changes: Sequence[Change]) -> list[Plot]:
    """Return how what touches the ground slips, and what forces it takes there."""
    if run.contact is None:
        return []
    times, names = run.contact.times - run.times[0], run.contact_names
    told = run.contact.values.reshape(len(times), len(names), len(CONTACT))
    plots = []
    for name, title, quantity, unit in (
        ('slip', 'Slip of wheels on the ground', 'slip', 'm/s'),
        ('contact_force', 'Forces on wheels from the ground', 'force', 'N'),
    ):
        parts = [part for part, signal in enumerate(CONTACT) if signal.unit == unit]
        labels = [
            f'{escape(each)}, {CONTACT[part].description}' for each in names for part in parts
        ]
        values = told[:, :, parts].reshape(len(times), -1)
        figure = time_plot(lines(labels, times, values), f'{quantity} ({unit})', span, changes)
        plots.append(Plot(name, title, figure))
    return plots


def _rates(run: Run, span: tuple[float, float], changes: Sequence[Change]) -> list[Plot]:
    """Return what was commanded where no torques were: a speed, and rates, each of its times."""
    begun = run.times[0]
    base, own = run.cmd_vel.times - begun, run.arm_rates.times - begun
    twist = run.mechanism.twist
    drawn = [
        *zip(twist, [base] * len(twist), run.cmd_vel.values.T, strict=True),
        *(
            (Velocity(joint.label, 'rad/s', 0), own, values)
            for joint, values in zip(run.mechanism.own_rates, run.arm_rates.values.T, strict=True)
        ),
    ]
    speeds: list[Line] = []
    rates: list[Line] = []
    for number, (velocity, times, values) in enumerate(drawn):
        line = Line(velocity.name, times, values, COLOURS[number % len(COLOURS)])
        (speeds if velocity.unit == 'm/s' else rates).append(line)
    return [
        Plot('speed', 'Speed commanded', time_plot(speeds, 'speed (m/s)', span, changes)),
        Plot('rates', 'Rates commanded', time_plot(rates, 'rate (rad/s)', span, changes)),
    ]


def _path(run: Run, tracked: Tracking) -> go.Figure:
    """Draw the paths of the robot's points, or where these are none or not known, of its base."""
    figure = go.Figure(layout=page_layout())
    if tracked.actual is None or not run.mechanism.places:
        pose, _ = run.mechanism.formulas.base_motion(run.position, run.velocity)
        _add_path(figure, run.mechanism.origin, pose[:, :2], 'green', 'solid')
    for number, (point, colour) in enumerate(
        zip(run.mechanism.places, ('blue', 'vermillion', 'green', 'purple'), strict=False)
    ):
        for kind, values, tone, dash in (
            ('actual', tracked.actual, colour, 'solid'),
            ('desired', tracked.desired, INK, 'dot' if number else 'dash'),
        ):
            if values is not None:
                points = values[:, point.axes]
                _add_path(figure, f'{point.symbol} {kind}', points, tone, dash)
    figure.update_xaxes(title='x (m)')
    figure.update_yaxes(title='y (m)', scaleanchor='x')
    return figure


def _add_path(figure: go.Figure, name: str, points: Array, colour: str, dash: str) -> None:
    figure.add_trace(scatter(name, packed_path(points), colour, dash))
