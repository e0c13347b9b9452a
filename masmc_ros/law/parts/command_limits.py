# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Limits of the controller for magnitude and rate of the commanded torques."""

from __future__ import annotations

from typing import Any

from masmc_ros.law.declared import PerEntry
from masmc_ros.numerics.aliases import Numbers
from masmc_ros.numerics.compiled import formula
from masmc_ros.numerics.limits import limited
from masmc_ros.numerics.record import get
from masmc_ros.numerics.tuples import elementwise

PARAMETERS = (
    PerEntry(
        'torque_limit',
        'joints',
        'torque_limit',
        'Limit of the commanded torque',
        'N·m',
        note='; 0: no limit',
    ),
    PerEntry(
        'torque_rate_limit',
        'joints',
        'torque_rate_limit',
        'Limit of the rate of the commanded torque',
        'N·m/s',
        note='; 0: no limit',
    ),
)


@formula
def within_limits(settings: Any, raw: Numbers, before: Numbers, lane: int) -> Numbers:
    """Return a torque within the controller's limits; `before` is that of the last tick."""
    return elementwise(
        limited,
        raw,
        before,
        get(settings, 'torque_limit', lane),
        get(settings, 'torque_rate_limit', lane),
        get(settings, 'period', lane),
    )
