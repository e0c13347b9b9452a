# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Random values of parameters, as a function of the number of a run.

A draw has no state, so the values of a run do not depend on the batch or on the order of runs. In
random sampling, run k uses number k of a stream (Philox), which the seed and the name of the
parameter determine; other draws do not change it. In Sobol sampling, run k uses point k of a
scrambled sequence with one dimension per draw.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import hashlib
import math
from types import ModuleType
from typing import Any, NamedTuple
import warnings

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError, suggestion
from masmc_ros.params.declaration import Parameter
from masmc_ros.params.text import typed
import numpy as np

FORM = 'NAME=DISTRIBUTION:NUMBER:NUMBER, such as robot.link_2_mass=uniform:0.6:1.4'

_MANTISSA, _SPACING = 11, 2.0**-53
"""Bits of 64 that do not fit into a double, and the spacing of the resulting numbers."""

_SOBOL_BITS = 30
_WORDS = 4
"""Numbers that Philox gives for a value of its counter."""


class Distribution(NamedTuple):
    """
    Distribution of SciPy for a name of the command line.

    `arguments` are the names of its numbers. `condition` returns True for valid numbers, and
    `expected` describes them in messages.
    """

    arguments: tuple[str, ...]
    frozen: Callable[..., Any]
    """Function of `_stats` and the arguments."""
    condition: Callable[..., bool]
    expected: str


class Uniform(NamedTuple):
    """Uniform distribution, bitwise that of SciPy, whose import takes long."""

    low: float
    width: float

    def ppf(self, part: Array) -> Array:
        """Return the quantiles of probabilities."""
        return part * self.width + self.low

    def median(self) -> float:
        """Return the median."""
        return 0.5 * self.width + self.low

    def support(self) -> tuple[float, float]:
        """Return the smallest and the largest value."""
        return self.low, self.width + self.low


def _stats() -> ModuleType:
    from scipy import stats

    return stats


DISTRIBUTIONS = {
    'uniform': Distribution(
        ('LOW', 'HIGH'), lambda stats, a, b: Uniform(a, b - a), lambda a, b: a < b,
        'LOW < HIGH',
    ),
    'loguniform': Distribution(
        ('LOW', 'HIGH'), lambda stats, a, b: stats().loguniform(a, b), lambda a, b: 0.0 < a < b,
        '0 < LOW < HIGH',
    ),
    'normal': Distribution(
        ('MEAN', 'STD'), lambda stats, m, s: stats().norm(m, s), lambda m, s: s > 0.0, 'STD > 0',
    ),
    'truncnormal': Distribution(
        ('MEAN', 'STD', 'LOW', 'HIGH'),
        lambda stats, m, s, a, b: stats().truncnorm((a - m) / s, (b - m) / s, m, s),
        lambda m, s, a, b: s > 0.0 and a < b,
        'STD > 0 and LOW < HIGH',
    ),
    'integers': Distribution(
        ('LOW', 'HIGH'), lambda stats, a, b: stats().randint(a, b + 1),
        lambda a, b: a <= b and float(a).is_integer() and float(b).is_integer(),
        'whole numbers LOW <= HIGH',
    ),
}  # fmt: skip
"""Distributions by name."""


class Draw(NamedTuple):
    """Parameter with the distribution of its values, a key of DISTRIBUTIONS, and its numbers."""

    name: str
    distribution: str
    arguments: tuple[float, ...]

    @property
    def text(self) -> str:
        """Return the draw as a text of `--draw`."""
        return f'{self.name}={":".join([self.distribution, *map(repr, self.arguments)])}'

    @property
    def frozen(self) -> Any:
        """Return the distribution, as a frozen one of SciPy."""
        return DISTRIBUTIONS[self.distribution].frozen(_stats, *self.arguments)


def draw(text: str) -> Draw:
    """Return the draw of a text of `--draw`, see FORM; InputError for an invalid text."""
    place = f'--draw {text}'
    name, _, values = text.partition('=')
    kind, *parts = values.split(':')
    if not name or not values:
        raise InputError(f'{place}: expected {FORM}')
    if kind not in DISTRIBUTIONS:
        raise InputError(
            f"{place}: unknown distribution '{kind}'; {suggestion(kind, DISTRIBUTIONS)}"
        )
    known = DISTRIBUTIONS[kind]
    numbers = [typed(part) for part in parts]
    arguments = tuple(
        float(number)
        for number in numbers
        if isinstance(number, int | float) and not isinstance(number, bool)
        and math.isfinite(number)
    )
    form = ':'.join([kind, *known.arguments])
    if len(arguments) < len(numbers) or len(numbers) != len(known.arguments):
        raise InputError(f'{place}: expected NAME={form}')
    if not known.condition(*arguments):
        raise InputError(f'{place}: expected {form} with {known.expected}')
    return Draw(name, kind, arguments)


def check_range(one: Draw, parameter: Parameter) -> None:
    """Raise InputError if a draw can give a value that the parameter does not accept."""
    low, high = map(float, one.frozen.support())
    for end in (low, high):
        is_valid = math.isinf(end) or parameter.bounds.contain(end)
        if math.isinf(end):
            bound = parameter.minimum if end < 0.0 else parameter.maximum
            is_valid = bound is None
        if not is_valid:
            raise InputError(
                f'--draw {one.text}: it can draw {end:g}, and {parameter.name} is '
                f'{parameter.expected}; expected a distribution within this range, such as '
                'uniform or truncnormal'
            )


def drawn_values(
    draws: Sequence[Draw], seed: int, first: int, count: int, *, sobol: bool
) -> list[Array]:
    """
    Return the values (count) of each draw in the runs `first` to `first + count - 1`.

    Parameters
    ----------
    draws
        Parameters with their distributions.
    seed
        Seed of all draws.
    first, count
        Number of the first run, and number of runs.
    sobol
        True for points of a Sobol sequence; otherwise each parameter has a separate stream.

    """
    if not draws:
        return []
    if sobol:
        parts = _sobol(len(draws), seed, first, count)
    else:
        parts = [_stream(f'{seed} {one.name}', first, count) for one in draws]
    return [
        np.asarray(one.frozen.ppf(part), np.float64)
        for one, part in zip(draws, parts, strict=True)
    ]


def _stream(key: str, first: int, count: int) -> Array:
    """Return numbers `first` to `first + count - 1` of a stream, uniform in (0, 1)."""
    digest = hashlib.sha256(key.encode()).digest()
    bits = np.random.Philox(key=int.from_bytes(digest[:16], 'little'))
    bits.advance(first // _WORDS)
    skipped = first % _WORDS
    raw = bits.random_raw(skipped + count)[skipped:]
    return np.asarray(((raw >> _MANTISSA) + 0.5) * _SPACING, np.float64)


def _sobol(dimensions: int, seed: int, first: int, count: int) -> list[Array]:
    """Return points `first` to `first + count - 1` of a sequence, (dimensions) of (count)."""
    from scipy.stats import qmc

    sequence = qmc.Sobol(dimensions, scramble=True, bits=_SOBOL_BITS, seed=seed)
    with warnings.catch_warnings():
        # SciPy warns of lengths that are no power of two, also for a part of such a sequence.
        warnings.simplefilter('ignore', UserWarning)
        if first:
            sequence.fast_forward(first)
        points = sequence.random(count)
    return list(points.T + 0.5**(_SOBOL_BITS + 1))
