# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Elementary functions that are bitwise identical on every machine.

The C library's sin, cos and tanh differ between machines in the last bit. These functions use only
the IEEE operations + - * /, which do not differ, and bit operations. Argument reduction and
minimax polynomials are the classical ones: W. J. Cody and W. Waite, Software
Manual for the Elementary Functions (1980); coefficients as in FreeBSD's msun (sin, cos) and in
S. L. Moshier's Cephes (tanh, exp). All are branch-free and therefore vectorise.

Random numbers are identical on every machine and after every reset as well. The generator is
counter-based: a number is a function of a key and of the place of its use, and there is no state
between two numbers. Philox-2x32-10 of J. K. Salmon, M. A. Moraes, R. O. Dror and D. E. Shaw,
"Parallel random numbers: as easy as 1, 2, 3" (SC 2011).
"""

from __future__ import annotations

import math

from masmc_ros.aliases import Array, Numbers
from masmc_ros.jit.compiled import formula
from masmc_ros.jit.tuples import elementwise
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


# Adding and subtracting 1.5 * 2**52 rounds a double of moderate size to the nearest integer.
_ROUND = 6755399441055744.0

_ANGLE_STEPS = 4
"""Steps of Newton's iteration for an angle; the initial value has an error of 5e-3."""

_TWO_OVER_PI = 6.36619772367581382433e-01
# pi/2 in three parts of 33 bits and a remainder; n * part is exact for |n| < 2**20.
_HALF_PI_1 = 1.57079632673412561417e00
_HALF_PI_2 = 6.07710050630396597660e-11
_HALF_PI_3 = 2.02226624871116645580e-21
_HALF_PI_REST = 8.47842766036889956997e-32
# Beyond this angle the reduction would return noise, so the result is NaN. It is a constant
# because older releases of Numba do not compile float('nan').
_LARGEST_ANGLE = 1.0e9
_NAN = float('nan')

AT_ONCE = 8
"""Numbers in the longest vector registers."""

_LOG2_E = 1.44269504088896338700e00
_LN2_HIGH = 6.93145751953125e-01
_LN2_LOW = 1.42860682030941723212e-06
# tanh is 1 to the last bit beyond 19.07.
_TANH_SATURATION = 20.0
# Between these bounds 2**n is a normal number.
_LARGEST_EXPONENT = 700.0


@formula
def _bounded(angle: float) -> float:
    return angle if abs(angle) < _LARGEST_ANGLE else _NAN


@formula
def _shifted(angle: float) -> float:
    return angle * _TWO_OVER_PI + _ROUND


@formula
def _remainder(angle: float, shifted: float) -> float:
    n = shifted - _ROUND
    return (((angle - n * _HALF_PI_1) - n * _HALF_PI_2) - n * _HALF_PI_3) - n * _HALF_PI_REST


@formula
def _sine(r: float) -> float:
    z = r * r
    tail = 8.33333333332248946124e-03 + z * (
        -1.98412698298579493134e-04
        + z * (
            2.75573137070700676789e-06
            + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
        )
    )
    return r + (z * r) * (-1.66666666666666324348e-01 + z * tail)


@formula
def _cosine(r: float) -> float:
    z = r * r
    tail = z * (
        4.16666666666666019037e-02
        + z * (
            -1.38888888888741095749e-03
            + z * (
                2.48015872894767294178e-05
                + z * (
                    -2.75573143513906633035e-07
                    + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)
                )
            )
        )
    )
    half = 0.5 * z
    remainder = 1.0 - half
    return remainder + (((1.0 - remainder) - half) + z * tail)


@formula
def _turned(sine: float, cosine: float, shifted: float) -> tuple[float, float]:
    # The last bits of a number of this size are those of n: one determines if sine and cosine
    # are exchanged, the next one is the sign.
    quadrant = bits_of(shifted)
    odd = (quadrant & 1) != 0
    sin_value = with_sign_flipped(cosine if odd else sine, quadrant >> 1)
    cos_value = with_sign_flipped(sine if odd else cosine, (quadrant + 1) >> 1)
    return sin_value, cos_value


@formula
def _turned_sine(sine: float, cosine: float, shifted: float) -> float:
    return _turned(sine, cosine, shifted)[0]


