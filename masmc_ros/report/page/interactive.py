# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Interactive plots of the page over time, of a run and of all runs, with marks at changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from html import escape
from itertools import compress, cycle
import math
from typing import Any, NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.log.read.decode import Series
from masmc_ros.log.read.reader import Run
from masmc_ros.loop.signals import CONTACT, PUBLISHED, Signal
from masmc_ros.report import panels
from masmc_ros.report.measure.adaptation import Adaptation
from masmc_ros.report.measure.parameters import (
    change_texts,
    ParameterChange,
    run_changes,
    run_robot,
)
from masmc_ros.report.measure.tracking import Compared, Tracking
from masmc_ros.report.page import packed_samples
import numpy as np

_APART = 0.03
"""Minimum distance of two marks as a part of the abscissa; closer changes share a mark."""

Figure = dict[str, Any]
"""Data and layout of a plot of plotly; its Python classes take 20 ms for each plot."""

_LEVEL = {'width': 1.2, 'dash': 'dot', 'color': '#8C8C8C'}
"""Line of a value to which lines are compared, and of changes."""

_LISTED = 8
"""Maximum number of changes in a tooltip."""

_LAYOUT = {
    'margin': {'l': 64, 'r': 12, 't': 32, 'b': 48},  # above are the buttons
    'legend': {'orientation': 'h', 'x': 0.0, 'y': 0.0, 'yref': 'container'},
    'hovermode': 'closest',
    'showlegend': True,
    'font': {'size': 13},
}
"""Layout of all plots of the page."""


def time_plot(
    panel: panels.Panel,
    span: tuple[float, float],
    changes: Sequence[ParameterChange] = (),
    *,
    ranges: int = packed_samples.MOST,
    is_logarithmic: bool = False,
) -> Figure:
    """
    Draw the lines of a panel over time.

    Parameters
    ----------
    panel
        panel over time in s from the first state.
    span
        start and end of the abscissa in s.
    changes
        changes of parameters, marked by vertical lines and symbols with tooltips.
    ranges
        maximum number of ranges of samples of a line.
    is_logarithmic
        whether the ordinate is logarithmic.

    """
    figure = panel_plot(panel, 'time (s)', partial(packed_samples.packed_signal, most=ranges))
    layout = figure['layout']
    layout['xaxis']['range'] = list(span)
    if is_logarithmic:
        ends = panels.logarithmic_range(panel)
        decades = None if ends is None else [math.log10(end) for end in ends]
        layout['yaxis'] |= {'type': 'log', 'dtick': 1, 'tickformat': '~g'}
        if decades is not None:
            layout['yaxis']['range'] = decades
    if panel.level is not None:
        y = panel.level
        level = {'type': 'line', 'xref': 'paper', 'x0': 0, 'x1': 1, 'y0': y, 'y1': y}
        layout['shapes'] = [{**level, 'line': _LEVEL}]
    if panel.has_peaks:
        layout['meta'] = {'hasPeaks': True}
    if changes:
        _mark(figure, changes, span[1] - span[0])
    return figure


def panel_plot(
    panel: panels.Panel, abscissa: str, pack: Callable[[Array, Array], dict[str, str]]
) -> Figure:
    """Draw lines whose colours and visible samples the page sets; `pack` packs their samples."""
    traces = []
    for name, x, y, colour, dash, result in panel.lines:
        # The page reduces the samples; the simplification of plotly has visible corners.
        line = {'width': 1.5, 'dash': dash, 'simplify': False}
        legend = f'{name}: {result}' if result else name
        meta = {'colour': colour, 'samples': pack(x, y)}
        traces.append({'name': legend, 'mode': 'lines', 'line': line, 'meta': meta})
    axes = {
        f'{letter}axis': {'title': {'text': title}, 'automargin': True}
        for letter, title in (('x', abscissa), ('y', panel.quantity))
    }
    return {'data': traces, 'layout': {**_LAYOUT, **axes}}


