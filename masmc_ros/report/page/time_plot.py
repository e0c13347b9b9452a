# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Interactive plots of signals over time, with marks at changes of parameters."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from itertools import groupby
from typing import NamedTuple

from masmc_ros.numerics.aliases import Array
from masmc_ros.report.measure.parameters import Change, change_texts
from masmc_ros.report.page.packed_samples import packed_signal
import plotly.graph_objects as go

COLOURS = ('blue', 'vermillion', 'green', 'purple', 'orange', 'sky', 'ink')
"""Okabe and Ito's colours by their names in the page, which has a light and a dark tone."""

INK = 'ink'
"""Colour of the text."""

_SOLID = 4
"""Number of solid lines of a plot."""

_DASHES = 'dash', 'dot', 'dashdot'
"""Dashes of further lines."""

_NAMED = 8
"""Maximum number of changes with visible names; others have tooltips only."""


class Line(NamedTuple):
    """Signal to draw; `name` is HTML for plotly."""

    name: str
    times: Array
    values: Array
    colour: str
    dash: str = 'solid'


def lines(names: Sequence[str], times: Array, values: Array) -> list[Line]:
    """
    Return the columns of values (n, m) as lines of different colours.

    From the fifth line they are dashed, as more colours are hard to distinguish.
    """
    return [
        Line(
            name,
            times,
            column,
            COLOURS[number % len(COLOURS)],
            'solid' if number < _SOLID else _DASHES[number // len(COLOURS) % len(_DASHES)],
        )
        for number, (name, column) in enumerate(zip(names, values.T, strict=True))
    ]


def time_plot(
    drawn: Sequence[Line],
    quantity: str,
    span: tuple[float, float],
    changes: Sequence[Change] = (),
    *,
    is_logarithmic: bool = False,
) -> go.Figure:
    """
    Draw lines over time.

    Parameters
    ----------
    drawn
        times in s from the first state.
    quantity
        quantity of the ordinate with its unit.
    span
        start and end of the abscissa in s.
    changes
        changes of parameters, marked by vertical lines and symbols with tooltips.
    is_logarithmic
        whether the ordinate is logarithmic.

    """
    figure = go.Figure(layout=page_layout())
    for name, times, values, colour, dash in drawn:
        figure.add_trace(scatter(name, packed_signal(times, values), colour, dash))
    figure.update_xaxes(title='time (s)', range=list(span))
    figure.update_yaxes(title=quantity)
    if is_logarithmic:
        figure.update_yaxes(type='log', dtick=1, tickformat='~g')
    if changes:
        _mark(figure, changes)
    return figure


def scatter(name: str, samples: dict[str, str], colour: str, dash: str) -> go.Scatter:
    """Return a line whose colour and visible samples the page sets."""
    return go.Scatter(
        name=name,
        mode='lines',
        # The page reduces the samples; the simplification of plotly has visible corners.
        line={'width': 1.5, 'dash': dash, 'simplify': False},
        meta={'colour': colour, 'samples': samples},
    )


def page_layout() -> dict[str, object]:
    """Return the layout of all plots of the page."""
    return {
        'template': None,
        'margin': {'l': 64, 'r': 12, 't': 32, 'b': 48},  # above are the buttons
        'legend': {'orientation': 'h', 'x': 0.0, 'y': 0.0, 'yref': 'container'},
        'hovermode': 'closest',
        'showlegend': True,
        'font': {'size': 13},
    }


def _mark(figure: go.Figure, changes: Sequence[Change]) -> None:
    """Mark the changes of each tick by one symbol at the upper edge."""
    times, names, texts = [], [], []
    for time, group in groupby(changes, key=lambda change: change.time):
        together = list(group)
        times.append(time)
        names.append(', '.join(escape(change.name) for change in together))
        texts.append('<br>'.join(map(_change_text, together)))
        figure.add_vline(time, line={'width': 1.2, 'dash': 'dot', 'color': '#8C8C8C'})
    figure.add_trace(
        go.Scatter(
            x=times,
            y=[1.0] * len(times),
            yaxis='y2',
            name='changed',
            showlegend=len(times) > _NAMED,
            mode='markers+text' if len(times) <= _NAMED else 'markers',
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
