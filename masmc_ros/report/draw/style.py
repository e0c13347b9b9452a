# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Style of the figures: sizes, fonts and colours of a journal page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from html import unescape
import io
import math
from typing import Any
import warnings

from masmc_ros.report.panels import COLOURS, Line
import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

COLUMN = 88.0
"""Width of one column of a page in mm."""

PAGE = 180.0
"""Width of both columns in mm."""

DPI = 300

# Okabe and Ito's yellow is too faint on white.
BLACK = '#000000'
BLUE = '#0072B2'
ORANGE = '#E69F00'
GREEN = '#009E73'
VERMILLION = '#D55E00'
PURPLE = '#CC79A7'
SKY = '#56B4E9'
GREY = '#8C8C8C'

_TONES = dict(zip(COLOURS, (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK), strict=True))
_DASHES: dict[str, Any] = {
    'solid': '-',
    'dash': (0, (5, 1.5)),
    'dashdot': (0, (5, 1.2, 1.2, 1.2)),
    'dot': (0, (1.2, 1.2)),
    'longdash': (0, (10, 2)),
    'longdashdot': (0, (10, 1.5, 1.5, 1.5)),
}
"""Lengths of dashes and gaps in widths of the line; the gaps are short, for oscillating lines."""

FORMATS = 'png', 'pdf', 'svg'
"""Formats of figures, which are the suffixes of their files."""

_METADATA: dict[str, Any] = {
    'png': {'Software': None},
    'pdf': {'CreationDate': None},
    'svg': {'Date': None},
}
"""Metadata by format, without times and versions."""

_MILLIMETRES_PER_INCH = 25.4
_GAP = 10.0
"""Space in pixels, at 100 per inch, after a title."""
_NEXT_LINE = 16.0
"""Distance in points from the axes to a title above a row of the legend."""
_LEGEND = 8
"""Maximum number of lines in a row of the legend."""
_STYLE: Any = {  # the type of its keys differs between versions of matplotlib
    'font.size': 8.0,
    'axes.titlesize': 8.0,
    'axes.labelsize': 8.0,
    'xtick.labelsize': 7.0,
    'ytick.labelsize': 7.0,
    'legend.fontsize': 7.5,
    'legend.frameon': False,
    'legend.borderaxespad': 0.0,
    'legend.borderpad': 0.0,
    'legend.handlelength': 1.8,
    'legend.columnspacing': 1.4,
    'axes.titlelocation': 'left',
    'axes.titlepad': 4.0,
    'axes.grid': True,
    'axes.axisbelow': True,
    'axes.linewidth': 0.6,
    'axes.xmargin': 0.0,
    'grid.color': '#D9D9D9',
    'grid.linewidth': 0.4,
    'xtick.major.width': 0.6,
    'ytick.major.width': 0.6,
    'ytick.minor.width': 0.4,
    'xtick.major.size': 2.5,
    'ytick.major.size': 2.5,
    'ytick.minor.size': 1.5,
    'lines.linewidth': 1.0,
    'path.simplify': True,
    'agg.path.chunksize': 10_000,
    'figure.constrained_layout.use': True,
    'savefig.facecolor': 'white',
    'svg.hashsalt': 'masmc_ros',  # identifiers are random otherwise
    'pdf.fonttype': 42,  # journals reject fonts of type 3
}


@contextmanager
def paper_style() -> Iterator[None]:
    """Draw and save figures in the style of this package, independent of the user's settings."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        with matplotlib.rc_context(_STYLE), warnings.catch_warnings():
            # A letter that the font lacks, such as a Chinese one, is drawn as a box.
            warnings.filterwarnings('ignore', 'Glyph', UserWarning)
            yield


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size in mm."""
    figure = Figure(figsize=(width / _MILLIMETRES_PER_INCH, height / _MILLIMETRES_PER_INCH))
    FigureCanvasAgg(figure)
    return figure


def figure_file(figure: Figure, file_format: str = 'png') -> bytes:
    """Return a figure as a file of one of FORMATS, identical for identical figures."""
    out = io.BytesIO()
    figure.savefig(out, format=file_format, dpi=DPI, metadata=_METADATA[file_format])
    return out.getvalue()


def draw_line(axes: Axes, line: Line, **style: Any) -> Line2D:
    """Draw a line of a panel; `style` are further properties of matplotlib."""
    (line_2d,) = axes.plot(
        line.x, line.y, color=_TONES[line.colour], ls=_DASHES[line.dash], **style
    )
    # Set afterwards: matplotlib skips a label that starts with an underscore.
    line_2d.set_label(mathtext(line.name))
    return line_2d


def caption(figure: Figure, axes: Axes, label: str, handles: Sequence[Line2D]) -> None:
    """
    Put a title at the upper left and a legend at the upper right, above the axes.

    A label that is too long is put above the legend, with a smaller font if necessary.
    """
    rows = math.ceil(len(handles) / _LEGEND)
    legend = axes.legend(
        handles=handles, loc='lower right', bbox_to_anchor=(1.0, 1.02),
        ncols=math.ceil(len(handles) / max(rows, 1)),
    )  # fmt: skip
    title = axes.set_title(plain(label))
    figure.draw_without_rendering()
    extent = title.get_window_extent()
    if extent.x1 > legend.get_window_extent().x0 - _GAP:
        room = (figure.bbox.x1 - _GAP - extent.x0) / extent.width
        size = title.get_fontsize() * min(1.0, room)
        axes.set_title(plain(label), pad=_NEXT_LINE * max(rows, 1), fontsize=size)


def time_axis(axes: Axes, intervals: int = 10) -> None:
    """Label an axis of time in s, with ticks at whole seconds if possible."""
    axes.set_xlabel('time $t$ (s)')
    axes.xaxis.set_major_locator(MaxNLocator(intervals, steps=[1, 2, 5, 10]))


def plain(text: str) -> str:
    """Return text without mathematics, such as a file name with dollar signs."""
    return text.replace('$', r'\$')


def mathtext(html: str) -> str:
    """Return a text of a panel, HTML with symbols in italics, for matplotlib."""
    text = plain(html)
    for tag, mark in (('<i>', '$'), ('</i>', '$'), ('<sub>', '_{'), ('</sub>', '}')):
        text = text.replace(tag, mark)
    return unescape(text)
