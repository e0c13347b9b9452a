# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
The type of a YAML scalar by the rules of ROS 2 parameter files.

These are the rules of rcl's parser, which uses C's `strtoll` and `strtod`, and not those of
YAML: `010` is the integer 8, `1e3` and `inf` are doubles, `1e999` and `~` are strings.
"""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction
import math
import re

Scalar = bool | int | float | str

_STRING_TAG = 'tag:yaml.org,2002:str'
_TRUE = frozenset(('Y', 'y', 'yes', 'Yes', 'YES', 'true', 'True', 'TRUE', 'on', 'On', 'ON'))
_FALSE = frozenset(('N', 'n', 'no', 'No', 'NO', 'false', 'False', 'FALSE', 'off', 'Off', 'OFF'))
_SPECIAL = {
    f'{sign}.{name}': float(sign + name)
    for sign in ('', '+', '-')
    for name in ('inf', 'Inf', 'INF')
} | {f'.{name}': math.nan for name in ('nan', 'NaN', 'NAN')}

# C's isspace, which strtoll and strtod skip in front of a number.
_SPACE = r'[ \t\n\v\f\r]*'
_INTEGER = re.compile(
    _SPACE + r'(?P<sign>[+-]?)(?:0[xX](?P<hex>[0-9a-fA-F]+)|(?P<octal>0[0-7]*)'
    r'|(?P<decimal>[1-9][0-9]*))'
)
_DECIMAL = re.compile(
    _SPACE + r'(?P<number>[+-]?(?P<digits>[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)'
)
_HEXADECIMAL = re.compile(
    _SPACE + r'(?P<number>(?P<sign>[+-]?)0[xX]'
    r'(?:(?P<whole>[0-9a-fA-F]+)\.?(?P<rest>[0-9a-fA-F]*)|\.(?P<only>[0-9a-fA-F]+))'
    r'(?:[pP](?P<exponent>[+-]?[0-9]+))?)'
)
_INFINITE = re.compile(_SPACE + r'(?P<sign>[+-]?)inf(?:inity)?', re.IGNORECASE)
_NOT_A_NUMBER = re.compile(_SPACE + r'[+-]?nan(?:\([0-9a-z_]*\))?', re.IGNORECASE)

_INTEGER_LIMIT = 2**63
_SMALLEST_NORMAL = Fraction(2) ** -1022
# Rounded to 53 bits with an unbounded exponent, anything below this is below the normals.
_TINY = _SMALLEST_NORMAL - Fraction(2) ** -1076


def typed(text: str, *, quoted: bool = False, tag: str | None = None) -> Scalar:
    """
    Give a YAML scalar the type that rcl gives it.

    Parameters
    ----------
    text
        the scalar after YAML's own unquoting and unescaping.
    quoted
        whether it stood in single or double quotes.
    tag
        its resolved YAML tag, if it has one; only `!!str` matters.

    Returns
    -------
        A bool, an int (64 bit), a float or a str.

    """
    if quoted or tag == _STRING_TAG:
        return text
    if text in _TRUE:
        return True
    if text in _FALSE:
        return False
    integer = _integer(text)
    if integer is not None:
        return integer
    double = _double(text)
    return text if double is None else double


def _integer(text: str) -> int | None:
    """Do what `strtoll(text, &end, 0)` does, None where that fails or leaves a rest."""
    match = _INTEGER.fullmatch(text)
    if match is None:
        return None
    if match['hex']:
        size = int(match['hex'], 16)
    elif match['octal']:
        size = int(match['octal'], 8)
    elif len(match['decimal']) > 19:  # more than 64 bits, and int() refuses very many digits
        return None
    else:
        size = int(match['decimal'])
    value = -size if match['sign'] == '-' else size
    return value if -_INTEGER_LIMIT <= value < _INTEGER_LIMIT else None


def _double(text: str) -> float | None:
    """Do what `strtod(text, &end)` does, None where that fails, overflows or underflows."""
    if text in _SPECIAL:
        return _SPECIAL[text]
    if _NOT_A_NUMBER.fullmatch(text):
        return math.nan
    infinite = _INFINITE.fullmatch(text)
    if infinite:
        return -math.inf if infinite['sign'] == '-' else math.inf
    decimal = _DECIMAL.fullmatch(text)
    if decimal:
        return _in_range(float(decimal['number']), decimal['number'], decimal['digits'])
    hexadecimal = _HEXADECIMAL.fullmatch(text)
    if hexadecimal:
        return _hexadecimal(hexadecimal)
    return None


def _hexadecimal(match: re.Match[str]) -> float | None:
    try:
        value = float.fromhex(match['number'])
    except OverflowError:
        return None
    digits = (match['whole'] or '') + (match['rest'] or '') + (match['only'] or '')
    if not digits.strip('0'):
        return value
    if value == 0.0:
        return None
    if abs(value) > _SMALLEST_NORMAL:
        return value
    places = len(match['rest'] or '') + len(match['only'] or '')
    exponent = int(match['exponent'] or '0') - 4 * places
    return None if _underflows(value, int(digits, 16) * Fraction(2) ** exponent) else value


def _in_range(value: float, number: str, digits: str) -> float | None:
    if math.isinf(value):
        return None
    if not digits.strip('0.'):
        return value
    if value == 0.0:
        return None
    if abs(value) > _SMALLEST_NORMAL:
        return value
    return None if _underflows(value, abs(Fraction(Decimal(number)))) else value


def _underflows(value: float, exact: Fraction) -> bool:
    """Whether `strtod` reports underflow: below the normals and not exact."""
    return exact < _TINY and abs(Fraction(value)) != exact
