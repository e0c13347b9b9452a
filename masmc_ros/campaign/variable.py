# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Parameters that differ between the runs of a campaign: axes with their values, and random draws.

A draw has no state, so the values of a run do not depend on the batch or on the order of runs. In
random sampling, run k uses number k of a stream (Philox), which the seed and the name of the
parameter determine; other draws do not change it. In Sobol sampling, run k uses point k of a
scrambled sequence with one dimension per draw.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
import hashlib
from itertools import combinations
import math
import re
from types import ModuleType
from typing import Any, NamedTuple
import warnings

from masmc_ros.aliases import AnyArray, Array
from masmc_ros.errors import InputError, suggestion
from masmc_ros.loop.scenario import Scenario
from masmc_ros.params.declaration import MutableValues, Parameter, Value, Values
from masmc_ros.params.text import Scalar, typed, yaml_text
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.scenario.scenario import readers
import numpy as np

_ENTRY = re.compile(r'(.+)\[([0-9]+)\]')

_TYPES: dict[str, type[np.generic]] = {'bool': np.bool_, 'integer': np.int64, 'string': np.str_}
"""Types of columns by kind; the others are doubles."""


@dataclass(frozen=True)
class Variable:
    """
    Parameter of a scenario, or an entry of an array, that differs between runs.

    Attributes
    ----------
    name
        NODE.parameter or a shared parameter, as in `--set`; with [INDEX] an entry of an array.
    readers
        Declaration of the parameter by each node that reads it.
    index
        Index of the entry, from 0; None for a whole parameter.

    """

    name: str
    readers: Mapping[str, Parameter]
    index: int | None = None

    @classmethod
    def named(cls, name: str, mechanism: Mechanism, place: str) -> Variable:
        """
        Return the variable of a name.

        Parameters
        ----------
        name
            Name as in `--set`, with [INDEX] for an entry of an array.
        mechanism
            Type of the robot, which determines the known names.
        place
            Start of messages, such as the option.

        Raises
        ------
        InputError
            if no parameter has this name, or if it cannot vary.

        """
        entry = _ENTRY.fullmatch(name)
        variable = cls(
            name,
            readers(entry[1] if entry else name, mechanism, place),
            int(entry[2]) if entry else None,
        )
        parameter = variable.parameter
        if parameter.kind == 'strings' or (parameter.kind == 'string' and not parameter.choices):
            raise InputError(
                f'{place}: {parameter.name} is a text; expected a number, or a choice of several'
            )
        if parameter.name.startswith('robot.') and parameter.kind == 'string':
            raise InputError(f'{place}: expected the same type of robot in all runs')
        if variable.index is not None and variable.index >= (parameter.length or 0):
            expected = f'an index < {parameter.length}' if parameter.length else 'no index'
            raise InputError(f'{place}: {name}: expected {expected}')
        return variable

    @property
    def parameter(self) -> Parameter:
        """Return the declaration, which is the same for all nodes."""
        return next(iter(self.readers.values()))

    def overlaps(self, other: Variable) -> bool:
        """Return True if both variables write the same value of a node."""
        writes_all = None in (self.index, other.index)
        return (writes_all or self.index == other.index) and any(
            node in other.readers and other.readers[node].name == parameter.name
            for node, parameter in self.readers.items()
        )

    def checked(self, values: Values, parameter: Parameter, value: object) -> Value:
        """
        Return the checked value of the parameter for a node.

        Parameters
        ----------
        values
            Values of the node by name; they contain the other entries of an array.
        parameter
            Declaration of the parameter by the node.
        value
            Value of the variable.

        """
        if parameter.kind == 'integer' and isinstance(value, float) and value.is_integer():
            value = int(value)
        if self.index is not None:
            entries = list(values[parameter.name])
            entries[self.index] = value
            value = entries
        return parameter.check(value, integers_for_doubles=True)

    def column(self, values: Sequence[object]) -> AnyArray:
        """Return values of several runs as an array (runs) of the type of the parameter."""
        return np.array(values, _TYPES.get(self.parameter.kind, np.float64))

    def setting(self, scenario: Scenario) -> str:
        """Return the option `--set` that gives the parameter its value in a scenario."""
        node, parameter = next(iter(self.readers.items()))
        whole = self.name.partition('[')[0]
        return f'{whole}={yaml_text(scenario[node][parameter.name])}'


