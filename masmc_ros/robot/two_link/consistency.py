# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Physical consistency of base parameters.

With l = arm_base and L_1 = link_1, let

    Q(theta) = [ M     c     p_1      p_2     ]
               [ c     J     l p_1    l p_2   ]
               [ p_1   l p_1 i_1      L_1 p_2 ]
               [ p_2   l p_2 L_1 p_2  i_2     ],

the mass matrix of the robot stretched out along x and free to slide sideways. Positive masses and
inertias with the base parameters theta exist if and only if Q is positive definite. H(q) is then
positive definite in every posture; docs/theory/adaptation.md proves both. Q is linear in theta, so
the set of consistent theta is convex. A vector x for which x' Q x is not positive is the normal of
a half-space that contains the whole set.
"""

from __future__ import annotations

from masmc_ros.jit.compiled import formula
from masmc_ros.robot.two_link.dynamics import Theta
from masmc_ros.robot.two_link.geometry import Geometry, Quad


@formula
def is_consistent(model: Geometry, theta: Theta) -> bool:
    """Return True if Q(theta) is positive definite: bodies can have these parameters."""
    return weakest_motion(model, theta)[0] > 0.0


@formula
def weakest_motion(model: Geometry, theta: Theta) -> tuple[float, Quad]:
    """
    Return the first pivot of Q = L D L' that is not positive, and x with x' Q x = pivot.

    If all are positive, it is the last one with its x.
    """
    first, yaw_inertia, offset, moment_1, moment_2, inertia_1, inertia_2 = theta
    l, link = model.arm_base, model.link_1  # noqa: E741 - the paper's symbol
    if not first > 0.0:
        return first, (1.0, 0.0, 0.0, 0.0)
    # Rows 1-3 minus their part along row 0; each later pivot is the remaining corner entry.
    q_01, q_02, q_03 = offset / first, moment_1 / first, moment_2 / first
    second = yaw_inertia - q_01 * offset
    if not second > 0.0:
        return second, (-q_01, 1.0, 0.0, 0.0)
    rest_12 = l * moment_1 - q_01 * moment_1
    rest_13 = l * moment_2 - q_01 * moment_2
    q_12, q_13 = rest_12 / second, rest_13 / second
    third = inertia_1 - q_02 * moment_1 - q_12 * rest_12
    if not third > 0.0:
        return third, (q_01 * q_12 - q_02, -q_12, 1.0, 0.0)
    rest_23 = link * moment_2 - q_02 * moment_2 - q_12 * rest_13
    q_23 = rest_23 / third
    last = inertia_2 - q_03 * moment_2 - q_13 * rest_13 - q_23 * rest_23
    x_1 = q_23 * q_12 - q_13
    return last, (q_23 * q_02 - q_03 - q_01 * x_1, x_1, -q_23, 1.0)


@formula
def consistency_normal(model: Geometry, x: Quad, template: Theta) -> Theta:
    """Return the vector n (7) with n' theta = x' Q(theta) x."""
    x_0, x_1, x_2, x_3 = x
    across = x_0 + model.arm_base * x_1
    return (
        x_0 * x_0,
        x_1 * x_1,
        2.0 * x_0 * x_1,
        2.0 * x_2 * across,
        2.0 * x_3 * (across + model.link_1 * x_2),
        x_2 * x_2,
        x_3 * x_3,
    )
