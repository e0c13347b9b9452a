# SPDX-License-Identifier: Apache-2.0
"""Explicit reaching terms u = -K_s1 s - K_s2 sw(s) of (15), one task axis at a time.

`sign` is the paper's law. The others are the continuous approximations of it that the paper
mentions; delta is the thickness of their boundary layer in m/s. The reaching law that needs
no layer is in `implicit.py`.
"""

from __future__ import annotations

from masmc_ros.compiled import formula
from masmc_ros.portable_math import tanh

SWITCHING = ('sign', 'saturation', 'tanh', 'sigmoid', 'implicit')
"""Choices of the parameter `switching`; compiled code knows them by their position here."""

SIGN, SATURATION, TANH, SIGMOID, IMPLICIT = range(len(SWITCHING))


@formula
def sign(s: float) -> float:
    """Return -1, 0 or 1."""
    return 1.0 if s > 0.0 else (-1.0 if s < 0.0 else s)


@formula
def saturation(s: float, delta: float) -> float:
    """Return s / delta, limited to [-1, 1]."""
    ratio = s / delta
    return 1.0 if ratio > 1.0 else (-1.0 if ratio < -1.0 else ratio)


@formula
def sigmoid(s: float, delta: float) -> float:
    """Return s / (|s| + delta)."""
    return s / (abs(s) + delta)


@formula
def explicit_reaching(
    switching: int, s: float, k_s1: float, k_s2: float, delta: float
) -> float:
    """Return the reaching force in N; `switching` is a position in SWITCHING."""
    if switching == TANH:
        switched = tanh(s / delta)
    elif switching == SATURATION:
        switched = saturation(s, delta)
    elif switching == SIGMOID:
        switched = sigmoid(s, delta)
    else:
        switched = sign(s)
    return -k_s1 * s - k_s2 * switched