def with_variables(
    scenario: Scenario, variables: Sequence[Variable], values: Sequence[object]
) -> Scenario:
    """Return a scenario with values of variables; InputError if a node would reject one."""
    known = scenario.values
    nodes: dict[str, MutableValues] = {}
    for variable, value in zip(variables, values, strict=True):
        for node, parameter in variable.readers.items():
            if node in known:
                own = nodes.setdefault(node, dict(known[node]))
                own[parameter.name] = variable.checked(own, parameter, value)
    return scenario.with_nodes(nodes)


def check_distinct(variables: Sequence[Variable]) -> None:
    """Raise InputError if two variables write the same value: only one would apply."""
    for one, other in combinations(variables, 2):
        if one.name == other.name:
            raise InputError(f'{one.name}: varies twice; expected each parameter once')
        if one.overlaps(other):
            raise InputError(
                f'{one.name}, {other.name}: the same parameter varies twice; expected each'
                ' parameter of a node once'
            )


AXIS_FORM = 'NAME=LOW:HIGH:COUNT, NAME=LOW:HIGH:COUNT:log, or NAME=VALUE,VALUE,...'

_MOST = 1_000_000
"""Largest number of values of a range."""


class Axis(NamedTuple):
    """Parameter with the values that it takes, in their order."""

    name: str
    values: tuple[Scalar, ...]


def axis(text: str) -> Axis:
    """Return the axis of `--vary`, see AXIS_FORM; InputError for an invalid or empty one."""
    name, _, values = text.partition('=')
    if not name or not values:
        raise InputError(f'--vary {text}: expected {AXIS_FORM}')
    if ':' in values:
        return Axis(name, _range(f'--vary {text}', values.split(':')))
    listed = tuple(typed(value.strip()) for value in values.split(','))
    if '' in listed or len(set(listed)) < len(listed):
        raise InputError(f'--vary {text}: expected different values, separated by commas')
    return Axis(name, listed)


def _range(place: str, parts: list[str]) -> tuple[float, ...]:
    is_log = parts[3:] == ['log']
    numbers = [typed(part) for part in parts[:3]]
    is_form = len(parts) == 4 if is_log else len(parts) == 3
    if not is_form or not all(map(_is_number, numbers)) or not isinstance(numbers[2], int):
        raise InputError(f'{place}: expected {AXIS_FORM}')
    start, end, count = float(numbers[0]), float(numbers[1]), numbers[2]
    if not start < end or count < 2:
        raise InputError(f'{place}: empty range; expected LOW < HIGH and COUNT >= 2')
    if count > _MOST:
        raise InputError(f'{place}: {count} values; expected at most {_MOST}')
    if is_log and start <= 0.0:
        raise InputError(f'{place}: expected LOW > 0 for a logarithmic range')
    steps = count - 1
    if is_log:
        return (start, *(start * (end / start) ** (k / steps) for k in range(1, steps)), end)
    # The product first: whole numbers stay whole.
    return (start, *(start + (end - start) * k / steps for k in range(1, steps)), end)


def _is_number(value: Scalar) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


DRAW_FORM = 'NAME=DISTRIBUTION:NUMBER:NUMBER, such as robot.link_2_mass=uniform:0.6:1.4'

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
    """Return the draw of a text of `--draw`, see DRAW_FORM; InputError for an invalid text."""
    place = f'--draw {text}'
    name, _, values = text.partition('=')
    kind, *parts = values.split(':')
    if not name or not values:
        raise InputError(f'{place}: expected {DRAW_FORM}')
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
