# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Random numbers that are identical on every machine and after every reset.

The generator is counter-based: a number is a function of a key and of the place of its use, and
there is no state between two numbers. Philox-2x32-10 of J. K. Salmon, M. A. Moraes, R. O. Dror
and D. E. Shaw, "Parallel random numbers: as easy as 1, 2, 3" (SC 2011).
"""

from __future__ import annotations

from masmc_ros.jit.compiled import formula

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
