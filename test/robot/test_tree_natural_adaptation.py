# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Natural adaptation against linear algebra: update, and consistency of bodies."""

from __future__ import annotations

from fractions import Fraction

from hypothesis import given, settings
from hypothesis import strategies as st
from masmc_ros.robot.tree.link_inertia import pseudo_inertia
from masmc_ros.robot.tree.natural_adaptation import bounded, natural_step
from masmc_ros.robot.tree.spatial import MOMENTS, Moments
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]
MANY = settings(max_examples=1000)

finite = st.floats(allow_nan=False, allow_infinity=False)
gradients = st.tuples(*[finite] * 10)
seeds = st.integers(0, 2**32 - 1)


def body(seed: int) -> tuple[Array, Moments]:
    """Draw the pseudo-inertia of mass points at any scale, and its inertial parameters."""
    draw = np.random.default_rng(seed)
    masses = draw.uniform(0.1, 1.0, 8) * 10.0 ** draw.uniform(-3.0, 3.0)
    points = draw.normal(size=(8, 3)) * 10.0 ** draw.uniform(-2.0, 0.0, 3)
    points += draw.normal(size=3) * 0.3
    p = np.einsum('p,pi,pj->ij', masses, *[np.column_stack([points, np.ones(8)])] * 2)
    return p, moments_of(p)


