# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Values as text of a parameter file or of a command line."""

from __future__ import annotations

from collections.abc import Iterable
import math
import re

from masmc_ros.params.scalar import typed
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
        return _double(float(value))
    if isinstance(value, str):
        return _string(value)
    if isinstance(value, Iterable) and not isinstance(value, bytes | dict):
        return f'[{", ".join(yaml_text(entry) for entry in value)}]'
    return str(value)


def _double(value: float) -> str:
    if math.isnan(value):
        return '.nan'
    if math.isinf(value):
        return '.inf' if value > 0 else '-.inf'
    return repr(value)


def _string(value: str) -> str:
    if _PLAIN.fullmatch(value) and isinstance(typed(value), str):
        return value
    quoted: str = yaml.safe_dump(value, default_style='"', width=math.inf)
    return quoted.rstrip('\n')
