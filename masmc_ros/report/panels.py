# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Panels of the figures and of the page: titles, axes with units, and lines.

Texts are HTML of plotly, with symbols in italics; `style.mathtext` converts them for matplotlib.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from html import escape
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.log.read.decode import Series
from masmc_ros.log.read.reader import Run
from masmc_ros.report.measure.adaptation import Adaptation
from masmc_ros.report.measure.table import DIGITS, number
from masmc_ros.report.measure.tracking import Compared, Tracking
from masmc_ros.robot.declaration import Mechanism, Point, Quantity
import numpy as np

COLOURS = ('blue', 'vermillion', 'green', 'purple', 'orange', 'sky', 'ink')
"""Okabe and Ito's colours, which the colour-blind distinguish; `ink` is the colour of the text."""

INK = COLOURS[-1]

DASHES = 'solid', 'dash', 'dashdot', 'longdash', 'longdashdot', 'dot'
"""Dashes of successive lines, which distinguish them in grey as well."""

MULTIPLES = 14
"""Maximum number of parameters with estimates in a panel, or with panels of their own."""

_SUBSCRIPTS = str.maketrans('0123456789', '₀₁₂₃₄₅₆₇₈₉')

_LOWEST = 2.0
"""Percentile of a line at the start of a logarithmic axis, above zero crossings and starts."""

_Vectors = tuple[Array, Array]
"""Times and vectors (n, m)."""

_Subject = tuple[str, str, Callable[[Compared], _Vectors | None]]
"""Title, quantity, and function that returns the vectors of a run, None if it has none."""


class Line(NamedTuple):
    """Line through points (x, y), with its name in the legend and a short result, or none."""

    name: str
    x: Array
    y: Array
    colour: str
    dash: str = 'solid'
    result: str = ''


class Panel(NamedTuple):
    """
    Lines with common axes.

    Attributes
    ----------
    name
        Identifier within the run, without spaces.
    title
        Title, as plain text.
    quantity
        Quantity of the ordinate with its unit.
    lines
        Lines; times are in s from the first state.
    level
        Ordinate of a horizontal line to which the lines are compared; None without one.
    has_peaks
        Whether the range of the ordinate ignores short peaks, which are given as numbers.

    """

    name: str
    title: str
    quantity: str
    lines: list[Line]
    level: float | None = None
    has_peaks: bool = False


def logarithmic_range(panel: Panel) -> tuple[float, float] | None:
    """Return the ends of a logarithmic axis for a panel; None if it has no positive values."""
    lows, highs = [], []
    for line in panel.lines:
        positive = line.y[np.isfinite(line.y) & (line.y > 0.0)]
        if len(positive):
            lows.append(float(np.percentile(positive, _LOWEST)))
            highs.append(float(positive.max()))
    return (0.7 * min(lows), 1.4 * max(highs)) if lows else None


def lines(names: Sequence[str], times: Array, values: Array) -> list[Line]:
    """Return the columns of values (n, m) as lines of different styles."""
    return [
        Line(name, times, column, *_style(number))
        for number, (name, column) in enumerate(zip(names, values.T, strict=True))
    ]


def _style(number: int) -> tuple[str, str]:
    """Return colour and dash of a line; both differ between successive lines."""
    return COLOURS[number % len(COLOURS)], DASHES[number % len(DASHES)]


def error_panel(tracked: Tracking, point: Point, names: Sequence[str]) -> Panel:
    """Return the errors of a point; `names` are those of its axes."""
    return Panel(
        f'error_{point.symbol}',
        f'Tracking error of {point.title}',
        f'error ({point.small_unit})',
        lines(names, tracked.times, tracked.small_errors(point)),
    )


def path_panel(run: Run, tracked: Tracking) -> Panel:
    """Return the paths of the robot's points, or of its base if these are not known."""
    drawn = []
    if tracked.actual is None or not run.mechanism.places:
        pose, _ = run.mechanism.formulas.base_motion(run.position, run.velocity)
        drawn.append(Line(run.mechanism.origin, pose[:, 0], pose[:, 1], 'green'))
    drawn += place_lines(run.mechanism.places, tracked.actual, tracked.desired)
    is_in_space = any(point.size > 2 for point in run.mechanism.places)
    title = 'Paths in top view, without z' if is_in_space else 'Paths in the plane'
    return Panel('path', title, '<i>y</i> (m)', drawn)


def place_lines(
    places: Sequence[Point], actual: Array | None, desired: Array | None
) -> list[Line]:
    """
    Return the actual and desired paths of points in the plane, where they are known.

    Parameters
    ----------
    places
        Points with a position.
    actual, desired
        Task coordinates (n, axes) in m and rad.

    """
    drawn = []
    for place, (point, colour) in enumerate(zip(places, COLOURS, strict=False)):
        for kind, values, tone, dash in (
            ('actual', actual, colour, 'longdash' if place else 'solid'),
            ('desired', desired, INK, 'dot' if place else 'dash'),
        ):
            if values is not None:
                x, y = values[:, point.plane].T
                drawn.append(Line(f'{point.symbol} {kind}', x, y, tone, dash))
    return drawn


def signal_panels(
    title: str, times: Array, values: Array, names: Sequence[str], units: Sequence[str]
) -> list[Panel]:
    """
    Return the components of a signal over time, a panel for each unit.

    Parameters
    ----------
    title
        Name of the signal.
    times
        (n) in s.
    values
        (n, components).
    names, units
        (components).

    """
    panels = []
    for unit in dict.fromkeys(units):
        shown = [i for i, other in enumerate(units) if other == unit]
        drawn = lines([names[i] for i in shown], times, values[:, shown])
        panels.append(Panel(title, title, f'{title} ({unit})', drawn))
    return panels