def _mark(figure: Figure, changes: Sequence[ParameterChange], duration: float) -> None:
    """Mark changes by symbols at the upper edge; changes close to each other by one symbol."""
    marks: list[list[ParameterChange]] = []
    for change in sorted(changes, key=lambda change: change.time):
        if marks and change.time - marks[-1][0].time <= _APART * duration:
            marks[-1].append(change)
        else:
            marks.append([change])
    times = [mark[0].time for mark in marks]
    names: list[str] = []
    for mark in marks:
        distinct = dict.fromkeys(change.name for change in mark)
        name = ', '.join(distinct)
        if len(mark) > len(distinct):
            name += f' ({len(mark)} changes)'
        # The page shows those that do not overlap.
        names.append(escape(name))
    figure['data'].append({
        'x': times,
        'y': [1.0] * len(times),
        'yaxis': 'y2',
        'name': 'changed',
        'mode': 'markers+text',
        'marker': {'symbol': 'triangle-down', 'size': 12},
        'text': names,
        'textposition': 'bottom right',
        'meta': {'colour': panels.INK},
        'cliponaxis': False,
        'hovertext': [_mark_text(mark) for mark in marks],
        'hovertemplate': '%{x:.3f} s<br>%{hovertext}<extra></extra>',
    })
    vertical = {'type': 'line', 'xref': 'x', 'yref': 'y domain', 'y0': 0, 'y1': 1, 'line': _LEVEL}
    figure['layout'] |= {
        'shapes': [{**vertical, 'x0': time, 'x1': time} for time in times],
        'yaxis2': {'overlaying': 'y', 'range': [0.0, 1.0], 'visible': False, 'fixedrange': True},
    }


def _mark_text(mark: Sequence[ParameterChange]) -> str:
    """Return the changes of a mark as HTML for plotly: the first ones and their number."""
    has_times = mark[-1].time != mark[0].time
    lines = [
        f'{change.time:.3f} s: {_change_text(change)}' if has_times else _change_text(change)
        for change in mark[:_LISTED]
    ]
    if len(mark) > _LISTED:
        last = f'{mark[-1].time:.3f} s'
        lines.append(f'and {len(mark) - _LISTED} more until {last}, see the table')
    return '<br>'.join(lines)


def _change_text(change: ParameterChange) -> str:
    """Return a change as HTML for plotly, such as 'controller k_s1: 1.0 → 2.0'."""
    if change.is_event:
        return escape(f'{change.node}: {change.name}')
    old, new = change_texts(change)
    return escape(f'{change.node} {change.name}: {old} → {new}')


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
    of_runs: Sequence[tuple[str, Sequence[panels.Panel]]], span: tuple[float, float]
) -> list[Plot]:
    """Return the panels of a comparison, without those that no run has."""
    plots = []
    for panel in panels.comparison_panels(of_runs):
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
    for panel in panels.adaptation_panels(adapted):
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
    path = panels.path_panel(run, compared.tracked)
    plane = panel_plot(path, '<i>x</i> (m)', partial(packed_samples.packed_path, most=ranges))
    plane['layout']['yaxis']['scaleanchor'] = 'x'
    robot = run_robot(run)
    if robot is not None and ranges >= packed_samples.REPLAYED:
        replayed = packed_samples.packed_robot(robot, run.times - run.times[0], run.position)
        plane['layout']['meta'] = {'robot': replayed}
    return [Plot(path.name, path.title, plane, is_over_time=False)] + [
        Plot(panel.name, panel.title, time_plot(panel, span, changes, ranges=ranges))
        for panel in _shown(run, compared.tracked)
        if has_estimates or panel.name != _ESTIMATE
    ]


