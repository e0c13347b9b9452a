# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
The mobile manipulator: parameters, kinematics (1)-(5) and dynamics (6)-(12).

Planar differential-drive platform with a two-link arm. O is the middle of the axle
(`base_link`). The centre of mass C of the platform is d ahead of O, the base F of the arm is
l = d + L_a ahead of O. E is the end effector. SI units, radians, x forward, y left (REP-103).

Everything here is pure: numbers and tuples in, numbers and tuples out. The formulas work in
four *quasi-velocities*, in which the equations are short:

    u   forward speed of O                  A   absolute rate of link 1, phidot + theta1dot
    w   yaw rate of the platform, phidot    B   absolute rate of link 2, A + theta2dot

They are a constant linear map of the reduced velocity v of (8); forces conjugate to them are
written f = (f_u, f_w, f_A, f_B), with tau' v = f' (u, w, A, B).
"""
