# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Parts of networks and fuzzy systems: overlapping sets on [-1, 1], and rules.

The memberships of a number in all sets of a kind add up to one; beyond the outermost centres the
number belongs to the outermost sets. A system of two inputs has a rule, a weight, for each pair of
sets. Its output is the mean of the rules, weighted by the memberships of the pairs.
"""

from __future__ import annotations

from masmc_ros.aliases import Array, Columns, Numbers
from masmc_ros.jit.compiled import formula, kernel
from masmc_ros.jit.tuples import elementwise, from_index
from masmc_ros.numerics.portable_math import exp

FIVE = (-1.0, -0.5, 0.0, 0.5, 1.0)
"""Centres of the sets of each of two inputs."""

SEVEN = (-1.0, -2.0 / 3.0, -1.0 / 3.0, 0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0)
"""Centres of the sets of a single input: negative big, medium, small, zero, ..."""

RULES = len(FIVE) * len(FIVE)
"""Number of rules per output of a system with two inputs of FIVE sets."""


@formula
def _within(x: float) -> float:
    return 1.0 if x > 1.0 else (-1.0 if x < -1.0 else x)


@formula
def _bell(centre: float, x: float, spacing: float) -> float:
    """Return a Gaussian with half the distance of the centres as standard deviation."""
    z = (x - centre) / spacing
    return exp(-2.0 * z * z)


@formula
def _part(value: float, total: float) -> float:
    return value / total


@formula
def gaussian(x: float, centres: Numbers) -> Numbers:
    """Return the memberships of x in normalised Gaussians at equidistant, increasing centres."""
    degrees = elementwise(_bell, centres, _within(x), centres[1] - centres[0])
    total = 0.0
    for value in degrees:
        total += value
    return elementwise(_part, degrees, total)


@formula
def _hat(centre: float, x: float, spacing: float) -> float:
    height = 1.0 - abs(x - centre) / spacing
    return height if height > 0.0 else 0.0


@formula
def triangular(x: float, centres: Numbers) -> Numbers:
    """Return the memberships of x in triangles at equidistant, increasing centres."""
    return elementwise(_hat, centres, _within(x), centres[1] - centres[0])


@formula
def alone(value: float) -> Numbers:
    """Return the memberships of the second input of a system that has a single input."""
    return (1.0,)


@formula
def _output(arguments: tuple[Array, Columns, Columns], i: int) -> float:
    weights, first, second = arguments
    columns = len(second[0])
    place = i * len(first[0]) * columns
    total = 0.0
    for j in range(len(first[0])):
        for k in range(columns):
            total += first[i][j] * second[i][k] * weights[place + j * columns + k]
    return total


@kernel
def mean_of_rules(weights: Array, first: Columns, second: Columns) -> Numbers:
    """
    Return the output of each system: the mean of its rules, weighted by memberships.

    Parameters
    ----------
    weights
        Rules (outputs * rules), output by output. The rules of an output are in the order
        of its pairs of sets, with the sets of the second input innermost.
    first, second
        For each output, the memberships of its two inputs.

    """
    return from_index(_output, first, (weights, first, second))


@kernel
def train_rules(
    weights: Array, first: Columns, second: Columns, step: Numbers, pull: float
) -> None:
    """
    Change rules in place: W <- (W + step phi) / (1 + pull).

    phi is the product of the memberships of the pair of a rule.

    Parameters
    ----------
    weights
        Rules (outputs * rules), output by output, as those of `mean_of_rules`.
    first, second
        For each output, the memberships of its two inputs.
    step
        For each output, the change of a rule with membership one.
    pull
        Share by which all rules return to zero; 0: they do not.

    """
    place = 0
    for i in range(len(step)):
        for j in range(len(first[0])):
            for k in range(len(second[0])):
                moved = weights[place] + step[i] * first[i][j] * second[i][k]
                weights[place] = moved / (1.0 + pull)
                place += 1


@formula
def learning_step(s: float, rate: float, period: float) -> float:
    """Return T rate s, the step of a rule that grows at a rate times s for one period."""
    return period * rate * s