def moments_of(p: Array) -> Moments:
    pairs = ((3, 3), (0, 3), (1, 3), (2, 3), (0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
    # The tuple has ten entries.
    # A tuple of a comprehension has no length for the type checker; there are ten pairs.
    entries: Moments = tuple(float(p[i, j]) for i, j in pairs)  # type: ignore[assignment]
    return entries


def gradient_of(seed: int) -> tuple[Array, Moments]:
    """Draw a symmetric gradient and its ten derivatives by the inertial parameters."""
    root = np.random.default_rng(seed).normal(size=(4, 4))
    matrix = root + root.T
    return matrix, moments_of(2.0 * matrix - np.diag(np.diag(matrix)))


def is_of_a_body(inertial_parameters: Moments) -> bool:
    """Return True if the pseudo-inertia of the parameters is exactly positive definite."""
    rows = pseudo_inertia(inertial_parameters)
    matrix = [[Fraction(float(entry)) for entry in row] for row in rows]
    for pivot in range(4):
        if matrix[pivot][pivot] <= 0:
            return False
        for row in range(pivot + 1, 4):
            part = matrix[row][pivot] / matrix[pivot][pivot]
            for column in range(4):
                matrix[row][column] -= part * matrix[pivot][column]
    return True


@MANY
@given(seeds, seeds, st.floats(-6.0, 6.0))
def test_natural_step_equals_dense_algebra(seed: int, other: int, exponent: float) -> None:
    p, inertial_parameters = body(seed)
    gradient, entries = gradient_of(other)
    trace = np.trace(gradient @ p)
    assert np.dot(inertial_parameters, entries) == pytest.approx(trace, rel=1e-9, abs=1e-9)
    values, vectors = np.linalg.eigh(p)
    # Any square root is valid; this one is symmetric.
    root = vectors * np.sqrt(values) @ vectors.T
    x = root @ gradient @ root
    length = np.linalg.norm(x)
    step = 10.0**exponent / length
    x *= min(step, 1.0 / length)
    expected = root @ np.linalg.inv(np.eye(4) + x + x @ x / 2.0) @ root
    updated = pseudo_inertia(natural_step(inertial_parameters, entries, step))
    scale = np.sqrt(np.diag(expected))
    assert np.abs(updated - expected).max() < 1e-9 * np.abs(expected).max()
    assert np.abs((updated - expected) / np.outer(scale, scale)).max() < 1e-7


@MANY
@given(seeds, seeds)
def test_natural_step_small_step_follows_natural_gradient(seed: int, other: int) -> None:
    p, inertial_parameters = body(seed)
    gradient, entries = gradient_of(other)
    change = p @ gradient @ p
    root = np.linalg.cholesky(p)
    step = 1.0e-5 / np.linalg.norm(root.T @ gradient @ root)
    rate = (pseudo_inertia(natural_step(inertial_parameters, entries, step)) - p) / step
    assert np.abs(rate + change).max() < 1e-4 * np.abs(change).max() + 1e-10 * p.max() / step


@MANY
@given(seeds, gradients, st.floats(0.0, allow_infinity=False))
def test_natural_step_any_gradient_keeps_consistency(
    seed: int, entries: Moments, step: float
) -> None:
    inertial_parameters = body(seed)[1]
    assert is_of_a_body(inertial_parameters)
    assert is_of_a_body(natural_step(inertial_parameters, entries, step))


@settings(max_examples=30)
@given(seeds, st.tuples(*[st.floats(-1.0, 1.0)] * 10), st.floats(0.0, 100.0))
def test_natural_step_500_steps_keep_consistency(seed: int, entries: Moments, step: float) -> None:
    inertial_parameters = body(seed)[1]
    for _ in range(500):
        inertial_parameters = natural_step(inertial_parameters, entries, step)
    assert np.all(np.isfinite(inertial_parameters))
    smallest = np.linalg.eigvalsh(pseudo_inertia(inertial_parameters))[0]
    assert smallest > -1e-14 * max(inertial_parameters)
    assert min(inertial_parameters[0], *inertial_parameters[4:7]) > 0.0


def test_natural_step_inconsistent_or_nan_changes_nothing() -> None:
    inertial_parameters = body(1)[1]
    assert natural_step(MOMENTS, gradient_of(1)[1], 0.1) == MOMENTS
    flat = (1.0, 0.0, 0.0, 0.0, 0.1, 0.1, 0.0, 0.0, 0.0, 0.0)
    assert natural_step(flat, gradient_of(1)[1], 0.1) == flat
    for bad in (float('nan'), float('inf')):
        assert natural_step(inertial_parameters, (bad,) + (0.0,) * 9, 0.1) == inertial_parameters
    after = natural_step(inertial_parameters, MOMENTS, 0.1)
    assert after == pytest.approx(inertial_parameters, rel=1e-13)


def test_natural_step_half_of_masses_converges_to_true_body() -> None:
    p, true = body(3)
    inertial_parameters = tuple(moment / 2.0 for moment in true)
    back, rows = np.linalg.inv(np.linalg.cholesky(p)), []
    for seed in range(40):
        # Motions that excite all parameters equally, in the scale of the body.
        alike = back.T @ gradient_of(seed)[0] @ back
        rows.append(np.array(moments_of(2.0 * alike - np.diag(np.diag(alike)))) / 5.0)
    before = np.linalg.norm(rows @ np.array(inertial_parameters) - rows @ np.array(true))
    for i in range(4_000):
        # Half of the gradient of the squared measurement error.
        error = rows[i % 40] @ np.subtract(inertial_parameters, true)
        gradient = tuple((rows[i % 40] * error).tolist())
        inertial_parameters = natural_step(inertial_parameters, gradient, 0.5)
    after = np.linalg.norm(rows @ np.array(inertial_parameters) - rows @ np.array(true))
    assert after < 1e-6 * before
    assert inertial_parameters == pytest.approx(true, rel=1e-4)


@MANY
@given(seeds, seeds, st.floats(1.0, 10.0))
def test_bounded_body_is_scaled_to_bound(
    seed: int, other: int, upper: float
) -> None:
    (_, inertial_parameters), (_, nominal) = body(seed), body(other)
    scaled = np.array(bounded(inertial_parameters, nominal, upper))
    part = scaled[0] / inertial_parameters[0]
    assert scaled == pytest.approx(part * np.array(inertial_parameters), rel=1e-12)
    assert part <= 1.0
    ratio = max(scaled[0] / nominal[0], scaled[4:7].sum() / sum(nominal[4:7])) / upper
    assert ratio <= 1.0 + 1e-12
    # The body is scaled by no more than necessary.
    assert part == 1.0 or ratio >= 1.0 - 1e-12
