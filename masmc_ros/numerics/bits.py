# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Operations on the bits of floating-point numbers."""

from __future__ import annotations

from masmc_ros.jit.compiled import formula
import numpy as np

_SIGN, _EXPONENT, _ONE = 63, 52, 1023 << 52


@formula
def bits_of(value: float) -> np.int64:
    """Return the 64 bits of a double."""
    return np.float64(value).view(np.int64)


@formula
def of_bits(bits: np.int64) -> float:
    """Return the double with these 64 bits."""
    return float(np.int64(bits).view(np.float64))


@formula
def with_sign_flipped(value: float, flips: np.int64) -> float:
    """Return -value if the last bit of `flips` is set, otherwise value."""
    return of_bits(bits_of(value) ^ (flips << _SIGN))


@formula
def power_of_two(shifted: float) -> float:
    """Return 2**n for n + 1.5 * 2**52, n from -1022 to 1023."""
    return of_bits((bits_of(shifted) << _EXPONENT) + _ONE)
