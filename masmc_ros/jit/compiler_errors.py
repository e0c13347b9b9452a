# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Errors of the compiler in one line.

Numba's errors are pages long: they contain an error for each function on the way to the cause,
with the types of all arguments. The cause follows the last heading, with its place.
"""

from __future__ import annotations

from pathlib import Path
import re

from masmc_ros.errors import InputError
from numba.core import errors

COMPILER_ERRORS: tuple[type[Exception], ...] = (
    errors.NumbaError,
    # Older versions raise a NumbaError in its place.
    getattr(errors, 'UnsupportedBytecodeError', errors.NumbaError),
)

_HEADING = re.compile(r'Failed in \w+ mode pipeline')
_PLACE = re.compile(r'File "(.+)", line (\d+)')
_COLOURS = re.compile(r'\x1b\[[0-9;]*m')


def explained(error: Exception) -> InputError:
    """Return the cause of an error of the compiler, with its file, line and source."""
    lines = [line.strip() for line in _COLOURS.sub('', str(error)).splitlines() if line.strip()]
    starts = [k for k, line in enumerate(lines) if _HEADING.search(line)]
    lines = lines[starts[-1] + 1:] if starts else lines
    cause = lines[0] if lines else type(error).__name__
    if cause.endswith('found for signature:') and len(lines) > 1:
        cause = f'{cause} {lines[1].removeprefix(">>> ")}'
    place, source = '', ''
    places = [(k, match) for k, line in enumerate(lines) if (match := _PLACE.search(line))]
    if places:
        first, match = places[0]
        end = places[1][0] if len(places) > 1 else len(lines)
        place = f'{Path(match[1]).resolve()}:{match[2]}: '
        carets = (k for k in range(first + 1, end) if set(lines[k]) <= {'^', '~'})
        source = next((f' in: {lines[k - 1]}' for k in carets), '')
    return InputError(f'{place}cannot be compiled: {cause}{source}')
