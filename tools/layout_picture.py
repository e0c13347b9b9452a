# SPDX-License-Identifier: Apache-2.0
"""A picture of what config/foxglove.json shows of a log, made without Foxglove.

`python tools/layout_picture.py RUN.mcap [--at SECONDS] [--layout FILE] [--output FILE]` draws
docs/images/foxglove_layout.png: every panel of the layout where the layout has it, with what
its topics and message paths find in the log. A topic or a field that the log does not have is
an error, and so is a panel or a setting that is not drawn here. Colours and fonts come close to
Foxglove's; toolbars are left out. The log must have been recorded, for /rosout is drawn too.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
import json
from pathlib import Path
import sys
from typing import Any

from layout_log import LayoutLog
from layout_panels import BOTTOM, Box, HEIGHT, Picture, TOP, WIDTH
from matplotlib.figure import Figure

from masmc_ros.errors import InputError

ROOT = Path(__file__).resolve().parent.parent
LAYOUT = ROOT / 'config' / 'foxglove.json'
PICTURE = ROOT / 'docs' / 'images' / 'foxglove_layout.png'


def panels(node: Any, box: Box) -> Iterator[tuple[str, Box]]:
    """Yield the panels of a layout's tree with where they are."""
    if isinstance(node, str):
        yield node, box
        return
    share = node['splitPercentage'] / 100.0
    if node['direction'] == 'row':
        first = box._replace(width=share * box.width)
        second = box._replace(left=box.left + first.width, width=box.width - first.width)
    else:
        first = box._replace(height=share * box.height)
        second = box._replace(top=box.top + first.height, height=box.height - first.height)
    yield from panels(node['first'], first)
    yield from panels(node['second'], second)


def draw(layout: Path, recorded: Path, at: float | None) -> tuple[Figure, dict[str, str]]:
    """Return the picture of a layout and a log, and what every panel shows.

    Args:
        layout: as exported by Foxglove.
        recorded: the log.
        at: time of playback in s; None is three quarters of the log.

    Raises:
        InputError: for what the layout names and the log does not have.
    """
    wanted = json.loads(layout.read_text(encoding='utf-8'))
    log = LayoutLog(recorded, wanted['userNodes'])
    picture = Picture(log, 0.75 * log.end if at is None else at)
    picture.frame(layout)
    whole = Box(0.0, TOP, WIDTH, HEIGHT - TOP - BOTTOM)
    configs = wanted['configById']
    shown = {
        name: picture.panel(name, configs[name], box)
        for name, box in panels(wanted['layout'], whole)
    }
    return picture.figure, shown


def main() -> int:
    """Draw the picture that the command line asks for."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition('\n')[0])
    parser.add_argument('log', type=Path, metavar='RUN.mcap')
    parser.add_argument('--at', type=float, metavar='SECONDS')
    parser.add_argument('--layout', type=Path, default=LAYOUT)
    parser.add_argument('--output', type=Path, default=PICTURE)
    options = parser.parse_args()
    try:
        figure, shown = draw(options.layout, options.log, options.at)
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    figure.savefig(options.output)
    for name, told in shown.items():
        print(f'{name}: {told}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