def comparison_panels(compared: Sequence[Compared]) -> list[Panel]:
    """
    Return the distances of all points from their references, and the norms of the torques.

    The torques are those of each group of joints. If no run has torques, the panels have the
    commanded velocities. Each panel has a line for each run, which is empty without data.
    """
    panels = []
    for place, (title, quantity, vectors) in enumerate(_subjects(compared)):
        drawn = []
        for run, entry in enumerate(compared):
            times, values = vectors(entry) or (np.zeros(0), np.zeros((0, 1)))
            norm = np.linalg.norm(values, axis=1)
            drawn.append(Line(escape(entry.label), times, norm, *_style(run)))
        panels.append(Panel(f'comparison_{place}', title, quantity, drawn))
    return panels


def adaptation_panels(adapted: Sequence[tuple[str, Adaptation | None]]) -> list[Panel]:
    """
    Return the ratios of the estimates to their values, a panel for each parameter.

    Runs with values of the plant and runs with nominal ones have separate panels. A line for each
    run with estimates has its final error as its result.

    Parameters
    ----------
    adapted
        Name and adaptation of every run; None for a run without estimates.

    """
    panels: list[Panel] = []
    for is_true in (True, False):
        members = [
            (place, label, entry)
            for place, (label, entry) in enumerate(adapted)
            if entry is not None and entry.is_true == is_true
        ]
        kind = 'true' if is_true else 'nominal'
        for quantity in _most_moved([entry for _, _, entry in members]):
            drawn, values = [], []
            for place, label, entry in members:
                if quantity in entry.quantities:
                    column = entry.quantities.index(quantity)
                    drawn.append(Line(
                        escape(label), entry.times, entry.ratios[:, column], *_style(place),
                        percent(entry.final_errors[column]),
                    ))  # fmt: skip
                    values.append(f'{entry.values[column]:.3g}')
            numbers = ' or '.join(dict.fromkeys(values))
            title = f'{plain_symbol(quantity)}: {kind} {numbers} {quantity.unit}'
            name = f'adaptation_{len(panels)}'
            panels.append(Panel(name, title, f'estimate / {kind}', drawn, level=1.0))
    return panels


def percent(error: float) -> str:
    """Return an error in percent with its sign, such as −12.3 %."""
    sign = '−' if error < 0.0 else '+'
    return f'{sign}{number(abs(error), DIGITS)} %'


def plain_symbol(quantity: Quantity) -> str:
    """Return the symbol of a parameter with its subscript, without HTML."""
    base, _, index = (quantity.symbol or quantity.name).partition('_')
    return base + index.translate(_SUBSCRIPTS) if not index or index.isdecimal() else quantity.name


def _most_moved(adapted: Sequence[Adaptation]) -> list[Quantity]:
    """Return the parameters of some runs, of many those whose estimates move most."""
    moves: dict[Quantity, float] = {}
    for entry in adapted:
        spans = np.nan_to_num(np.ptp(entry.ratios, axis=0)).tolist()
        for quantity, span in zip(entry.quantities, spans, strict=True):
            moves[quantity] = max(span, moves.get(quantity, 0.0))
    chosen = sorted(moves, key=lambda quantity: -moves[quantity])[:MULTIPLES]
    return [quantity for quantity in moves if quantity in chosen]


def _subjects(compared: Sequence[Compared]) -> Iterator[_Subject]:
    """Yield the subjects of the comparison for the robots of all runs, each once."""
    kinds = tuple(dict.fromkeys(entry.run.mechanism for entry in compared))
    for point in dict.fromkeys(point for kind in kinds for point in kind.points):
        quantity = f'<i>|e<sub>{point.symbol}</sub>|</i> ({point.small_unit})'
        yield f'Tracking error of {point.title}', quantity, partial(Compared.errors, point=point)
    if not all(entry.run.commands_rates for entry in compared):
        for group in dict.fromkeys(group for kind in kinds for group in kind.groups):
            owners = [kind for kind in kinds if group in kind.groups]
            efforts = (joint.effort_unit for kind in owners for joint in kind.joints[group.joints])
            vectors = partial(_columns, owners, 'torque', group.joints)
            yield f'Commanded torques, {group.name}', _norm('τ', efforts), vectors
        return
    for kind in kinds:
        if kind.twist:
            turns = [i for i, velocity in enumerate(kind.twist) if velocity.unit == 'rad/s']
            chosen = turns or list(range(len(kind.twist)))
            names = ' and '.join(kind.twist[i].name for i in chosen)
            units = (kind.twist[i].unit for i in chosen)
            vectors = partial(_columns, [kind], 'cmd_vel', chosen)
            yield f'Commanded {names}', _norm('ω' if turns else 'v', units), vectors
        if kind.own_rates:
            units = (f'{joint.unit}/s' for joint in kind.own_rates)
            vectors = partial(_columns, [kind], 'arm_rates', slice(None))
            yield f'Commanded rates, {kind.groups[-1].name}', _norm('ω', units), vectors


def _norm(symbol: str, units: Iterable[str]) -> str:
    """Return a norm with the units of the components, each once."""
    return f'<i>|{symbol}|</i> ({", ".join(dict.fromkeys(units))})'


def _columns(
    robots: Sequence[Mechanism], name: str, columns: slice | list[int], compared: Compared
) -> _Vectors | None:
    """Return columns of a series of a run; None if the run is not of one of the robots."""
    run = compared.run
    series: Series = getattr(run, name)
    is_known = run.mechanism in robots
    return (series.times - run.times[0], series.values[:, columns]) if is_known else None
