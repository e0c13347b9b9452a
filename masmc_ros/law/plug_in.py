# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
What a user's own law is given at a tick, and what it gives back.

A law is a class named by an entry point of the group `masmc_ros.laws`. It is plain Python
over the same compiled formulas as the built-in laws and runs in the same loop, slower.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from masmc_ros.numerics.aliases import Array
from masmc_ros.params.declaration import Parameter


@dataclass(frozen=True)
class TickInput:
    """Everything a law may want to know at tick k; n axes, p parameters, SI units."""

    period: float
    """Control period T in s."""
    gains: Mapping[str, Any]
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
    """Torque (n) commanded at the last tick, N m: the law's own within the active limits."""
    singular: bool
    """True where the task is so close to singular that J^-1 is damped."""


class PlugInLaw(Protocol):
    """Control law of a user; created at the start, at a reset and when `law` selects it."""

    parameters: tuple[Parameter, ...]
    """Parameters of its own, declared by the controller; name them `LAW.something`."""

    def step(self, tick: TickInput) -> tuple[Array, Array]:
        """Return the torque (n) in N m and the next theta_hat (p)."""
        ...
