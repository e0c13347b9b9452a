# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""JSON of results: one representation of numbers, paths and arrays for all commands."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

_NOT_FINITE = {math.inf: 'Infinity', -math.inf: '-Infinity'}


def json_text(value: object) -> str:
    """
    Return a value as JSON with all digits.

    Numbers that JSON lacks are the texts `NaN`, `Infinity` and `-Infinity`, which `float` of
    Python and `Number` of JavaScript read. `null` stands for a value that does not exist.
    """
    return json.dumps(_plain(value), indent=1, allow_nan=False)


def with_sizes(paths: Iterable[Path], *, as_json: bool) -> str:
    """Return written files and their sizes in bytes: a line each, or JSON."""
    sizes = {path: path.stat().st_size for path in paths}
    if as_json:
        return json_text({'files': [{'file': p, 'bytes': n} for p, n in sizes.items()]})
    return '\n'.join(f'{path}: {size} bytes' for path, size in sizes.items())


def _plain(value: Any) -> Any:
    """Return a value that consists of dictionaries, lists, texts, numbers and None."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, float) and not math.isfinite(value):
        return _NOT_FINITE.get(value, 'NaN')
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, Iterable):
        return [_plain(entry) for entry in value]
    raise TypeError(f'{type(value).__name__} has no representation in JSON')
