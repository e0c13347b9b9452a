# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Text of values in ROS 2 parameter files: values as text, and types of unquoted YAML scalars.

rcl uses C's `strtoll` and `strtod`, not the rules of YAML. The first matching row applies;
numbers may have a sign and leading white space:

===========  ==============================================================================
bool         `y yes true on n no false off`, each also as `Yes` and `YES`
integer      decimal `150`; octal after `0`: `010` is 8; hexadecimal `0x1F`; up to 64 bits
double       `1.0`, `5.`, `.5`, `1e3`, hexadecimal `0x1.8p1`, `08`, integers of more than
             64 bits; `.inf`, `.Inf`, `.INF`; `.nan`, `.NaN`, `.NAN` without a sign; `inf`,
             `infinity` and `nan` in upper and lower case
string       all others, such as `1_000`, `0b1`, `1e`, `~`, `null`, `-.nan`, and doubles out
             of range: `1e999`, `1e-999`
===========  ==============================================================================
"""

from __future__ import annotations

from collections.abc import Iterable
import math
import re
import sys

import yaml

_PLAIN = re.compile(r'[A-Za-z_/][A-Za-z0-9_./-]*')


def yaml_text(value: object) -> str:
    """
    Return a value as one line that a parameter file reads as the same value.

    Parameters
    ----------
    value
        a bool, int, float, str or an iterable of those; None, a parameter without a value, is
        an empty array.

    """
    if value is None:
        return '[]'
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, float):
        return _double_text(float(value))
    if isinstance(value, str):
        return _string_text(value)
    if isinstance(value, Iterable) and not isinstance(value, bytes | dict):
        return f'[{", ".join(yaml_text(entry) for entry in value)}]'
    return str(value)


def _double_text(value: float) -> str:
    if math.isnan(value):
        return '.nan'
    if math.isinf(value):
        return '.inf' if value > 0 else '-.inf'
    return repr(value)


def _string_text(value: str) -> str:
    if _PLAIN.fullmatch(value) and isinstance(typed(value), str):
        return value
    quoted: str = yaml.safe_dump(value, default_style='"', width=math.inf)
    return quoted.rstrip('\n')


Scalar = bool | int | float | str

_BOOLS = {
    written: value
    for value, words in ((True, 'y yes true on'), (False, 'n no false off'))
    for word in words.split()
    for written in (word, word.capitalize(), word.upper())
}
_INTEGER = re.compile(r'\s*[+-]?(?:(0x[0-9a-f]+)|(0[0-7]*)|[1-9][0-9]*)', re.ASCII | re.IGNORECASE)
_DECIMAL = re.compile(
    r'\s*[+-]?(?P<digits>[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+-]?[0-9]+)?', re.ASCII | re.IGNORECASE
)
_HEXADECIMAL = re.compile(
    r'\s*[+-]?0x(?P<digits>[0-9a-f]+\.?[0-9a-f]*|\.[0-9a-f]+)(?:p[+-]?[0-9]+)?',
    re.ASCII | re.IGNORECASE,
)
_YAML_SPECIAL = re.compile(r'[+-]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)')
_C_SPECIAL = re.compile(r'\s*[+-]?(?:inf(?:inity)?|nan)', re.ASCII | re.IGNORECASE)


def typed(text: str) -> Scalar:
    """
    Return the value of an unquoted scalar by the table of this module.

    Parameters
    ----------
    text
        the scalar without YAML's line folding.

    Returns
    -------
        A bool, an int of 64 bits, a float or a str.

    """
    if text in _BOOLS:
        return _BOOLS[text]
    integer = _INTEGER.fullmatch(text)
    # Python limits the digits of int(); 20 characters hold 64 bits except after zeros.
    if integer and (len(text.strip()) <= 20 or integer[1] or integer[2]):
        value = int(text, 16 if integer[1] else 8 if integer[2] else 10)
        if -(2**63) <= value < 2**63:
            return value
    double = _double(text)
    return text if double is None else double


def _double(text: str) -> float | None:
    """Return the double of a text; None for another type or out of range."""
    if _YAML_SPECIAL.fullmatch(text) or _C_SPECIAL.fullmatch(text):
        return float(text.replace('.', ''))
    if match := _DECIMAL.fullmatch(text):
        value = float(text)
    elif match := _HEXADECIMAL.fullmatch(text):
        try:
            value = float.fromhex(text)
        except OverflowError:
            return None
    else:
        return None
    if not match['digits'].strip('0.'):
        return value
    # Subnormal numbers are out of range too: strtod reports the loss of digits.
    return value if sys.float_info.min <= abs(value) < math.inf else None
