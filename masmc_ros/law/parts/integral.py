# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Integral of an error, with back-calculation from the commanded torque."""

from __future__ import annotations

from masmc_ros.jit.compiled import formula
from masmc_ros.law.parts.realisable import realisable_for_growth


@formula
def integrated(
    w: float, error: float, excess: float, k_p: float, k_i: float, period: float
) -> float:
    """
    Return the next integral of one entry: w + T (e - excess / (k_p + T k_i)).

    For u = -k_p e - k_i w - ... and `excess` = applied u - u this integrates the error for which
    the law would request the applied u (conditioning). T k_i keeps it stable at any gains. With
    k_i = 0 the integral has no effect on u, and limits have none on the integral.

    Parameters
    ----------
    w
        Integral of the error.
    error
        Error e.
    excess
        Applied less requested u, in the unit of k_p e.
    k_p
        Gain of the error.
    k_i
        Gain of the integral.
    period
        Control period T in s.

    """
    conditioned = realisable_for_growth(error, excess, k_p, k_i, period)
    return w + period * (conditioned if k_i > 0.0 else error)
