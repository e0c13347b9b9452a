# SPDX-License-Identifier: Apache-2.0
"""The implicit reaching law: sliding mode without chatter, without a boundary layer.

Implicit Euler discretisation of the set-valued law (V. Acary and B. Brogliato, "Implicit
Euler numerical scheme and chattering-free implementation of sliding mode systems", Systems
and Control Letters 59, 2010): the switching term belongs to the *next* sample's surface s+,

    (H_x + T K_s1) s+ + T K_s2 zeta = H_x s,    zeta in Sgn(s+),    u = -K_s1 s+ - K_s2 zeta,

with H_x the task-space inertia of the nominal model. On the surface, s+ = 0 and zeta is
whatever keeps it there.

What the model did not predict, s_k - s+_{k-1}, is an impulse of the disturbance, which the
estimate d follows: d_k = d_{k-1} + (beta / T) H_x (s_k - s+_{k-1}), and u -= d.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.compiled import formula

# The sweeps identify which axes slide; a handful suffices, the bound only stops not-a-number.
_SWEEPS = 1000
_TOLERANCE = 1.0e-13


@formula
def disturbance_estimate(
    n: int, inertia: Any, s: Any, predicted: Any, gain_per_period: float, disturbance: Any
) -> None:
    """Update the estimate (n) in N in place.

    `inertia` is H_x (n, n) in kg, `predicted` the s+ (n) of the previous tick in m/s,
    not-a-number where there is none; `gain_per_period` is beta / T in 1/s.
    """
    if gain_per_period == 0.0 or predicted[0] != predicted[0]:
        return
    for i in range(n):
        impulse = 0.0
        for j in range(n):
            impulse += inertia[i, j] * (s[j] - predicted[j])
        disturbance[i] += gain_per_period * impulse


@formula
def implicit_reaching(
    n: int,
    inertia: Any,
    period: float,
    k_s1: Any,
    k_s2: Any,
    s: Any,
    following: Any,
    zeta: Any,
    work: Any,
) -> None:
    """Solve for s+ (`following`, n, m/s) and zeta (n).

    A symmetric positive definite problem with one box per axis. Projected Gauss-Seidel
    sweeps find which axes reach the surface within the period; with that known the rest is
    a linear system, solved exactly and checked. `work` is (n, n + 1).
    """
    for i in range(n):
        zeta[i] = 0.0
        following[i] = 0.0
    for _ in range(_SWEEPS):
        moved = False
        changed = False
        still = True
        for i in range(n):
            rest = 0.0
            for j in range(n):
                coupled = s[j] if j == i else s[j] - following[j]
                rest += inertia[i, j] * coupled
            box = period * k_s2[i]
            diagonal = inertia[i, i] + period * k_s1[i]
            value = _shrink(rest, box) / diagonal
            changed = changed | (_side(value, box) != _side(following[i], box))
            moved = moved | (
                abs(value - following[i]) * diagonal > _TOLERANCE * (abs(rest) + box)
            )
            still = still & (value == 0.0)
            following[i] = value
            zeta[i] = _within(rest, box)
        if still or not moved:
            return
        if not changed and _solve_sides(n, inertia, period, k_s1, k_s2, s, following, zeta, work):
            return


@formula
def _shrink(value: float, box: float) -> float:
    """Move a value towards zero by the half-width of the box, and no further than zero."""
    return value - box if value > box else (value + box if value < -box else 0.0)


@formula
def _within(value: float, box: float) -> float:
    """Return value / box limited to [-1, 1]; zero without a box."""
    ratio = value / box if box > 0.0 else 0.0
    return 1.0 if ratio > 1.0 else (-1.0 if ratio < -1.0 else ratio)


@formula
def _side(value: float, box: float) -> int:
    """Tell on which side of the surface an axis ends; without a box it is always beside it."""
    return 2 if box == 0.0 else (1 if value > 0.0 else (-1 if value < 0.0 else 0))


@formula
def _solve_sides(
    n: int,
    inertia: Any,
    period: float,
    k_s1: Any,
    k_s2: Any,
    s: Any,
    following: Any,
    zeta: Any,
    work: Any,
) -> bool:
    """Solve exactly for the sides that `following` shows; False if they prove wrong."""
    for i in range(n):
        box = period * k_s2[i]
        side = _side(following[i], box)
        slides = side == 0
        right = 0.0
        for j in range(n):
            right += inertia[i, j] * s[j]
            ends_on_surface = _side(following[j], period * k_s2[j]) == 0
            work[i, j] = 0.0 if slides or ends_on_surface else inertia[i, j]
        right -= box * side if abs(side) == 1 else 0.0
        work[i, i] = 1.0 if slides else inertia[i, i] + period * k_s1[i]
        work[i, n] = 0.0 if slides else right
    # Elimination without pivoting: the matrix is symmetric positive definite.
    for i in range(n):
        for k in range(i + 1, n):
            factor = work[k, i] / work[i, i]
            for j in range(i, n + 1):
                work[k, j] -= factor * work[i, j]
    for reverse in range(n):
        i = n - 1 - reverse
        value = work[i, n]
        for j in range(i + 1, n):
            value -= work[i, j] * work[j, n]
        work[i, n] = value / work[i, i]
    for i in range(n):
        box = period * k_s2[i]
        side = _side(following[i], box)
        if side == 0:
            rest = 0.0
            for j in range(n):
                rest += inertia[i, j] * (s[j] - work[j, n])
            if not abs(rest) <= box:
                return False
            work[i, i] = _within(rest, box)
        else:
            if abs(side) == 1 and not work[i, n] * side >= 0.0:
                return False
            work[i, i] = float(side) if abs(side) == 1 else 0.0
    for i in range(n):
        following[i] = work[i, n]
        zeta[i] = work[i, i]
    return True
