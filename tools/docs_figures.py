# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Figures of the documentation site: `python tools/docs_figures.py FOLDER`.

A file of HTML for each law, with its errors and torques in the paper's experiment, and one with
the animation of the first page. Colours are those of the page, which may be dark.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
import csv
import json
import math
from pathlib import Path
import sys

import masmc_ros as masmc
from masmc_ros.aliases import Array
from masmc_ros.api.simulate import SimulatedRun
from masmc_ros.law import registry
from masmc_ros.robot.mechanisms import DEFAULT
import numpy as np

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / 'docs' / 'reference' / 'laws' / 'comparison.csv'
ANIMATION = Path(__file__).with_name('docs_animation.html')

WIDTH, LEFT, RIGHT = 720, 74, 18
"""Width of a figure, and of its margins, in pixels of its view box."""

HEIGHT, GAP, TOP = 120, 34, 14
"""Height of a plot, distance between two plots, and space above the first."""

POINTS = 300
"""Number of ranges of samples of a line, each with its minimum and maximum."""

CONDITIONS = {
    ('conditions', 'as it is'): 'the paper’s robot',
    ('conditions', 'true model'): 'the true model',
    ('conditions', 'noise'): 'noise',
    ('conditions', 'delay'): 'a delay',
    ('robots', 'as it is'): '1000 robots behind limits of the torques',
    ('fast drives', 'as it is'): 'fast drives',
}
"""Rows of the comparison, and their names in the caption."""

LAWS, RATIOS, FRAMES = ('smc', 'rasmc'), (1, 2, 3), 120
"""Laws of the animation, ratios of true to assumed masses, and number of its instants."""

POSE = [0, 1, 2, 5, 6]
"""Pose of the platform and angles of the arm, in the order of joint_states."""

END = DEFAULT.points[0]


def law_figure(name: str, compared: SimulatedRun) -> str:
    """Return the figure of a law; the errors of another run are drawn for comparison."""
    run = masmc.simulate('paper', law=name)
    logs = [np.log10(np.maximum(distances(shown), 0.01)) for shown in (compared, run)]
    low, high = math.floor(min(log[1000:].min() for log in logs)), 3
    end = run.times[-1]
    parts = [
        *frame(0, end, 'error (mm)', [(k, f'{10.0**k:g}') for k in range(low, high + 1)]),
        *(polyline(0, run.times, log, (0.0, end), (low, high), style)
          for log, style in zip(logs, ('other', 'tone0'), strict=True)),
    ]  # fmt: skip
    largest = float(np.percentile(np.abs(run.torque), 99.5)) * 1.1
    ticks = [(y, f'{y:.3g}') for y in (-step(largest), 0.0, step(largest))]
    parts += frame(1, end, 'torque (N·m)', ticks, (-largest, largest), has_times=True)
    parts += [
        polyline(1, run.times, column, (0.0, end), (-largest, largest), f'tone{joint}')
        for joint, column in enumerate(run.torque.T)
    ]
    rms = [f'{point.symbol} {1e3 * (run.metrics.points[point].rms or math.nan):.3g} mm'
           for point in run.metrics.points]  # fmt: skip
    joints = ('right wheel', 'left wheel', 'arm joint 1', 'arm joint 2')
    keys = ', '.join(f'<span class="tone{i}">{joint}</span>' for i, joint in enumerate(joints))
    height = TOP + 2 * (HEIGHT + GAP) - TOP // 2
    return (
        '<figure class="law-figure">'
        f'<svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="Errors and torques of'
        f' {name} over 20 s">{"".join(parts)}</svg>'
        '<figcaption>The paper’s experiment, with half of the masses in the model. Above: error'
        f' of the end effector, <span class="tone0">{name}</span> and'
        ' <span class="other">smc, tanh</span>;'
        f' RMS from 10 s on {", ".join(rms)}. Below: torques of {keys}; variation'
        f' {run.metrics.torque_variation:.4g} N·m/s. {ranks(name)}</figcaption></figure>\n'
    )


def ranks(name: str) -> str:
    """Return the ranks of a law in the comparison by their lost runs and errors."""
    with RESULTS.open(encoding='utf-8') as stream:
        rows = list(csv.DictReader(stream))
    own = 'nonlinear_feedback' if name == 'input_output_decoupling' else name
    texts, count = [], 0
    for (part, trial), title in CONDITIONS.items():
        within = [row for row in rows if (row['part'], row['trial']) == (part, trial)]
        count = len(within)
        within.sort(key=lambda row: (int(row['lost']) * 2 > int(row['runs']),
                                     float(row['error'] or math.inf)))  # fmt: skip
        place, row = next((i, row) for i, row in enumerate(within, 1) if row['law'] == own)
        is_lost = int(row['lost']) * 2 > int(row['runs'])
        texts.append(f'{title} {"lost" if is_lost else place}')
    return (
        f'Rank by error among {count} laws and switching terms with a disturbance estimate,'
        f' with its better switching term: {", ".join(texts)}.'
    )


