# SPDX-License-Identifier: Apache-2.0
"""The panels of a Foxglove layout as matplotlib draws them."""

from __future__ import annotations

from collections.abc import Mapping
import json
from pathlib import Path
import textwrap
from typing import Any, NamedTuple

from layout_log import LayoutLog
from layout_scene import draw_scene
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from masmc_ros.errors import InputError
from masmc_ros.log.topics import PARAMETER_NODES, parameters_topic

WIDTH, HEIGHT = 1600.0, 1000.0
TOP, BOTTOM = 28.0, 30.0
"""Heights in pixels of the picture and of the bars above and below the panels."""

_DPI = 100
_TITLE, _GAP = 24.0, 3.0
_TEXT, _FAINT, _LINE = '#e1e1e4', '#a0a0a8', '#3c3c44'
_DARK, _PANEL, _BAR = '#0d0d10', '#15151a', '#27272f'
_LEVELS = {10: 'DEBUG', 20: 'INFO', 30: 'WARN', 40: 'ERROR', 50: 'FATAL'}
_LEVEL_COLOURS = {10: _FAINT, 20: '#66a3ff', 30: '#ffb240', 40: '#ff6060', 50: '#ff6060'}


class Box(NamedTuple):
    """A rectangle in pixels from the top left."""

    left: float
    top: float
    width: float
    height: float


