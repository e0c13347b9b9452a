# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Sets and rules of fuzzy systems and networks on [-1, 1], written anew in NumPy."""

from __future__ import annotations

import numpy as np
from robots import Array

FIVE = np.linspace(-1.0, 1.0, 5)
SEVEN = np.linspace(-1.0, 1.0, 7)


def gaussians(x: Array, centres: Array) -> Array:
    """Return normalised Gaussians, deviation half a spacing; (inputs, sets)."""
    deviation = (centres[1] - centres[0]) / 2.0
    distance = np.clip(x, -1.0, 1.0)[:, None] - centres
    g = np.exp(-0.5 * (distance / deviation) ** 2)
    found: Array = g / g.sum(axis=1, keepdims=True)
    return found


def triangles(x: Array, centres: Array) -> Array:
    """Return triangles: what linear interpolation between the centres weighs them by."""
    unit = np.eye(len(centres))
    return np.array([[np.interp(value, centres, row) for row in unit] for value in x])


def pairs(first: Array, second: Array) -> Array:
    """Return products of all pairs, (outputs, rules)."""
    return np.einsum('ij,ik->ijk', first, second).reshape(len(first), -1)