def _shown(run: Run, tracked: Tracking) -> Iterator[panels.Panel]:
    """Yield all panels over time."""
    mechanism, start = run.mechanism, run.times[0]
    if len(tracked.error):
        for point in mechanism.points:
            names = [f'e of {axis.html}' for axis in mechanism.axes[point.axes]]
            yield panels.error_panel(tracked, point, names)
    signals = [signal for signal in PUBLISHED if signal.title and signal.name in run.telemetry]
    yield from (_published(run, signal) for signal in signals if signal.size == 'axes')
    if run.commands_rates or len(run.cmd_vel):
        yield from _velocities(run)
    units = [joint.effort_unit for joint in mechanism.joints]
    drives, quantity = [joint.label for joint in mechanism.joints], f'torque ({units[0]})'
    if len(set(units)) > 1:
        drives = [f'{name} ({unit})' for name, unit in zip(drives, units, strict=True)]
        quantity = 'torque or force'
    title, drawn = 'Applied torques', panels.lines(drives, run.times - start, run.applied_effort)
    if len(run.torque):
        title, drawn = 'Commanded torques', panels.lines(
            drives, run.torque.times - start, run.torque.values
        )
        drawn += _raw_torques(run)
    yield panels.Panel('torque', title, quantity, drawn, has_peaks=True)
    yield from (_published(run, signal) for signal in signals if signal.size != 'axes')
    if run.contact is not None:
        yield from _contacts(run, run.contact)


def _published(run: Run, signal: Signal) -> panels.Panel:
    """Return the panel of a signal of the controller."""
    series, components = run.telemetry[signal.name], run.components(signal)
    quantity = symbol = signal.symbol or signal.name
    units = [signal.unit_of(component.unit) for component in components]
    names = [f'{c.html} ({unit})' for c, unit in zip(components, units, strict=True)]
    if len(set(units)) == 1:
        quantity = f'{symbol} ({units[0]})'
        names = [f'{symbol} of {c.html}' if c.html else symbol for c in components]
    title, values = signal.title, series.values
    if len(names) > panels.MULTIPLES:
        title = f'{title}: the {panels.MULTIPLES} of {len(names)} that move most'
        chosen = np.sort(np.argsort(np.nan_to_num(np.ptp(values, axis=0)))[-panels.MULTIPLES:])
        names, values = [names[i] for i in chosen], values[:, chosen]
    drawn = panels.lines(names, series.times - run.times[0], values)
    return panels.Panel(signal.name, title, quantity, drawn, has_peaks=signal.size == 'axes')


def _raw_torques(run: Run) -> list[panels.Line]:
    """Return the torques of the law, of the joints whose torques were limited."""
    raw = run.telemetry.get('raw_torque')
    if raw is None:
        return []
    _, sent, requested = np.intersect1d(run.torque.times, raw.times, return_indices=True)
    is_limited = (run.torque.values[sent] != raw.values[requested]).any(axis=0)
    names = [f'{joint.label}, requested' for joint in run.mechanism.joints]
    drawn = panels.lines(names, raw.times - run.times[0], raw.values)
    return [line._replace(dash='dot') for line in compress(drawn, is_limited)]


def _contacts(run: Run, contact: Series) -> Iterator[panels.Panel]:
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
        drawn = panels.lines(labels, contact.times - run.times[0], shown)
        yield panels.Panel(name, title, f'{quantity} ({unit})', drawn)


def _velocities(run: Run) -> Iterator[panels.Panel]:
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
        (unit, panels.Line(name, times, values, colour))
        for (name, unit), (times, values), colour in zip(entries, columns, cycle(panels.COLOURS))
        if len(times)  # with command_interface hybrid only the base has velocities
    ]
    speeds = [line for unit, line in drawn if unit == 'm/s']
    rates = [line for unit, line in drawn if unit != 'm/s']
    if speeds:
        yield panels.Panel('speed', 'Commanded speed', 'speed (m/s)', speeds)
    if rates:
        yield panels.Panel('rates', 'Commanded rates', 'rate (rad/s)', rates)
