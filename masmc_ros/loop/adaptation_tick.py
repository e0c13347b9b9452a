# SPDX-License-Identifier: Apache-2.0
"""One tick of the adaptation: from the gradient to the next theta_hat in force."""

from __future__ import annotations

from typing import Any

from masmc_ros.compiled import formula, kernel
from masmc_ros.control.adaptation import (
    beyond_dead_zone,
    clip_to_box,
    move_into_half_space,
    norm,
)
from masmc_ros.control.laws.update import updated_estimate
from masmc_ros.loop.arrays import as_geometry
from masmc_ros.robot import AXES, BASE_PARAMETERS
from masmc_ros.robot.consistency import weakest_motion, write_normal
from masmc_ros.robot.dynamics import BaseParameters

_CUTS = 200
_HALVINGS = 60

MARGIN = 0.5
"""Projection keeps H(theta_hat) above this part of `projection.lower` times the nominal H."""


@formula
def adapt(
    settings: Any, surface: Any, saturated: bool, gradient: Any, normal: Any, estimate: Any
) -> None:
    """Move theta_hat (7) on by one tick; `normal` (7) is workspace."""
    share, distance = 1.0, 0.0
    rate = settings['leakage']
    if settings['dead_zone'] > 0.0 or settings['e_modification'] > 0.0:
        distance = norm(AXES, surface)
        share = beyond_dead_zone(distance, settings['dead_zone'])
    if settings['freeze_when_saturated'] and saturated:
        share = 0.0
    if settings['e_modification'] > 0.0:
        rate += settings['e_modification'] * share * distance
    for j in range(BASE_PARAMETERS):
        estimate[j] = updated_estimate(
            settings['law'],
            estimate[j],
            settings['nominal'][j],
            share * gradient[j],
            settings['gamma'][j],
            settings['period'],
            rate,
        )
    if settings['projection_lower'] > 0.0:
        project(settings, normal, estimate)


@kernel
def project(settings: Any, normal: Any, estimate: Any) -> None:
    """Move theta_hat (7) into the box, and to where bodies can have it; see docs/adaptation.md.

    Every cut is the projection onto a half-space that holds every robot whose bodies are
    all above `projection.lower`, so that none takes theta_hat farther from the theta of such
    a one. In the rare case that many cuts do not suffice, the way to the nominal model,
    which is inside, is halved until they do.
    """
    geometry = as_geometry(settings['geometry'])
    nominal, lower = settings['nominal'], settings['projection_lower']
    upper = settings['projection_upper']
    clip_to_box(BASE_PARAMETERS, nominal, lower, upper, estimate)
    for _ in range(_CUTS):
        x = weakest_motion(_above(estimate, nominal, MARGIN * lower), geometry)
        if x[0] > 0.0:
            return
        write_normal(geometry, x[1], x[2], x[3], x[4], normal)
        bound = 0.0
        for j in range(BASE_PARAMETERS):
            bound += lower * normal[j] * nominal[j]
        move_into_half_space(
            BASE_PARAMETERS, normal, bound, settings['gamma'], nominal, lower, upper, estimate
        )
    for _ in range(_HALVINGS):
        x = weakest_motion(_above(estimate, nominal, MARGIN * lower), geometry)
        if x[0] > 0.0:
            return
        for j in range(BASE_PARAMETERS):
            estimate[j] = nominal[j] + 0.5 * (estimate[j] - nominal[j])


@formula
def _above(estimate: Any, nominal: Any, part: float) -> BaseParameters:
    """Return theta_hat less a part of the nominal one."""
    return BaseParameters(
        estimate[0] - part * nominal[0],
        estimate[1] - part * nominal[1],
        estimate[2] - part * nominal[2],
        estimate[3] - part * nominal[3],
        estimate[4] - part * nominal[4],
        estimate[5] - part * nominal[5],
        estimate[6] - part * nominal[6],
    )


@kernel
def project_estimate(settings: Any, normal: Any, estimate: Any) -> None:
    """Project theta_hat (7) in place as `project` does; `normal` (7) is workspace."""
    project(settings[0], normal, estimate)
