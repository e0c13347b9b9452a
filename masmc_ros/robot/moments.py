# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Second moments of the mass of a body."""

from __future__ import annotations

from collections.abc import Sequence

from masmc_ros.aliases import Array
import numpy as np


def second_moments(inertia: Sequence[float] | Array) -> Array:
    """
    Return the second moments (3, 3) of the mass of a body in kg·m².

    `inertia` has its moments of inertia xx, yy, zz, xy, yz, zx about the same point. No eigenvalue
    is negative if a body has them.
    """
    xx, yy, zz, xy, yz, zx = inertia
    about = np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])
    moments: Array = 0.5 * np.trace(about) * np.eye(3) - about
    return moments
