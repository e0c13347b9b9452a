# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Panels of the figures and of the page: titles, axes with units, and lines.

Texts are HTML of plotly, with symbols in italics; `style.mathtext` converts them for matplotlib.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from html import escape
from typing import NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.log.read.decode import Series
from masmc_ros.log.read.reader import Run
from masmc_ros.report.measure.adaptation import Adaptation
from masmc_ros.report.measure.table import DIGITS, number
from masmc_ros.report.measure.tracking import Compared, Tracking
from masmc_ros.robot.declaration import Point, Quantity
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

_ERRORS, _TORQUES, _VELOCITIES = 'errors', 'torques', 'velocities'
"""Kinds of panels of a comparison."""

_Subject = tuple[str, str, str, _Vectors | None]
"""Kind, title, quantity, and vectors of a run, None if it has none."""


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


def distance_panels(compared: Compared, ranges: int) -> list[Panel]:
    """
    Return the distances of the points of a run from their references, and norms of its torques.

    The torques are those of each group of joints. A run without torques has the commanded
    velocities. Each panel has one line, of at most `ranges` ranges of samples.
    """
    panels = []
    for kind, title, quantity, vectors in _subjects(compared):
        times, values = vectors or (np.zeros(0), np.zeros((0, 1)))
        x, y = _thinned(times, np.linalg.norm(values, axis=1), ranges)
        panels.append(Panel(kind, title, quantity, [Line('', x, y, INK)]))
    return panels


def comparison_panels(of_runs: Sequence[tuple[str, Sequence[Panel]]]) -> list[Panel]:
    """
    Return the distances of all points from their references, and the norms of the torques.

    If no run has torques, the panels have the commanded velocities. Each panel has a line for
    each run, which is empty without data.

    Parameters
    ----------
    of_runs
        Name and `distance_panels` of each run.

    """
    panels = [panel for _, of_run in of_runs for panel in of_run]
    has_torques = any(panel.name == _TORQUES for panel in panels)
    shown = [panel for panel in panels if not (has_torques and panel.name == _VELOCITIES)]
    merged = []
    titles = dict.fromkeys(p.title for p in sorted(shown, key=lambda p: p.name != _ERRORS))
    for place, title in enumerate(titles):
        drawn = []
        for i, (label, of_run) in enumerate(of_runs):
            own = [panel.lines[0] for panel in of_run if panel.title == title]
            x, y = (own[0].x, own[0].y) if own else (np.zeros(0), np.zeros(0))
            drawn.append(Line(escape(label), x, y, *_style(i)))
        # Robots of other kinds may have further units.
        quantity = max((panel.quantity for panel in shown if panel.title == title), key=len)
        merged.append(Panel(f'comparison_{place}', title, quantity, drawn))
    return merged


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


def _subjects(compared: Compared) -> Iterator[_Subject]:
    """Yield the subjects of the comparison for a run."""
    run, kind = compared.run, compared.run.mechanism
    for point in kind.points:
        quantity = f'<i>|e<sub>{point.symbol}</sub>|</i> ({point.small_unit})'
        yield _ERRORS, f'Tracking error of {point.title}', quantity, compared.errors(point)
    if not run.commands_rates:
        for group in kind.groups:
            efforts = (joint.effort_unit for joint in kind.joints[group.joints])
            vectors = _columns(run, run.torque, group.joints)
            yield _TORQUES, f'Commanded torques, {group.name}', _norm('τ', efforts), vectors
        return
    if kind.twist:
        turns = [i for i, velocity in enumerate(kind.twist) if velocity.unit == 'rad/s']
        chosen = turns or list(range(len(kind.twist)))
        names = ' and '.join(kind.twist[i].name for i in chosen)
        quantity = _norm('ω' if turns else 'v', (kind.twist[i].unit for i in chosen))
        yield _VELOCITIES, f'Commanded {names}', quantity, _columns(run, run.cmd_vel, chosen)
    if kind.own_rates:
        quantity = _norm('ω', (f'{joint.unit}/s' for joint in kind.own_rates))
        vectors = _columns(run, run.arm_rates, slice(None))
        yield _VELOCITIES, f'Commanded rates, {kind.groups[-1].name}', quantity, vectors


def _thinned(x: Array, y: Array, ranges: int) -> tuple[Array, Array]:
    """Return samples, of many the minimum and maximum of each of some ranges."""
    if len(x) <= 2 * ranges:
        return x, y
    size = -(-len(x) // ranges)
    starts = np.arange(0, len(x), size)
    middles = np.minimum(starts + size // 2, len(x) - 1)
    ends = np.fmin.reduceat(y, starts), np.fmax.reduceat(y, starts)
    return np.stack((x[starts], x[middles]), axis=1).ravel(), np.stack(ends, axis=1).ravel()


def _norm(symbol: str, units: Iterable[str]) -> str:
    """Return a norm with the units of the components, each once."""
    return f'<i>|{symbol}|</i> ({", ".join(dict.fromkeys(units))})'


def _columns(run: Run, series: Series, columns: slice | list[int]) -> _Vectors:
    """Return columns of a series of a run."""
    return series.times - run.times[0], series.values[:, columns]
