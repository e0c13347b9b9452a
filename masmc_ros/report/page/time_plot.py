# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Interactive plots of signals over time, with marks at changes of parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from html import escape
import math
from typing import Any

from masmc_ros.aliases import Array
from masmc_ros.report.measure.parameters import change_texts, ParameterChange
from masmc_ros.report.page.packed_samples import MOST, packed_signal
from masmc_ros.report.panels import INK, logarithmic_range, Panel

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
    panel: Panel,
    span: tuple[float, float],
    changes: Sequence[ParameterChange] = (),
    *,
    ranges: int = MOST,
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
    figure = panel_plot(panel, 'time (s)', partial(packed_signal, most=ranges))
    layout = figure['layout']
    layout['xaxis']['range'] = list(span)
    if is_logarithmic:
        ends = logarithmic_range(panel)
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
    panel: Panel, abscissa: str, pack: Callable[[Array, Array], dict[str, str]]
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
        'meta': {'colour': INK},
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
