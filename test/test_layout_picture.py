# SPDX-License-Identifier: Apache-2.0
"""The picture of the Foxglove layout has every panel, drawn of what a run recorded."""

from __future__ import annotations

from collections.abc import Mapping
import json
from pathlib import Path
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy')

from matplotlib.image import imread
from processes import processes, ros_arguments, shortened
from viewed_run import ROOT

LAYOUT = ROOT / 'config' / 'foxglove.json'
TOOL = ROOT / 'tools' / 'layout_picture.py'
PICTURE = ROOT / 'docs' / 'images' / 'foxglove_layout.png'


@pytest.fixture(scope='module')
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the log of four nodes that ran for a second."""
    folder = tmp_path_factory.mktemp('recorded')
    log = folder / 'run.mcap'
    with processes(folder) as started:
        wait_for = '[controller,trajectory,recorder]'
        started.start_all(
            *ros_arguments(
                shortened(folder, 1.0), plant__wait_for=wait_for, recorder__output=log
            )
        )
        assert set(started.wait().values()) == {0}, started.output()
    return log


def drawn(log: Path, layout: Path, output: Path) -> subprocess.CompletedProcess[str]:
    """Run the tool as one does by hand."""
    return subprocess.run(
        [sys.executable, str(TOOL), str(log), '--layout', str(layout), '--output', str(output)],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={'PYTHONPATH': str(ROOT), 'PATH': ''},
        timeout=120.0,
    )


def changed(folder: Path, panel: str, **settings: Any) -> Path:
    """Write a copy of the layout with other settings of a panel; return the copy."""
    layout = json.loads(LAYOUT.read_text(encoding='utf-8'))
    layout['configById'][panel].update(settings)
    path = folder / 'layout.json'
    path.write_text(json.dumps(layout), encoding='utf-8')
    return path


def place(node: Any, panel: str, box: tuple[float, ...]) -> tuple[float, ...] | None:
    """Return left, right, top, bottom of a panel as shares of what the tree fills."""
    if isinstance(node, str):
        return box if node == panel else None
    left, right, top, bottom = box
    share = node['splitPercentage'] / 100.0
    if node['direction'] == 'row':
        cut = left + share * (right - left)
        parts = ((left, cut, top, bottom), (cut, right, top, bottom))
    else:
        cut = top + share * (bottom - top)
        parts = ((left, right, top, cut), (left, right, cut, bottom))
    return place(node['first'], panel, parts[0]) or place(node['second'], panel, parts[1])


def colours(picture: np.ndarray, layout: Mapping[str, Any], panel: str) -> set[tuple[int, ...]]:
    """Return the colours in the middle of a panel."""
    box = place(layout['layout'], panel, (0.0, 1.0, 0.0, 1.0))
    assert box is not None
    height, width = picture.shape[:2]
    # Above and below the panels are bars of about 30 pixels of 1000.
    rows = [int(height * (0.03 + 0.94 * y)) for y in box[2:]]
    columns = [int(width * x) for x in box[:2]]
    inside = picture[rows[0] + 40 : rows[1] - 8, columns[0] + 8 : columns[1] - 8, :3]
    return {tuple(each) for each in (255.0 * inside).round().astype(int).reshape(-1, 3)}


def test_every_panel_is_drawn_where_the_layout_has_it(recorded: Path, tmp_path: Path) -> None:
    layout = json.loads(LAYOUT.read_text(encoding='utf-8'))
    result = drawn(recorded, LAYOUT, tmp_path / 'picture.png')
    assert result.returncode == 0, result.stderr
    told = dict(line.split(': ', 1) for line in result.stdout.splitlines())
    assert set(told) == set(layout['configById'])
    picture = imread(tmp_path / 'picture.png')
    assert picture.shape[:2] == (1000, 1600)
    for panel, config in layout['configById'].items():
        found = colours(picture, layout, panel)
        assert len(found) > 10, panel
        for series in config.get('paths', []):
            code = series['color'].lstrip('#')
            exact = np.array([int(code[i : i + 2], 16) for i in (0, 2, 4)])
            nearest = min(np.abs(np.array(each) - exact).max() for each in found)
            assert nearest < 64, f'{panel}: no line in {series["color"]}'


def test_a_plot_has_every_message(recorded: Path, tmp_path: Path) -> None:
    told = drawn(recorded, LAYOUT, tmp_path / 'picture.png').stdout
    # Four axes, 1001 ticks, and the line of the time of playback.
    assert 'Plot!error: 5 lines, 4004 points\n' in told


@pytest.mark.parametrize(
    ('panel', 'settings', 'named'),
    [
        ('RawMessages!state', {'topicPath': '/elsewhere'}, '/elsewhere'),
        ('RosOut!log', {'topicToRender': '/log'}, '/log'),
        ('3D!scene', {'topics': {'/elsewhere': {'visible': True}}}, '/elsewhere'),
    ],
)
def test_a_topic_that_the_log_does_not_have_is_an_error(
    recorded: Path, tmp_path: Path, panel: str, settings: dict[str, Any], named: str
) -> None:
    output = tmp_path / 'picture.png'
    result = drawn(recorded, changed(tmp_path, panel, **settings), output)
    assert result.returncode == 2
    assert result.stderr.startswith(f'{named}: expected messages of this topic in ')
    assert not output.exists()


@pytest.mark.parametrize(
    ('value', 'fault'),
    [
        ('/elsewhere.data[2]', 'expected messages of this topic'),
        ('/controller/tracking_error.data[6]', 'expected such a field'),
        ('/controller/tracking_error.dato[2]', 'expected such a field'),
    ],
)
def test_a_value_that_the_log_does_not_have_is_an_error(
    recorded: Path, tmp_path: Path, value: str, fault: str
) -> None:
    paths = json.loads(LAYOUT.read_text(encoding='utf-8'))['configById']['Plot!error']['paths']
    paths[1]['value'] = value
    result = drawn(recorded, changed(tmp_path, 'Plot!error', paths=paths), tmp_path / 'x.png')
    assert result.returncode == 2
    assert fault in result.stderr
    assert result.stderr.count('\n') == 1


def test_the_picture_of_the_documentation_is_small() -> None:
    assert imread(PICTURE).shape[:2] == (1000, 1600)
    assert PICTURE.stat().st_size < 300_000
