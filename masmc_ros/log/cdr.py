# SPDX-License-Identifier: Apache-2.0
"""The messages of the hot path as raw CDR: fixed layouts that are filled, not serialised.

Each class keeps its bytes where the numbers are float64 views into them; `load` takes over a
received message, or tells by False that it is of another layout. For those, a full
deserialiser makes a message that `load_message` or `from_message` reads: joints by name,
labels as they come.
"""

from __future__ import annotations

from masmc_ros.log.arm_velocity import ArmVelocityCdr
from masmc_ros.log.effort import EffortCdr
from masmc_ros.log.joint_state import JointStateCdr
from masmc_ros.log.platform_motion import OdometryCdr, TimeCdr, TwistCdr, TwistStampedCdr
from masmc_ros.log.reference_window import ReferenceWindow
from masmc_ros.log.telemetry import TelemetryCdr

__all__ = [
    'ArmVelocityCdr',
    'EffortCdr',
    'JointStateCdr',
    'OdometryCdr',
    'ReferenceWindow',
    'TelemetryCdr',
    'TimeCdr',
    'TwistCdr',
    'TwistStampedCdr',
]
