# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Fuzzy sets and rules on [-1, 1], implemented in NumPy independently of the package."""

from __future__ import annotations

from helpers.robots import Array
import numpy as np

FIVE = np.linspace(-1.0, 1.0, 5)
SEVEN = np.linspace(-1.0, 1.0, 7)


def gaussians(x: Array, centres: Array) -> Array:
    """Return normalised Gaussians (inputs, sets) with a deviation of half a spacing."""
    deviation = (centres[1] - centres[0]) / 2.0
    distance = np.clip(x, -1.0, 1.0)[:, None] - centres
    g = np.exp(-0.5 * (distance / deviation) ** 2)
    normalised: Array = g / g.sum(axis=1, keepdims=True)
    return normalised


def triangles(x: Array, centres: Array) -> Array:
    """Return triangles: the weights of linear interpolation between the centres."""
    unit = np.eye(len(centres))
    return np.array([[np.interp(value, centres, row) for row in unit] for value in x])


def pairs(first: Array, second: Array) -> Array:
    """Return the products of all pairs (outputs, rules)."""
    return np.einsum('ij,ik->ijk', first, second).reshape(len(first), -1)