@formula
def _before_turning(angles: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    # Step by step for all: long sums of products wait for their own results, and a processor
    # looks only so far ahead for others that do not.
    bounded = elementwise(_bounded, angles)
    shifted = elementwise(_shifted, bounded)
    r = elementwise(_remainder, bounded, shifted)
    return elementwise(_sine, r), elementwise(_cosine, r), shifted


@formula
def sines(angles: Numbers) -> Numbers:
    """Return the sine of each angle in rad; see `sin_cos`."""
    sine, cosine, shifted = _before_turning(angles)
    return elementwise(_turned_sine, sine, cosine, shifted)


@formula
def sines_and_cosines(angles: Numbers) -> tuple[tuple[float, float], ...]:
    """Return (sin, cos) of each angle of a tuple in rad; see `sin_cos`."""
    sine, cosine, shifted = _before_turning(angles)
    return elementwise(_turned, sine, cosine, shifted)


@formula
def sin_cos(angle: float) -> tuple[float, float]:
    """
    Return (sin, cos) of an angle in rad.

    Within two ulp of the exact value up to 1000 rad and three up to 1.6e6 rad; beyond, no
    worse than a relative change of the angle by one rounding. NaN from 1e9 rad.
    """
    return sines_and_cosines((angle,))[0]


@formula
def angle_of(sine: float, cosine: float) -> float:
    """Return the angle in [0, pi] of a non-negative sine and a cosine."""
    # sin t / (1 + cos t) = tan t/2; on either side of a quarter turn the quotient is at most one.
    is_small = cosine >= 0.0
    tangent = sine / (1.0 + cosine) if is_small else (1.0 - cosine) / max(sine, 1.0e-300)
    inverted = tangent > 1.0
    u = 1.0 / tangent if inverted else tangent
    half = u * (0.9953545 - u * u * (0.2886790 - 0.0793392 * u * u))
    t = 2.0 * half
    t = math.pi - t if inverted else t
    for _ in range(_ANGLE_STEPS):
        s, c = sin_cos(t)
        t += sine * c - cosine * s
    return t


@formula
def padded(count: int) -> int:
    """Return the smallest multiple of the vector length that is not less than `count`."""
    return (count + AT_ONCE - 1) // AT_ONCE * AT_ONCE


@formula
def write_sines(angles: Array, count: int) -> None:
    """
    Replace the first angles in rad by their sines, several at once.

    The array has a `padded` length, because the function computes whole vectors. Entries after
    the first `count` are overwritten without a meaning.
    """
    for k in range(padded(count)):
        angles[k] = sin_cos(angles[k] if k < count else 0.0)[0]


@formula
def write_sines_and_cosines(angles: Array, count: int, cosines: Array) -> None:
    """Replace the first angles by their sines, and write their cosines; see `write_sines`."""
    for k in range(padded(count)):
        angles[k], cosines[k] = sin_cos(angles[k] if k < count else 0.0)


@formula
def _exponential(y: float) -> float:
    """Return e**y for y between -700 and 700: 2**n exp(r)."""
    shifted = y * _LOG2_E + _ROUND
    n = shifted - _ROUND
    r = (y - n * _LN2_HIGH) - n * _LN2_LOW
    z = r * r
    p = r * ((1.26177193074810590878e-04 * z + 3.02994407707441961300e-02) * z + 1.0)
    q = (
        (3.00198505138664455042e-06 * z + 2.52448340349684104192e-03) * z
        + 2.27265548208155028766e-01
    ) * z + 2.0
    return (1.0 + 2.0 * (p / (q - p))) * power_of_two(shifted)


@formula
def exp(x: float) -> float:
    """
    Return e**x, within two ulp of the exact value for x from -700 to 700.

    Smaller arguments give exp(-700), which is practically zero, larger ones exp(700).
    """
    bounded = x if x > -_LARGEST_EXPONENT else -_LARGEST_EXPONENT
    bounded = bounded if bounded < _LARGEST_EXPONENT else _LARGEST_EXPONENT
    return _exponential(bounded) if x == x else x


@formula
def tanh(x: float) -> float:
    """Return the hyperbolic tangent, within two ulp of the exact value."""
    # Small arguments: a rational approximation without cancellation.
    z = x * x
    numerator = (
        -9.64399179425052238628e-01 * z - 9.92877231001918586564e01
    ) * z - 1.61468768441708447952e03
    denominator = (
        (z + 1.12811678491632931402e02) * z + 2.23548839060100448583e03
    ) * z + 4.84406305325125486048e03
    near = x + x * z * (numerator / denominator)
    # Other arguments: 1 - 2 / (exp(2 |x|) + 1).
    magnitude = abs(x)
    magnitude = magnitude if magnitude < _TANH_SATURATION else _TANH_SATURATION
    y = magnitude + magnitude
    far = 1.0 - 2.0 / (_exponential(y) + 1.0)
    far = far if x > 0.0 else -far
    value = near if abs(x) < 0.625 else far
    return value if x == x else x


_LOW = 0xFFFFFFFF
_MULTIPLIER = 0xD256D193
_WEYL = 0x9E3779B9
_ROUNDS = 10
_HALF = 0xFFFF

_FIRST_UNIFORM = 0x80000000
_PER_WORD = 1.0 / 4294967296.0
_WORDS = 3
# Twelve numbers uniform on 0 ... 65535 have this mean and this standard deviation in sum.
_MEAN = 393210.0
_PER_DEVIATION = 1.0 / 65535.99999237061


@formula
def philox(low: int, high: int, key: int) -> tuple[int, int]:
    """Return two words of 32 random bits for a counter of two words and a key of one."""
    for _ in range(_ROUNDS):
        product = low * _MULTIPLIER
        low, high = (((product >> 32) & _LOW) ^ key ^ high) & _LOW, product & _LOW
        key = (key + _WEYL) & _LOW
    return low, high


@formula
def uniform(seed: int, tick: int, stream: int) -> float:
    """
    Return a number in [0, 1) of a seed, a tick and a stream.

    Its words of the counter follow those of `gaussian` for the largest number of axes.
    """
    low, _ = philox(tick & _LOW, _FIRST_UNIFORM + stream, seed & _LOW)
    return low * _PER_WORD


@formula
def gaussian(seed: int, tick: int, axis: int) -> float:
    """
    Return the number of mean 0 and variance 1 of a seed, a tick and an axis.

    It is the sum of twelve uniform numbers, which needs no logarithm. The distribution is normal
    except for the tails, which end at 6, and a kurtosis of 2.9.
    """
    total = 0
    for word in range(_WORDS):
        low, high = philox(tick & _LOW, axis * _WORDS + word, seed & _LOW)
        total += (low & _HALF) + (low >> 16) + (high & _HALF) + (high >> 16)
    return (total - _MEAN) * _PER_DEVIATION
