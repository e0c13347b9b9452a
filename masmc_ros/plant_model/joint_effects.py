# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Selection of the effects of motors and joints when the plant is compiled.

Effects are the lag of motors, stiction and elastic joints. A plant without effects has separate
compiled code, because the branches of the full code take a seventh of the time of a run. Without
effects, both codes give bitwise identical results. Robots from a URDF always have the full code:
their ticks take much longer than the branches.
"""

from __future__ import annotations

from types import SimpleNamespace

from masmc_ros.aliases import Record
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.dispatch import by_tag, interface
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.record import lane_count

OFF, ON = '', 'effects'
"""Tags of records without and with effects."""


@formula
def _loses_in_a_lane(plant: Record) -> bool:
    lanes = 0
    for lane in range(lane_count(plant)):
        lanes += lane_of(plant, lane).has_losses
    return lanes > 0


@formula
def _twists_in_a_lane(plant: Record) -> bool:
    lanes = 0
    for lane in range(lane_count(plant)):
        lanes += lane_of(plant, lane).is_elastic
    return lanes > 0


_EFFECTS = {
    OFF: SimpleNamespace(),
    ON: SimpleNamespace(has_losses=_loses_in_a_lane, is_elastic=_twists_in_a_lane),
}
"""Formulas by the tag `effects` of the settings of a plant; those of OFF are the bodies below."""

_dispatch = interface(by_tag('effects', _EFFECTS.__getitem__), formula)


@_dispatch
def has_losses(plant: Record) -> bool:
    """Return True if motors lag or joints stick in any lane."""
    return False


@_dispatch
def is_elastic(plant: Record) -> bool:
    """Return True if a joint is elastic in any lane."""
    return False