def step(largest: float) -> float:
    """Return a round number below the end of an axis."""
    power = 10.0 ** math.floor(math.log10(largest))
    return max(factor * power for factor in (1.0, 2.0, 5.0) if factor * power <= largest)


def distances(run: SimulatedRun) -> Array:
    """Return the distances (n) of the end effector from its reference in mm."""
    return 1e3 * np.linalg.norm(run.error[:, :2], axis=1)


def polyline(
    place: int, x: Array, y: Array, across: tuple[float, float], up: Sequence[float], style: str
) -> str:
    """Return a line of a plot, with the minimum and maximum of each range of samples."""
    size = max(1, len(x) // POINTS)
    starts = np.arange(0, len(x), size)
    limited = np.clip(y, up[0], up[1])
    ends = np.minimum.reduceat(limited, starts), np.maximum.reduceat(limited, starts)
    # The order of the two follows the line.
    is_rising = limited[np.minimum(starts + size - 1, len(x) - 1)] >= limited[starts]
    first, second = np.where(is_rising, ends, ends[::-1])
    values = np.stack((first, second), axis=1).ravel()
    middles = np.minimum(starts + size // 2, len(x) - 1)
    times = x[np.stack((starts, middles), axis=1).ravel()]
    left = LEFT + (WIDTH - LEFT - RIGHT) * (times - across[0]) / (across[1] - across[0])
    top = place * (HEIGHT + GAP) + TOP + HEIGHT * (up[1] - values) / (up[1] - up[0])
    points = ' '.join(f'{a:.1f},{b:.1f}' for a, b in zip(left, top, strict=True))
    return f'<polyline class="{style}" points="{points}"/>'


def frame(
    place: int, end: float, title: str, ticks: Sequence[tuple[float, str]],
    up: tuple[float, float] | None = None, *, has_times: bool = False,
) -> Iterable[str]:  # fmt: skip
    """Yield the grid and the labels of a plot."""
    low, high = up or (ticks[0][0], ticks[-1][0])
    top = place * (HEIGHT + GAP) + TOP
    for value, text in ticks:
        y = top + HEIGHT * (high - value) / (high - low)
        yield f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'
        yield f'<text x="{LEFT - 5}" y="{y + 4:.1f}" text-anchor="end">{text}</text>'
    middle = top + HEIGHT / 2
    turned = f'translate(16 {middle}) rotate(-90)'
    yield f'<text transform="{turned}" text-anchor="middle">{title}</text>'
    for time in range(0, round(end) + 1, 5):
        x = LEFT + (WIDTH - LEFT - RIGHT) * time / end
        yield f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{top}" y2="{top + HEIGHT}"/>'
        if has_times:
            anchor = 'middle' if time < end else 'end'
            y = top + HEIGHT + 18
            yield f'<text x="{x:.1f}" y="{y}" text-anchor="{anchor}">{time} s</text>'


def animation() -> str:
    """Return the animation of `smc` and `rasmc`, for several ratios of true to assumed masses."""
    runs = {
        ratio: {law: masmc.simulate('paper', law=law, model_scale=1.0 / ratio) for law in LAWS}
        for ratio in RATIOS
    }
    run = runs[RATIOS[0]][LAWS[0]]
    places = np.linspace(0, len(run.times) - 1, FRAMES).round().astype(int)
    plant = run.scenario.values['plant']
    names = 'wheel_radius', 'half_track', 'link_1_length', 'link_2_length'
    arm_base = float(plant['robot.com_offset']) + float(plant['robot.arm_offset'])
    data = {
        'times': np.round(run.times[places], 2).tolist(),
        'path': np.round(run.reference[places, :2], 3).tolist(),
        'lengths': {'arm_base': arm_base, **{n: float(plant[f'robot.{n}']) for n in names}},
        'ratios': RATIOS,
        'runs': [
            {
                law: {
                    'poses': np.round(one.true_position[places][:, POSE], 3).tolist(),
                    'errors': np.round(distances(one)[places], 1).tolist(),
                    'rms': f'{1e3 * (one.metrics.points[END].rms or math.nan):.3g}',
                }
                for law, one in of_ratio.items()
            }
            for of_ratio in runs.values()
        ],
    }
    text = ANIMATION.read_text(encoding='utf-8')
    text = text[text.index('-->') + 3:].strip()
    return text.replace('@DATA@', json.dumps(data, separators=(',', ':'))) + '\n'


def main(folder: Path) -> None:
    """Write all figures."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / 'animation.html').write_text(animation(), encoding='utf-8')
    compared = masmc.simulate('paper', law='smc')
    for name in registry.LAWS:
        (folder / f'{name}.html').write_text(law_figure(name, compared), encoding='utf-8')


if __name__ == '__main__':
    main(Path(sys.argv[1]))
