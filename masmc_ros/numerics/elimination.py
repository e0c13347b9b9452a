# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Linear systems with a symmetric positive definite matrix."""

from __future__ import annotations

from masmc_ros.aliases import Array
from masmc_ros.jit.compiled import formula, kernel

_NO_PIVOT = 1.0e300


@formula
def solve_definite(n: int, work: Array) -> None:
    """
    Solve A x = b in place: `work` (n, n + 1) is [A, b] on entry, with x in place of b on return.

    The method is elimination without pivoting. If A is only semi-definite, entries of x with a
    pivot that is not positive are zero.
    """
    for i in range(n):
        pivot = work[i, i] if work[i, i] > 0.0 else _NO_PIVOT
        work[i, i] = pivot
        for k in range(i + 1, n):
            factor = work[k, i] / pivot
            for j in range(i, n + 1):
                work[k, j] -= factor * work[i, j]
    for reverse in range(n):
        i = n - 1 - reverse
        value = work[i, n]
        for j in range(i + 1, n):
            value -= work[i, j] * work[j, n]
        work[i, n] = value / work[i, i]


@formula
def solve_band(band: Array, right: Array) -> None:
    """
    Solve A X = B in place: `right` (n, m) is B on entry and X on return.

    A is positive definite; `band` (n, width) contains its diagonals from the main one to the
    right, band[i, d] = A[i, i + d]. The function overwrites `band`.
    """
    n, width, columns = band.shape[0], band.shape[1], right.shape[1]
    for i in range(n):
        for d in range(1, min(width, n - i)):
            factor = band[i, d] / band[i, 0]
            for e in range(d, min(width, n - i)):
                band[i + d, e - d] -= factor * band[i, e]
            for j in range(columns):
                right[i + d, j] -= factor * right[i, j]
    for reverse in range(n):
        i = n - 1 - reverse
        for j in range(columns):
            value = right[i, j]
            for d in range(1, min(width, n - i)):
                value -= band[i, d] * right[i + d, j]
            right[i, j] = value / band[i, 0]


@kernel
def factor(matrix: Array) -> None:
    """Factor a symmetric matrix (n, n) into L D L', in place, L below the diagonal D."""
    for row in range(len(matrix)):
        for column in range(row):
            entry = matrix[row, column]
            for k in range(column):
                entry -= matrix[row, k] * matrix[column, k]
            matrix[row, column] = entry
        pivot = matrix[row, row]
        for column in range(row):
            scaled = matrix[row, column]
            part = scaled / matrix[column, column]
            pivot -= part * scaled
            matrix[row, column] = part
        matrix[row, row] = pivot


@kernel
def solve(factored: Array, x: Array) -> None:
    """Solve L D L' x = b in place: `x` (n) is b on entry."""
    size = len(factored)
    for row in range(size):
        value = x[row]
        for k in range(row):
            value -= factored[row, k] * x[k]
        x[row] = value
    for row in range(size):
        x[row] /= factored[row, row]
    for row in range(size - 1, -1, -1):
        value = x[row]
        for k in range(row):
            x[k] -= factored[row, k] * value
