# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Errors that fit the commanded torque, for adaptation behind limits (back-calculation).

A law requests u = -k e + ..., and limits of the torque add an `excess` to it. The realisable error
is the one for which the law would request the applied u. An entry without excess keeps its error,
so a limited joint does not stop the adaptation of others. Without a slope there is no such
error, and an entry with an excess does not adapt.
"""

from __future__ import annotations

from masmc_ros.jit.compiled import formula


@formula
def secant(linear: float, switched: float, error: float, layer: float) -> float:
    """
    Return the slope from 0 to the error of linear e + switched sat(e / layer).

    Parameters
    ----------
    linear
        Gain of the linear term.
    switched
        Gain of the switching term.
    error
        Error e.
    layer
        Boundary layer of the switching term, in the unit of the error.

    """
    size = abs(error)
    return linear + switched / (size if size > layer else layer)


@formula
def realisable(error: float, excess: float, slope: float) -> float:
    """
    Return the realisable error of one entry: e - excess / slope.

    Without a slope it is e if the excess is 0, and 0 otherwise.

    Parameters
    ----------
    error
        Error e.
    excess
        Applied less requested u, in the unit of slope e.
    slope
        Gain k of the error, >= 0.

    """
    shift = excess / (slope if slope > 0.0 else 1.0)
    without = error if excess == 0.0 else 0.0
    return error - shift if slope > 0.0 else without


@formula
def realisable_for_growth(
    error: float, excess: float, slope: float, growth: float, period: float
) -> float:
    """
    Return the realisable error of one entry for terms of u that grow by T times it.

    The growth in the slope keeps them stable at any gains.

    Parameters
    ----------
    error, excess, slope
        As for `realisable`.
    growth
        Rate at which the terms of u grow, in the unit of the slope per s.
    period
        Control period T in s.

    """
    return realisable(error, excess, slope + period * growth)


@formula
def realisable_part(error: float, excess: float, slope: float) -> float:
    """
    Return the realisable error limited to the range from 0 to e, for gains that only grow.

    Parameters
    ----------
    error, excess, slope
        As for `realisable`.

    """
    part = realisable(error, excess, slope)
    low, high = (error, 0.0) if error < 0.0 else (0.0, error)
    return low if part < low else (high if part > high else part)
