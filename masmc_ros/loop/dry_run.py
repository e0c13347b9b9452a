# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Dry run of a law before its compilation: mistakes in one line with their place.

The errors of the compiler are pages long. A few ticks of the law in plain Python find most of the
mistakes earlier: unknown names, wrong sizes, missing results. Its lanes know the declared
fields and their sizes. A successful dry run is noted next to the compiled code, so each source of
a law runs dry once per machine.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
import dis
from pathlib import Path
import traceback
from types import CodeType, FunctionType, ModuleType
from typing import Any

from masmc_ros.errors import InputError, suggestion
from masmc_ros.law.declared import declared_for
from masmc_ros.law.law import Law
from masmc_ros.law.reaching.reaching import Reaching
from masmc_ros.law.registry import parameters, REACHING
from masmc_ros.law.tick import tick_of
from masmc_ros.loop import records
from masmc_ros.loop.closed_loop import control_tick
from masmc_ros.numerics.aliases import AnyArray, Record
from masmc_ros.numerics.compiled import Formula, interpreted, is_interpreted, machine_code
from masmc_ros.numerics.generated import is_generated
from masmc_ros.numerics.lanes import Lane, lane_of
from masmc_ros.numerics.sources import files_of
from masmc_ros.robot import mechanism as formulas
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.robot import Robot
import numpy as np
from numpy.typing import ArrayLike

_PACKAGE = Path(__file__).parents[1]
_HIDDEN = _PACKAGE / 'numerics', Path(__file__)
"""Files in which mistakes of their callers appear."""

_PERIOD = 1e-3

_TICKS = 3
"""Number of ticks; the second one has a previous tick, the third a negative velocity."""


class _MistakeError(Exception):
    """Mistake of a law."""


class _Checked(Lane):
    """Lane that checks names and sizes, and that nothing is written into settings."""

    __slots__ = ('_is_writable', '_name')

    def __init__(self, record: Record, name: str, *, is_writable: bool) -> None:
        super().__init__(record, 0)
        object.__setattr__(self, '_name', name)
        object.__setattr__(self, '_is_writable', is_writable)

    def __setattr__(self, name: str, value: ArrayLike) -> None:
        shape = self._values(name).shape
        if not self._is_writable:
            raise _MistakeError(
                f'{self._name}.{name} is read-only; expected a field of the memory of the law'
            )
        if np.shape(value) != shape:
            raise _MistakeError(
                f'{self._name}.{name} = {_text(value)}: expected {_vector(*shape)}'
            )
        is_whole = self.dtype[name].base.kind == 'i'
        if is_whole and np.asarray(value).dtype.kind == 'f':
            raise _MistakeError(f'{self._name}.{name} = {_text(value)}: expected a whole number')
        super().__setattr__(name, value)

    def _values(self, name: str) -> AnyArray:
        known = [field for field in self.dtype.names if field.isidentifier()]
        if name not in known:
            raise _MistakeError(f'{self._name} has no {name!r}: {suggestion(name, known)}')
        return super()._values(name)


def _vector(count: int = 0) -> str:
    return f'a vector of {count} numbers' if count else 'one number'


def _text(value: Any) -> str:
    """Return a description of a value."""
    if value is None:
        return 'nothing'
    if np.shape(value):
        return f'a {type(value).__name__} of {len(value)}'
    return f'{type(value).__name__} {value}'


def check(law: Law, mechanism: Mechanism, switching: str) -> None:
    """
    Run a law dry, unless it has been run in these sources for this type of robot.

    Parameters
    ----------
    law
        Law, built in or of another package.
    mechanism
        Type of robot.
    switching
        Name of the reaching term.

    Raises
    ------
    InputError
        If the law has a mistake; the message names file and line.

    """
    # The interpreter reports mistakes with a traceback, and a debugger can stop there.
    if is_interpreted(control_tick):
        return
    tags = records.law_tag(law), mechanism.tag, switching if law.uses_switching else ''
    sources = files_of(law.formulas) | files_of(mechanism.formulas)
    if law.uses_switching:
        sources |= files_of(REACHING[switching].formulas)
    note = machine_code('dry', sources, *tags)
    if not note.exists():
        run_dry(law, mechanism, switching)
        with suppress(OSError):
            note.touch()


def run_dry(law: Law, mechanism: Mechanism, switching: str) -> None:
    """Run a law in plain Python for some ticks; arguments and errors are those of `check`."""
    term = REACHING[switching] if law.uses_switching else None
    own = [_function(formula) for part in (law, term) if part for formula in _formulas_of(part)]
    files = {function.__code__.co_filename for function in own}
    try:
        for function in own:
            _check_decorators(function, files, set())
        with interpreted(), np.errstate(all='ignore'):
            _run(law, mechanism, switching)
    except Exception as error:  # of formulas with any mistake
        raise InputError(f'law = {law.name}: {_line(error, files, own[0])}') from error


def _formulas_of(part: Law | Reaching) -> Iterator[Formula]:
    return iter(vars(part.formulas).values())


def _function(formula: Any) -> FunctionType:
    function: FunctionType = getattr(formula, 'py_func', formula)
    return function


