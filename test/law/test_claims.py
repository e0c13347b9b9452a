# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Claims of the pages of the laws: searches for counterexamples, and proofs for whole ranges."""

from __future__ import annotations

from collections.abc import Sequence

from claims import (
    BY_SOURCE,
    Claim,
    CLAIMS,
    INSIDE,
    momentum_observer,
    OUTSIDE,
    radius,
    SHARP,
    SIMULATION,
    task_feedback,
    THEORY,
    time_delay,
)
from masmc_ros.law import registry
from mpmath import iv
import numpy as np
import pytest
import sympy as sp

SAMPLE = 100
ALIAS = 'input_output_decoupling'
ALL = *CLAIMS, *THEORY
each_claim = pytest.mark.parametrize(
    'claim', ALL, ids=[f'{claim.page}_{k}' for k, claim in enumerate(ALL)]
)


def examine(claim: Claim, count: int, seed: int) -> None:
    values = claim.draw(count, seed)
    factor = np.random.default_rng(seed).uniform(0.02, INSIDE, count)
    # Half of the draws are next to the bound.
    factor[: count // 2] = INSIDE
    is_met = claim.holds(values, factor)
    places = np.flatnonzero(~is_met)[:1]
    drawn = [{name: float(v[k]) for name, v in values.items()} for k in places]
    assert is_met.all(), f'{claim.sentence}: not for {drawn}'
    for beyond in (SHARP, OUTSIDE):
        assert not claim.holds(values, np.full(count, beyond)).all(), claim.sentence


def test_samples_of_claims_have_counterexamples_outside_only() -> None:
    for claim in ALL:
        if claim.method != SIMULATION:
            examine(claim, SAMPLE, 1)


@pytest.mark.slow
@each_claim
def test_claim_has_counterexample_outside_only(claim: Claim) -> None:
    examine(claim, claim.draws, 2)


def test_every_law_has_claims() -> None:
    laws = list(dict.fromkeys(claim.page for claim in CLAIMS))
    known = [law for law in registry.LAWS if law != ALIAS]
    assert sorted(laws) == sorted(known)
    assert BY_SOURCE.keys() <= set(known)
    # Tables of pages group neighbours.
    grouped = [claim.page for law in laws for claim in CLAIMS if claim.page == law]
    assert [claim.page for claim in CLAIMS] == grouped


def test_twice_the_true_masses_is_unstable() -> None:
    """The limit that is often cited, at the default gains and 10 ms."""
    k_p, k_d, period, share, rate = np.array([[900.0], [60.0], [0.01], [1.96], [200.0]])
    assert radius(time_delay(k_p, k_d, period, share)) > 1.0
    assert radius(momentum_observer(k_p, k_d, period, share, rate)) > 1.0


def jury(matrix: sp.Matrix) -> list[sp.Expr]:
    """Return polynomials that are positive if and only if all eigenvalues are within 1."""
    z = sp.Symbol('z')
    coefficients = matrix.charpoly(z).all_coeffs()
    at_one, at_minus = (sum(c * x**k for k, c in enumerate(reversed(coefficients)))
                        for x in (1, -1))  # fmt: skip
    last = coefficients[-1]
    if len(coefficients) == 3:
        return [at_one, at_minus, 1 - last]
    second, third = coefficients[1], coefficients[2]
    outer, inner = 1 - last**2, third - last * second
    return [at_one, -at_minus, 1 - last, 1 + last, outer - inner, outer + inner]


def prove(conditions: Sequence[sp.Expr], boxes: dict[sp.Symbol, tuple[float, float]]) -> int:
    """Prove that conditions are positive in a box, by intervals; return the number of boxes."""
    symbols = list(boxes)
    functions = [sp.lambdify(symbols, sp.factor(c), [{}]) for c in conditions]
    waiting, count = [list(boxes.values())], 0
    while waiting:
        box = waiting.pop()
        count += 1
        assert count < 60_000, box
        intervals = [iv.mpf([low, high]) for low, high in box]
        if all((f(*intervals) > 0) is True for f in functions):
            continue
        middles = [0.5 * (low + high) for low, high in box]
        values = [float(f(*middles)) for f in functions]
        assert min(values) > 0.0, f'counterexample {middles}'
        # The longest side, relative to that of the whole box.
        side = max(range(len(box)), key=lambda k: (box[k][1] - box[k][0]) / (
            boxes[symbols[k]][1] - boxes[symbols[k]][0]))  # fmt: skip
        for half in ((box[side][0], middles[side]), (middles[side], box[side][1])):
            waiting.append([*box[:side], half, *box[side + 1:]])
    return count


def sampled(command: Sequence[sp.Expr]) -> list[list[sp.Expr]]:
    """Return the rows of (x, T v) for T² a as a function of (x, T v, ...)."""
    size = len(command)
    start = [[1, 1, *[0] * (size - 2)], [0, 1, *[0] * (size - 2)]]
    parts = (sp.Rational(1, 2), 1)
    return [[b + part * c for b, c in zip(row, command, strict=True)]
            for row, part in zip(start, parts, strict=True)]  # fmt: skip


k, r, a, u = sp.symbols('k r a u', positive=True)


def test_symbolic_matrices_have_polynomials_of_claims() -> None:
    k_p, k_d, period, share = 40.0, 9.0, 0.1, 0.7
    numbers = {k: k_d * period, r: k_p * period / k_d, a: share}
    of_delay = sampled([-a * r * k, -a * k, 1 - a])
    of_delay.append([-a * r * k, -a * k, 1 - a])
    for rows, matrix in (
        (sampled([-r * k, -k]), task_feedback(*np.array([[k_p], [k_d], [period]]))),
        (of_delay, time_delay(*np.array([[k_p], [k_d], [period], [share]]))),
    ):
        symbolic = np.array(sp.Matrix(rows).subs(numbers), float)
        assert np.poly(symbolic) == pytest.approx(np.poly(matrix[0]), rel=1e-9)


@pytest.mark.slow
def test_loop_is_stable_in_whole_range() -> None:
    """No draw can miss a gap: the conditions hold in every box of a subdivision."""
    # K_d T from 0.01 to 1.96, K_p T / K_d from 0.01 to 1.96.
    assert prove(jury(sp.Matrix(sampled([-r * k, -k]))), {k: (0.01, 1.96), r: (0.01, 1.96)})
    lower, upper = r / (1 + r / 2), 4 / (2 + k)
    least, most = lower * sp.Rational(51, 50), upper * sp.Rational(49, 50)
    rows = sampled([-a * r * k, -a * k, 1 - a])
    rows.append([-a * r * k, -a * k, 1 - a])
    conditions = [c.subs(a, least + u * (most - least)) for c in jury(sp.Matrix(rows))]
    assert prove(conditions, {k: (0.05, 1.0), r: (0.01, 0.5), u: (0.0, 1.0)})
