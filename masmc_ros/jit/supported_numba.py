# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Supported versions of Numba; `setup.py` reads them here, before anything is installed.

`make test-oldest` runs with the oldest one, which Ubuntu 24.04 has, `make test` with the newest.
"""

OLDEST, FIRST_UNSUPPORTED = '0.58', '0.69'

OLDEST_OF_EXPORT = '0.62'
"""First version whose intermediate code can be compiled again for other processors."""


def version_numbers(text: str) -> tuple[int, ...]:
    """Return the first two numbers of a version, which compare as versions do."""
    return tuple(int(part) for part in text.split('.')[:2])
