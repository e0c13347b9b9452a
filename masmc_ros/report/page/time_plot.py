# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Interactive plots of signals over time, with marks at changes of parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape
from itertools import groupby
import math

from masmc_ros.aliases import Array
from masmc_ros.report.measure.parameters import Change, change_texts
from masmc_ros.report.page.packed_samples import packed_signal
from masmc_ros.report.panels import INK, logarithmic_range, Panel
import plotly.graph_objects as go

_CHARACTER = 0.009
"""Width of a character as a part of the abscissa; overlapping names are in tooltips only."""

_LAYOUT = {
    'template': None,
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
    changes: Sequence[Change] = (),
    *,
    is_logarithmic: bool = False,
) -> go.Figure:
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
    is_logarithmic
        whether the ordinate is logarithmic.

    """
    figure = panel_plot(panel, 'time (s)', packed_signal)
    figure.update_xaxes(range=list(span))
    if is_logarithmic:
        ends = logarithmic_range(panel)
        decades = None if ends is None else [math.log10(end) for end in ends]
        figure.update_yaxes(type='log', dtick=1, tickformat='~g', range=decades)
    if changes:
        _mark(figure, changes, span[1] - span[0])
    return figure


def panel_plot(
    panel: Panel, abscissa: str, pack: Callable[[Array, Array], dict[str, str]]
) -> go.Figure:
    """Draw lines whose colours and visible samples the page sets; `pack` packs their samples."""
    figure = go.Figure(layout=_LAYOUT)
    for name, x, y, colour, dash in panel.lines:
        # The page reduces the samples; the simplification of plotly has visible corners.
        line = {'width': 1.5, 'dash': dash, 'simplify': False}
        meta = {'colour': colour, 'samples': pack(x, y)}
        figure.add_trace(go.Scatter(name=name, mode='lines', line=line, meta=meta))
    figure.update_xaxes(title=abscissa)
    figure.update_yaxes(title=panel.quantity)
    return figure


def _mark(figure: go.Figure, changes: Sequence[Change], duration: float) -> None:
    """Mark the changes of each tick by one symbol at the upper edge."""
    times: list[float] = []
    names: list[str] = []
    texts: list[str] = []
    free_from = -math.inf
    for time, group in groupby(changes, key=lambda change: change.time):
        together = list(group)
        times.append(time)
        name = ', '.join(change.name for change in together)
        names.append(escape(name) if time >= free_from else '')
        if names[-1]:
            free_from = time + _CHARACTER * duration * len(name)
        texts.append('<br>'.join(map(_change_text, together)))
        figure.add_vline(time, line={'width': 1.2, 'dash': 'dot', 'color': '#8C8C8C'})
    figure.add_trace(
        go.Scatter(
            x=times,
            y=[1.0] * len(times),
            yaxis='y2',
            name='changed',
            showlegend='' in names,
            mode='markers+text',
            marker={'symbol': 'triangle-down', 'size': 12},
            text=names,
            textposition='bottom right',
            meta={'colour': INK},
            cliponaxis=False,
            hovertext=texts,
            hovertemplate='%{x:.3f} s<br>%{hovertext}<extra></extra>',
        )
    )
    figure.update_layout(
        yaxis2={'overlaying': 'y', 'range': [0.0, 1.0], 'visible': False, 'fixedrange': True}
    )


def _change_text(change: Change) -> str:
    """Return a change as HTML for plotly, such as 'controller k_s1: 1.0 → 2.0'."""
    if change.is_event:
        return escape(f'{change.node}: {change.name}')
    old, new = change_texts(change)
    return escape(f'{change.node} {change.name}: {old} → {new}')
