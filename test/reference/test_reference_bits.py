# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Waypoints and closed curves: bitwise identical samples on all machines and interpreted."""

from __future__ import annotations

import hashlib
import subprocess
import sys

from helpers.child_environment import child_environment
from masmc_ros.reference.arc import Arc
from masmc_ros.reference.figure_eight import FigureEight
from masmc_ros.reference.rounded_polygon import RoundedPolygon
from masmc_ros.reference.waypoints import Waypoints
import numpy as np
import pytest

RECORDED = {
    'waypoints': '521cd8feccb48a18ae288482081eb02c1bd9fbb4afb9cc558036db4e2373ffcf',
    'stops': '821d0bbc0ecabeab48ae601f8d1c6206c82586789b43e012cb7a82e3bdd5da19',
    'arc': 'f3795fdd3ab319392cb1176bc9057b2c05234ac4f0dc154ab460202b6da95538',
    'figure_eight': 'b152f9b814437c3c8a29813f60492a0c79967d3b90608840cf9cce9916297fd9',
    'rounded_polygon': 'b6e3ba88421ae38f1c783a7bacebb18ce5b7bfa295230d69d9d613e6fbe792ee',
}
"""Digests that every machine must produce."""


def digest(name: str) -> str:
    """Return the digest of samples over and beyond a trajectory."""
    at = np.arange(-100.0, 2000.0) * 0.005
    if name == 'arc':
        arc = Arc({
            'start': (0.6, 0.3, 0.8, 1.8, 1.1, 1.1), 'centre': (0.75, 0.35, 0.8),
            'normal': (1.0, -0.3, 0.7), 'angle': 8.0, 'delay': 0.3, 'duration': 7.7,
        })  # fmt: skip
        return hashlib.sha256(arc.sample(at).tobytes()).hexdigest()
    schedule = {'laps': 2, 'delay': 0.3, 'duration': 8.7}
    if name == 'figure_eight':
        eight = FigureEight({
            'start': (0.6, 0.3, 0.8), 'along': (0.2, 0.1, -0.1), 'across': (0.0, 0.07, 0.3),
            **schedule,
        })  # fmt: skip
        return hashlib.sha256(eight.sample(at).tobytes()).hexdigest()
    if name == 'rounded_polygon':
        corners = np.array([[0.6, 0.3, 0.8], [1.0, 0.5, 0.7], [0.7, 1.1, 0.9], [0.2, 0.4, 0.3]])
        polygon = RoundedPolygon({'corners': corners, 'rounding': 0.3, **schedule})
        return hashlib.sha256(polygon.sample(at).tobytes()).hexdigest()
    times = np.array([0.1, 0.35, 2.0, 3.3, 7.2, 9.0])
    points = (np.arange(36.0) * 7.0 % 5.0 - 2.0) / 3.0
    way = Waypoints({'times': times, 'points': points, 'stops': name == 'stops'})
    return hashlib.sha256(way.sample(at).tobytes()).hexdigest()


@pytest.mark.parametrize('name', RECORDED)
def test_reference_on_this_machine_equals_recorded_digest(name: str) -> None:
    assert digest(name) == RECORDED[name]


def test_reference_interpreted_equals_recorded_digests() -> None:
    environment = {**child_environment(), 'NUMBA_DISABLE_JIT': '1'}
    output = subprocess.run(
        [sys.executable, __file__],
        env=environment, check=True, timeout=300.0, capture_output=True, text=True,
    ).stdout  # fmt: skip
    assert output.split() == list(RECORDED.values())


if __name__ == '__main__':
    print(*map(digest, RECORDED))
