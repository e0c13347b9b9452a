# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Limits of the controller for magnitude and rate of the commanded torques."""

from __future__ import annotations

from masmc_ros.aliases import Joints
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
from masmc_ros.law.declared import PerEntry
from masmc_ros.law.fields import Settings
from masmc_ros.numerics.limits import limited

TORQUE_LIMIT = PerEntry(
    'torque_limit',
    'joints',
    'torque_limit',
    'Limit of the commanded torque',
    'N·m',
    note='; 0: no limit',
)

TORQUE_RATE_LIMIT = PerEntry(
    'torque_rate_limit',
    'joints',
    'torque_rate_limit',
    'Limit of the rate of the commanded torque',
    'N·m/s',
    note='; 0: no limit',
)

PARAMETERS = (TORQUE_LIMIT, TORQUE_RATE_LIMIT)


@formula
def within_limits(settings: Settings, raw: Joints, before: Joints) -> Joints:
    """
    Return the commanded torques: those of a law within `torque_limit` and `torque_rate_limit`.

    Parameters
    ----------
    settings
        Settings of the law; a limit of 0 does not limit.
    raw
        Joint torques (joints) that the law requests in N·m.
    before
        Commanded torques (joints) of the last tick in N·m.

    """
    return elementwise(
        limited,
        raw,
        before,
        settings.torque_limit,
        settings.torque_rate_limit,
        settings.period,
    )
