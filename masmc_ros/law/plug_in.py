# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Interface of a user law in plain Python: input of a tick, and result.

A law is a class named by an entry point of the group `masmc_ros.laws`. It uses the same compiled
formulas as the built-in laws and runs in the same loop, but slower.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from masmc_ros.aliases import Array
from masmc_ros.params.declaration import Parameter, Values


@dataclass(frozen=True)
class TickInput:
    """Input of a law at tick k; n axes, p parameters, SI units."""

    period: float
    """Control period T in s."""
    gains: Values
    """Current parameters of the controller by name; arrays for gains per axis."""
    position: Array
    """Positions in the order of joint_states: the base's, then the joints'."""
    velocity: Array
    """Velocities in the same order."""
    reference: Array
    """x_d, xdot_d, xddot_d (3, n)."""
    error: Array
    """e = x - x_d (n) in m."""
    error_rate: Array
    """edot (n) in m/s."""
    surface: Array
    """s = edot + sigma e (n) in m/s."""
    reference_velocity: Array
    """v_r (n) in the reduced velocities, rad/s."""
    reference_acceleration: Array
    """a_r (n) in the reduced velocities, rad/s2."""
    jacobian: Array
    """J (n, n) of (4)."""
    inverse_jacobian: Array
    """J^-1 (n, n), damped close to a singularity."""
    inertia: Array
    """Reduced inertia H (n, n) of (10) of the nominal model."""
    task_inertia: Array
    """H_x (n, n) of (11) of the nominal model, kg."""
    regressor: Array
    """Y (n, p) with H a_r + V v_r = Y theta, torques in v's order."""
    estimate: Array
    """theta_hat (p)."""
    commanded: Array
    """Torque (n) commanded at the last tick in N·m: that of the law within the active limits."""
    singular: bool
    """True if J^-1 is damped because the task is close to singular."""


class PlugInLaw(Protocol):
    """Control law of a user; created at the start, at a reset, and when `law` selects it."""

    parameters: tuple[Parameter, ...]
    """Additional parameters, declared by the controller; use names such as `LAW.gain`."""

    def step(self, tick: TickInput) -> tuple[Array, Array]:
        """Return the torque (n) in N·m and the next theta_hat (p)."""
        ...