class Picture:
    """Panels on a figure, of a log at a time of playback."""

    def __init__(self, log: LayoutLog, at: float) -> None:
        """Begin with an empty figure; `at` is in s."""
        self._log, self._at = log, at
        self.figure = Figure(figsize=(WIDTH / _DPI, HEIGHT / _DPI), dpi=_DPI, facecolor=_DARK)

    def axes(self, box: Box) -> Axes:
        """Return axes in pixels, from the top left, over a rectangle."""
        bottom = HEIGHT - box.top - box.height
        place = (box.left / WIDTH, bottom / HEIGHT, box.width / WIDTH, box.height / HEIGHT)
        axes = self.figure.add_axes(place)
        axes.set(xlim=(0.0, box.width), ylim=(box.height, 0.0), xticks=(), yticks=())
        axes.set_facecolor(_PANEL)
        for spine in axes.spines.values():
            spine.set_visible(False)
        return axes

    def panel(self, name: str, config: Mapping[str, Any], box: Box) -> str:
        """Draw a panel with its title; return what it shows."""
        kind = name.partition('!')[0]
        draw = {
            '3D': self._scene,
            'Plot': self._plot,
            'Parameters': self._parameters,
            'RawMessages': self._raw,
            'RosOut': self._rosout,
        }.get(kind)
        if draw is None:
            raise InputError(f'{name}: expected a type of panel that is drawn here, not {kind}')
        box = Box(box.left + _GAP / 2, box.top + _GAP / 2, box.width - _GAP, box.height - _GAP)
        bar = self.axes(box._replace(height=_TITLE))
        bar.set_facecolor(_BAR)
        _write(bar, 9.0, 0.5 * _TITLE, config['foxglovePanelTitle'], 9.0, weight='bold')
        body = Box(box.left, box.top + _TITLE, box.width, box.height - _TITLE)
        return draw(config, body)

    def frame(self, layout: Path) -> None:
        """Draw what is above and below the panels: what this is, and the time of playback."""
        bar = self.axes(Box(0.0, 0.0, WIDTH, TOP))
        bar.set_facecolor(_BAR)
        told = f'{layout.name}, with {self._log.path.name}, drawn by tools/layout_picture.py'
        _write(bar, 12.0, 0.5 * TOP, told, 9.5)
        bar = self.axes(Box(0.0, HEIGHT - BOTTOM, WIDTH, BOTTOM))
        bar.set_facecolor(_BAR)
        left, right, middle = 150.0, WIDTH - 90.0, 0.5 * BOTTOM
        now = left + (right - left) * self._at / self._log.end
        bar.add_patch(Rectangle((left, middle - 2.0), right - left, 4.0, color='#4a4a54'))
        bar.add_patch(Rectangle((left, middle - 2.0), now - left, 4.0, color='#7a5af8'))
        bar.add_patch(Rectangle((now - 1.5, middle - 8.0), 3.0, 16.0, color='#ffffff'))
        _write(bar, 12.0, middle, f'{self._at:.3f} s', 9.5, family='monospace')
        _write(bar, right + 12.0, middle, f'{self._log.end:.3f} s', 9.5, family='monospace')

    def _scene(self, config: Mapping[str, Any], box: Box) -> str:
        axes = self.axes(box)
        half = (0.5 * box.width, 0.5 * box.height)
        axes.set(xlim=(-half[0], half[0]), ylim=(-half[1], half[1]))
        return ', '.join(draw_scene(axes, config, box.height, self._log, self._at))

    def _plot(self, config: Mapping[str, Any], box: Box) -> str:
        self.axes(box)
        axes = self.axes(
            Box(box.left + 56.0, box.top + 10.0, box.width - 70.0, box.height - 48.0)
        )
        count = 0
        for series in config['paths']:
            if series['enabled']:
                x, y = self._series(config, series)
                count += len(y)
                style = '--' if series.get('lineStyle') == 'dashed' else '-'
                width = 0.72 * series['lineSize']
                axes.plot(x, y, style, lw=width, color=series['color'], label=series['label'])
        axes.yaxis.set_inverted(False)
        axes.autoscale()
        if config['xAxisVal'] == 'timestamp':
            axes.set_xlim(0.0, self._log.end)
            axes.axvline(self._at, color='#d0d0d8', lw=0.7)
        if 'minYValue' in config or 'maxYValue' in config:
            axes.set_ylim(config.get('minYValue'), config.get('maxYValue'))
        if config.get('axisScalesMode') == 'lockedScales':
            axes.set_aspect('equal', adjustable='datalim')
        axes.xaxis.set_major_locator(_ticks(box.width / 80.0))
        axes.yaxis.set_major_locator(_ticks(box.height / 34.0))
        axes.tick_params(colors=_FAINT, labelsize=7.5, length=0.0, pad=3.0)
        axes.grid(color=_LINE, lw=0.6)
        axes.set_xlabel(config.get('xAxisLabel', ''), color=_FAINT, fontsize=8.0, labelpad=1.0)
        axes.set_ylabel(config.get('yAxisLabel', ''), color=_FAINT, fontsize=8.0, labelpad=1.0)
        if config['showLegend']:
            axes.legend(
                loc='upper left',
                fontsize=7.5,
                labelcolor=_TEXT,
                facecolor=_BAR,
                edgecolor='none',
                framealpha=0.8,
                borderpad=0.3,
                borderaxespad=0.3,
                labelspacing=0.2,
                handlelength=1.2,
            )
        return f'{len(axes.lines)} lines, {count} points'

    def _series(
        self, config: Mapping[str, Any], series: Mapping[str, Any]
    ) -> tuple[list[float], list[float]]:
        """Return what a line of a plot goes through."""
        if config['xAxisVal'] == 'timestamp':
            return self._log.over_time(series['value'])
        across = series.get('xValuePath', config['xAxisPath']['value'])
        if config['xAxisVal'] == 'currentCustom':
            x = self._log.latest_values(across, self._at)
            return x, self._log.latest_values(series['value'], self._at)
        return self._log.over_time(across)[1], self._log.over_time(series['value'])[1]

    def _parameters(self, config: Mapping[str, Any], box: Box) -> str:
        """Show the table of a live connection: a log has no parameters but on topics."""
        values = {}
        for node in PARAMETER_NODES:
            message = self._log.latest(f'/{parameters_topic(node)}', self._at)
            for name, value in json.loads(message.data)['parameters'].items():
                values[f'/{node}.{name}'] = value
        rows = [(name, _shown(values[name])) for name in sorted(values)]
        axes, row = self.axes(box), 20.0
        split = 0.6 * box.width
        for line, (name, value) in enumerate([('Parameter', 'Value'), *rows]):
            y = (line + 0.5) * row
            if y > box.height - 0.5 * row:
                break
            colour = _TEXT if line else _FAINT
            _write(axes, 9.0, y, _cut(name, split - 9.0), 8.0, color=colour)
            _write(axes, split, y, _cut(value, box.width - split), 8.0, color=colour)
            axes.plot([0.0, box.width], [y + 0.5 * row] * 2, color=_LINE, lw=0.5)
        return f'{len(rows)} parameters'

    def _raw(self, config: Mapping[str, Any], box: Box) -> str:
        message = self._log.latest(config['topicPath'], self._at)
        axes, row, lines = self.axes(box), 16.0, [config['topicPath']]
        for name in getattr(message, '__slots__', None) or vars(message):
            value = getattr(message, name)
            if isinstance(value, list):
                lines.append(f'▾ {name}: {len(value)} items')
                lines += [f'      {index}: {entry:g}' for index, entry in enumerate(value)]
            else:
                lines.append(f'{name}: {_shown(value)}')
        for line, text in enumerate(lines):
            y = (line + 0.8) * row
            if y > box.height - 0.4 * row:
                break
            _write(axes, 9.0, y, _cut(text, box.width), 8.0, color=_TEXT if line else _FAINT)
        return f'{len(lines)} lines'

    def _rosout(self, config: Mapping[str, Any], box: Box) -> str:
        axes, row, y = self.axes(box), 15.0, 12.0
        times, messages = self._log.messages(config['topicToRender'])
        told = [m for t, m in zip(times, messages, strict=True) if t <= self._at]
        told = [m for m in told if m.level >= 10 * config['minLogLevel']]
        for message in told:
            stamp = message.stamp.sec + 1e-9 * message.stamp.nanosec
            text = f'[{_LEVELS[message.level]}] [{stamp:.3f}] [{message.name}]: {message.msg}'
            for line in textwrap.wrap(text, int(box.width / 6.0), subsequent_indent='    '):
                if y < box.height:
                    colour = _LEVEL_COLOURS[message.level]
                    _write(axes, 9.0, y, line, 7.5, color=colour, family='monospace')
                y += row
        return f'{len(told)} messages'


def _ticks(most: float) -> MaxNLocator:
    return MaxNLocator(max(2, int(most)))


def _write(axes: Axes, x: float, y: float, text: str, size: float, **more: Any) -> None:
    more = {'color': _TEXT, 'va': 'center', 'clip_on': True, 'parse_math': False, **more}
    axes.text(x, y, text, fontsize=size, **more)


def _cut(text: str, width: float) -> str:
    """Return what of a text has room in so many pixels."""
    most = int(width / 6.1)
    return text if len(text) <= most else text[: most - 1] + '…'


def _shown(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_shown, value))}]"
    return value if isinstance(value, str) else json.dumps(value).removesuffix('.0')
