# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
What networks and fuzzy systems are made of: overlapping sets on [-1, 1], and rules.

Degrees of membership of all sets of a kind add up to one, for any number: beyond the outermost
centres it belongs to the outermost sets. A system of two inputs has a rule, a weight, for each
pair of sets; its output is the mean of the rules, each counting as far as its pair holds.
"""

from __future__ import annotations

from typing import Any

from masmc_ros.numerics.aliases import Numbers
from masmc_ros.numerics.compiled import formula, kernel
from masmc_ros.numerics.portable_math import exp
from masmc_ros.numerics.tuples import elementwise, from_index

FIVE = (-1.0, -0.5, 0.0, 0.5, 1.0)
"""Centres of the sets of each of two inputs."""

SEVEN = (-1.0, -2.0 / 3.0, -1.0 / 3.0, 0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0)
"""Centres of those of one alone: negative big, medium, small, zero, positive small, ..."""

RULES = len(FIVE) * len(FIVE)
"""Of a system with two inputs of FIVE sets, for each output."""


@formula
def _within(x: float) -> float:
    return 1.0 if x > 1.0 else (-1.0 if x < -1.0 else x)


@formula
def _bell(centre: float, x: float, spacing: float) -> float:
    """Return a Gaussian whose standard deviation is half of what the centres are apart."""
    z = (x - centre) / spacing
    return exp(-2.0 * z * z)


@formula
def _part(value: float, total: float) -> float:
    return value / total


@formula
def gaussian(x: float, centres: Numbers) -> Numbers:
    """Return how far x belongs to each of the normalised Gaussians at centres."""
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
    """Return how far x belongs to each of the triangles between centres."""
    return elementwise(_hat, centres, _within(x), centres[1] - centres[0])


@formula
def alone(value: float) -> Numbers:
    """Return the second input of a system that has one alone."""
    return (1.0,)


@formula
def _output(arguments: tuple[Any, int, Any, Any], i: int) -> float:
    weights, lane, first, second = arguments
    columns = len(second[0])
    place = i * len(first[0]) * columns
    total = 0.0
    for j in range(len(first[0])):
        for k in range(columns):
            total += first[i][j] * second[i][k] * weights[place + j * columns + k, lane]
    return total


@kernel
def mean_of_rules(weights: Any, lane: int, first: Any, second: Any) -> Numbers:
    """
    Return the outputs of systems.

    Parameters
    ----------
    weights
        all rules of the first output, of the second, ... (outputs * rules, lanes); those of an
        output in the order of its pairs of sets, the sets of the second input innermost.
    lane
        which run.
    first, second
        for each output, how far its two inputs belong to each of their sets.

    """
    return from_index(_output, first, (weights, lane, first, second))


@kernel
def train_rules(
    weights: Any, lane: int, first: Any, second: Any, step: Numbers, pull: float
) -> None:
    """
    Move rules: W <- (W + step phi) / (1 + pull).

    Parameters
    ----------
    weights, lane, first, second
        as of `mean_of_rules`.
    step
        for each output, what a rule that counts wholly changes by.
    pull
        part by which all rules fall back to zero.

    """
    place = 0
    for i in range(len(step)):
        for j in range(len(first[0])):
            for k in range(len(second[0])):
                moved = weights[place, lane] + step[i] * first[i][j] * second[i][k]
                weights[place, lane] = moved / (1.0 + pull)
                place += 1


@formula
def learning_step(s: float, rate: float, period: float) -> float:
    """Return the step of a rule that grows at a rate times s."""
    return period * rate * s