def _robot(mechanism: Mechanism) -> Robot:
    """Return a robot of a type with the defaults of its parameters."""
    own = {p.name.removeprefix('robot.'): p.default for p in mechanism.parameters}
    lengths, theta = mechanism.formulas.constants(own)
    return Robot(mechanism, own, np.array(lengths), np.array(theta))


def _run(law: Law, mechanism: Mechanism, switching: str) -> None:
    robot = _robot(mechanism)
    settings = records.law_settings(mechanism, law, switching)
    memory, signals = records.law_memory(mechanism, law), records.signals(mechanism)
    declared = declared_for(mechanism, (*parameters(mechanism), *law.parameters))
    values = {parameter.name: parameter.default for parameter in declared}
    records.write_law(settings, robot, _PERIOD, values)
    records.write_parameters(settings, records.read_by(settings, mechanism, declared), values)
    memory['estimate'][0, :, 0] = robot.theta
    signals['position'][0, :, 0] = np.linspace(0.1, 0.9, signals['position'].shape[1])
    row, plain = lane_of(signals[0], 0), lane_of(settings[0], 0)
    gains = _Checked(settings[0], 'settings', is_writable=False)
    state = _Checked(memory[0], 'memory', is_writable=True)
    joints, axes = mechanism.sizes['joints'], mechanism.sizes['axes']
    model = formulas.model_of(plain)
    posture = formulas.posture(model, row.position)
    for k in range(_TICKS):
        signals['velocity'][0, :, 0] = 0.1 * (-1) ** k
        rates, reference = row.velocity[-joints:], row.reference
        desired = reference[:axes], reference[axes:2 * axes], reference[2 * axes:]
        v = formulas.motion(model, rates)
        before = Lane(memory[0], 0)
        carried = before.drift, before.velocity_command
        tick = tick_of(plain, posture, v, row.position, row.velocity, desired, *carried)
        raw = law.torque(gains, tick, state)
        is_vector = isinstance(raw, tuple) or (isinstance(raw, np.ndarray) and raw.ndim == 1)
        if not is_vector or len(raw) != joints:
            raise _MistakeError(
                f'torque returns {_text(raw)}: expected {_vector(joints)}, one per joint'
            )
        for torque in (raw, tuple(0.5 * value for value in raw)):
            law.learn(gains, tick, state, raw, torque)
        law.post_update(gains, state)


def _check_decorators(function: FunctionType, files: set[str], known: set[FunctionType]) -> None:
    """Raise a mistake if a formula of these files uses a function without decorator."""
    if function in known or function.__code__.co_filename not in files:
        return
    known.add(function)
    for name, line in _globals_of(function.__code__):
        value = function.__globals__.get(name)
        if isinstance(value, Formula):
            _check_decorators(_function(value), files, known)
        elif isinstance(value, FunctionType) and not is_generated(value):
            raise _MistakeError(
                f'{_place(function.__code__.co_filename, line)}: {name} is an ordinary function; '
                'expected a function with @formula'
            )


def _globals_of(code: CodeType) -> Iterator[tuple[str, int]]:
    """Yield the global names in a code, with their lines."""
    line = code.co_firstlineno
    for instruction in dis.get_instructions(code):
        line = instruction.starts_line or line
        if instruction.opname == 'LOAD_GLOBAL':
            yield str(instruction.argval), int(line)


def _line(error: Exception, files: set[str], first: FunctionType) -> str:
    """Return place and text of a mistake."""
    message = _message(error)
    if isinstance(error, _MistakeError) and any(message.startswith(file) for file in files):
        return message
    frames = [
        frame for frame in traceback.extract_tb(error.__traceback__)
        if not any(Path(frame.filename).is_relative_to(hidden) for hidden in _HIDDEN)
    ]
    own = [frame for frame in frames if frame.filename in files] or [
        frame for frame in frames if not Path(frame.filename).is_relative_to(_PACKAGE)
    ]
    for frame in (own or frames)[-1:]:
        return f'{_place(frame.filename, frame.lineno or 0)}: {message} in: {frame.line}'
    return f'{_place(first.__code__.co_filename, first.__code__.co_firstlineno)}: {message}'


def _place(file: str, line: int) -> str:
    return f'{file}:{line}'


def _message(error: Exception) -> str:
    """Return the text of a mistake, with the known names."""
    if isinstance(error, _MistakeError):
        return str(error)
    if isinstance(error, AttributeError) and error.name is not None:
        owner = error.obj
        if hasattr(owner, '_fields'):
            name, names = type(owner).__name__.lower(), owner._fields
        elif isinstance(owner, ModuleType):
            name, names = owner.__name__.rpartition('.')[2], _public(vars(owner))
        else:
            return f'{error}; vectors have no methods' if isinstance(owner, tuple) else str(error)
        if error.name in names:
            return f'{name}.{error.name} is read-only'
        return f'{name} has no {error.name!r}: {suggestion(error.name, names)}'
    if isinstance(error, NameError) and error.name is not None:
        return f'{error.name} is not defined; expected an import or a declaration'
    text = f'{type(error).__name__}: {error}'
    is_arithmetic = isinstance(error, TypeError) and any(
        word in str(error) for word in ('operand', 'sequence', 'concatenate', 'tuple')
    )
    return f'{text}; elementwise(formula, a, b) computes with vectors' if is_arithmetic else text


def _public(names: Iterable[str]) -> list[str]:
    return [name for name in names if not name.startswith('_')]
