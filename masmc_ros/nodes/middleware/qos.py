# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Quality of service: always reliable, deep for publishers and recorder, shallow for control.

States, commands and the reference are transient-local. A node that joins late or restarts
therefore continues at the current tick. A subscription requests past messages only if it needs
them. Messages that are valid until the next one are latched (`latched.py`), telemetry is volatile.
"""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

DEEP = 1000
"""Depth in messages of publishers and of the recorder's subscriptions."""


def publisher_qos(depth: int = DEEP, *, past: bool = True) -> QoSProfile:
    """Return the profile of publishers: reliable; with `past`, transient-local."""
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if past else DurabilityPolicy.VOLATILE,
    )


def subscription_qos(
    *, depth: int = 1, past: bool = False, best_effort: bool = False
) -> QoSProfile:
    """
    Return the profile of subscriptions: reliable; with `past`, transient-local.

    `best_effort` also matches publishers that are not reliable.
    """
    reliability = ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE
    return QoSProfile(
        depth=depth,
        reliability=reliability,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if past else DurabilityPolicy.VOLATILE,
    )
