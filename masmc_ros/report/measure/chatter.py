# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Chatter of torques: share of the ticks at which the torque of a joint reverses its change.

Changes from tick to tick count if they exceed 5 % of the torque limit, or without a limit 5 % of
the largest torque of the run. A reversal is such a change whose sign is opposite to that of the
one before it. An oscillation of period p ticks with a sufficient amplitude has a share of 2/p.
Torques that follow a path, and small noise, have no reversals.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from masmc_ros.aliases import Array
from masmc_ros.params.declaration import Values
from masmc_ros.robot.declaration import Coordinate, listed
import numpy as np

_AMPLITUDE = 0.05
"""Part of the limit from which a change counts."""

_SHARE = 0.2
"""Share of the ticks from which a joint chatters: an oscillation with 10 ticks per period."""

_FEWEST_TICKS = 20
"""Smallest number of ticks from which a share is computed."""

_REMEDY = (
    'expected switching implicit or tanh, lower gains, a larger gamma of an adaptive law, or a'
    ' shorter control_period'
)
_NOISY = (
    'the noise of the measured velocities contributes to it; expected lower gains, or a smaller'
    ' velocity_noise'
)

_ROUNDING = 1.0e-6
"""Torque in N·m or N below which changes are rounding errors."""


def reversal_shares(torque: Array, scale: Array) -> Array:
    """
    Return the shares of reversals (joints) in [0, 1].

    Parameters
    ----------
    torque
        Torques (n, joints) of consecutive ticks in N·m or N.
    scale
        Torque limits (joints), or the largest torque of a joint without a limit.

    """
    if len(torque) < _FEWEST_TICKS:
        return np.zeros(torque.shape[1])
    change = np.diff(torque, axis=0)
    is_large = np.abs(change) > np.maximum(_AMPLITUDE * scale, _ROUNDING)
    rising = [column[large] > 0.0 for column, large in zip(change.T, is_large.T, strict=True)]
    return np.array([np.count_nonzero(r[1:] != r[:-1]) for r in rising]) / len(change)


def chatter_notes(
    torque: Array, window: Array, parameters: Mapping[str, Values], joints: Sequence[Coordinate]
) -> tuple[str, ...]:
    """
    Return a sentence about the joints that chatter; none if no joint does.

    Parameters
    ----------
    torque
        Torques (n, joints) of the whole run in N·m or N.
    window
        Torques of the window that is judged.
    parameters
        Parameters by node; a log may lack those of the plant.
    joints
        Driven joints of the robot.

    """
    if not len(window):
        return ()
    limits = np.full(len(joints), np.inf)
    for node in ('controller', 'plant'):
        limit = np.array(parameters.get(node, {}).get('torque_limit', 0.0))
        limits = np.where(limit > 0.0, np.minimum(limit, limits), limits)
    scale = np.where(np.isfinite(limits), limits, np.abs(torque).max(axis=0))
    shares = reversal_shares(window, scale)
    names = [joint.name for joint, share in zip(joints, shares, strict=True) if share > _SHARE]
    if not names:
        return ()
    has_noise = np.any(parameters.get('plant', {}).get('velocity_noise', 0.0))
    return (
        f'the torque of {listed(names)} chatters: its change reverses at up to {shares.max():.0%}'
        f' of the ticks, by more than {_AMPLITUDE:.0%} of the limit, or of the largest torque'
        f' without a limit; {_NOISY if has_noise else _REMEDY}.',
    )
