# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Operations on the bits of floating-point numbers."""

from __future__ import annotations

import struct

from masmc_ros.jit.compiled import formula
from masmc_ros.jit.generated import Compiler, generated, IrValue, IrValues, Types
from numba import types

_WORD = 0xFFFFFFFFFFFFFFFF
_SIGN, _EXPONENT, _ONE = 63, 52, 1023 << 52


def bits_of(value: float) -> int:
    """Return the 64 bits of a double."""
    return int(struct.unpack('<Q', struct.pack('<d', value))[0])


@generated(bits_of, lambda context, value: types.int64)
def _bits_of(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    value = compiler.cast(values[0], kinds[0], types.float64)
    return compiler.builder.bitcast(value, compiler.context.get_value_type(types.int64))


def of_bits(bits: int) -> float:
    """Return the double with these 64 bits; higher bits are ignored."""
    return float(struct.unpack('<d', struct.pack('<Q', bits & _WORD))[0])


@generated(of_bits, lambda context, bits: types.float64)
def _of_bits(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    bits = compiler.cast(values[0], kinds[0], types.int64)
    return compiler.builder.bitcast(bits, compiler.context.get_value_type(types.float64))


@formula
def with_sign_flipped(value: float, flips: int) -> float:
    """Return -value if the last bit of `flips` is set, otherwise value."""
    return of_bits(bits_of(value) ^ (flips << _SIGN))


@formula
def power_of_two(shifted: float) -> float:
    """Return 2**n for n + 1.5 * 2**52, n from -1022 to 1023."""
    return of_bits((bits_of(shifted) << _EXPONENT) + _ONE)
