# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Short campaign for tests, and the comparison of rows."""

from __future__ import annotations

from pathlib import Path

from masmc_ros.campaign.campaign import Campaign, campaign_of
from masmc_ros.campaign.variable import draw
import numpy as np

PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')

DRAWS = (
    'plant.robot.link_2_mass=uniform:0.6:1.4',
    'plant.disturbance.phase[2]=uniform:0:6.28',
    'controller.k_s1=loguniform:50:3000',
)

SETTINGS = ('duration=0.2', 'plant.velocity_noise=0.02', 'controller.switching=implicit')


def campaign_with(repeats: int = 70, *settings: str, sobol: bool = False) -> Campaign:
    """Return the campaign with a number of runs and further settings."""
    return campaign_of(
        PAPER,
        (*SETTINGS, *settings),
        draws=[draw(text) for text in DRAWS],
        repeats=repeats,
        sobol=sobol,
    )


def assert_equal(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> None:
    """Raise AssertionError for columns that differ in a bit."""
    assert list(one) == list(other)
    for name, values in one.items():
        np.testing.assert_array_equal(values, other[name], err_msg=name)
