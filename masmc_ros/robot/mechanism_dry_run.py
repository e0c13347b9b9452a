# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Dry run of a mechanism of another package: mistakes in one line with their place.

Every function of the interface is called in plain Python with example arguments, before it is
compiled. The annotations in `mechanism.py` select the arguments and contain the sizes of the
results. A successful dry run is noted next to the compiled code.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import FunctionType, NoneType
from typing import get_args, get_origin, get_type_hints

from masmc_ros.aliases import (
    Array,
    Axes,
    BasePose,
    Function,
    Joints,
    Numbers,
    Parameters,
    Positions,
)
from masmc_ros.errors import InputError, suggestion
from masmc_ros.jit.checked_lane import (
    check_decorators,
    check_vector,
    CheckedLane,
    function_of,
    run_dry_once,
    text_of,
)
from masmc_ros.jit.compiled import interpreted, is_interpreted
from masmc_ros.jit.field import Field, field_of
from masmc_ros.jit.generated import is_generated
from masmc_ros.jit.record import fill, new_record
from masmc_ros.jit.sources import closure, files_of
from masmc_ros.mistakes import MistakeError, place_and_text
from masmc_ros.params.declaration import Values
from masmc_ros.robot import mechanism as interface
from masmc_ros.robot.declaration import Mechanism, Outline
from masmc_ros.robot.formula_types import HasGeometry, LawMemory, LawSettings, Lengths
import numpy as np

_PACKAGE = str(Path(__file__).parents[1])

_COUNT = 2
"""Number of rows of arrays of examples."""

_FORMULAS: dict[str, Function] = {
    name: function
    for name, function in vars(interface).items()
    if isinstance(function, FunctionType) and is_generated(function)
}
"""Functions of `mechanism.py` in their order there; each result is known before it is used."""

_NAMES = (
    'MODEL', 'constants', 'start', 'out_of_reach', 'base_motion', 'frame_origins',
    'frame_transforms', 'description', 'outline',
    *(name for name, function in _FORMULAS.items() if not vars(function)['has_default']),
)  # fmt: skip
"""Names that every mechanism has."""


def check(mechanism: Mechanism, values: Values) -> None:
    """
    Call the functions of a mechanism in plain Python, and report mistakes.

    Mechanisms of this package are skipped, and sources that have passed before.

    Parameters
    ----------
    mechanism
        Type of robot.
    values
        Checked values of its parameters, without `robot.`.

    Raises
    ------
    InputError
        If the mechanism has a mistake; the message names file and line.

    """
    if not mechanism.module.startswith('masmc_ros.'):
        sources = files_of(mechanism.formulas)
        run_dry_once(lambda: run_dry(mechanism, values), sources, mechanism.tag)


def run_dry(mechanism: Mechanism, values: Values) -> None:
    """Run a mechanism in plain Python; arguments and errors are those of `check`."""
    module = mechanism.formulas
    own = files_of(module)
    files = {file for file in closure(own) if file in own or not file.startswith(_PACKAGE)}
    try:
        _check_names(mechanism)
        formulas = {name: vars(module)[name] for name in _FORMULAS if name in vars(module)}
        check_decorators(formulas.values(), files)
        for name, formula in formulas.items():
            _check_is_formula(name, formula)
        with interpreted(), np.errstate(all='ignore'):
            _run(mechanism, values, formulas)
    except Exception as error:  # of formulas with any mistake
        line = place_and_text(error, files, ', '.join(sorted(own)))
        raise InputError(f'robot.mechanism = {mechanism.name}: {line}') from error


def _check_names(mechanism: Mechanism) -> None:
    """Raise MistakeError if the module lacks a part of the interface, or its lengths differ."""
    module, known = mechanism.formulas, vars(mechanism.formulas)
    for name in _NAMES:
        if name not in known:
            raise MistakeError(
                f'{mechanism.module} has no {name!r}: expected all names of robot/mechanism.py, '
                f'{suggestion(name, [own for own in known if not own.startswith("_")])}'
            )
    fields = getattr(module.MODEL, '_fields', ())
    if len(fields) != len(mechanism.lengths):
        raise MistakeError(
            f'MODEL has the fields {", ".join(fields)}: expected {len(mechanism.lengths)}, one '
            f'for each of {", ".join(mechanism.lengths)}'
        )


def _check_is_formula(name: str, formula: object) -> None:
    function = function_of(formula)
    is_plain = not hasattr(formula, 'py_func') and not is_generated(function)
    if is_plain and not is_interpreted():
        code = function.__code__
        raise MistakeError(
            f'{code.co_filename}:{code.co_firstlineno}: {name} is an ordinary function; expected '
            'a function with @formula'
        )


def _run(mechanism: Mechanism, values: Values, formulas: Mapping[str, Function]) -> None:
    module, sizes = mechanism.formulas, mechanism.sizes
    lengths, theta = module.constants(values)
    check_vector('constants', tuple(lengths), sizes['lengths'], per='the lengths')
    check_vector('constants', tuple(theta), sizes['parameters'], per='theta')
    pose = (0.0,) * len(mechanism.start_names or mechanism.base)
    angles = mechanism.default('initial_joints', 'joints')
    position = module.start(values, pose, angles)
    check_vector('start', position, sizes['positions'], per='base, then joints')

    examples = _examples(mechanism, tuple(lengths), tuple(theta), position)
    for name, formula in formulas.items():
        *kinds, kind = get_type_hints(_FORMULAS[name], include_extras=True).values()
        result = formula(*(_example(argument, examples) for argument in kinds))
        _check_result(name, result, kind, mechanism)
        examples.setdefault(kind, result)
    _run_arrays(mechanism, values, np.array(lengths), position)


def _examples(
    mechanism: Mechanism, lengths: Numbers, theta: Numbers, position: Numbers
) -> dict[object, object]:
    """Return examples of arguments by their types; those of results follow."""
    sizes, tags = mechanism.sizes, {'mechanism': mechanism.tag}
    record = new_record((Field('geometry', 'lengths'),), sizes, 1, tags)
    fill(record, 'geometry', np.array(lengths))
    memory = new_record(tuple(LawMemory), sizes, 1, tags)
    axes, joints = (
        tuple(np.linspace(0.1, 0.3, sizes[size]).tolist()) for size in ('axes', 'joints')
    )
    return {
        HasGeometry: CheckedLane(record[0], 'record'),
        LawSettings: _settings(mechanism, theta),
        LawMemory: CheckedLane(memory[0], 'memory', is_writable=True),
        float: 1e-3,
        Axes: axes,
        BasePose: position[:sizes['base']],
        Joints: joints,
        Parameters: theta,
        Positions: position,
    }


def _size_of(kind: object) -> str:
    """Return the name in an annotated type, such as the size of a vector; '' without one."""
    return str(getattr(kind, '__metadata__', ('',))[0])


def _fields_of(kind: type) -> tuple[Field, ...]:
    """Return the fields of a record that has the attributes of a class."""
    hints = get_type_hints(kind, include_extras=True).items()
    return tuple(
        Field(name, _size_of(hint), kind='i8' if hint is int else 'f8') for name, hint in hints
    )


def _example(kind: object, examples: dict[object, object]) -> object:
    """Return an example of a type; that of a tuple has an example of each entry."""
    if get_origin(kind) is tuple:
        return tuple(_example(entry, examples) for entry in get_args(kind))
    return examples[kind]


def _check_result(name: str, result: object, kind: object, mechanism: Mechanism) -> None:
    """Raise MistakeError unless a result has the size that the annotation `kind` names."""
    model, size = mechanism.formulas.MODEL, _size_of(kind)
    if size in mechanism.sizes:
        check_vector(name, result, mechanism.sizes[size], per=f'the {size}')
    elif result is None and kind is not NoneType:
        raise MistakeError(f'{name} returns nothing: expected a result')
    elif kind == Lengths and not isinstance(result, model):
        raise MistakeError(f'{name} returns {text_of(result)}: expected {model.__name__}')
    elif get_origin(kind) is tuple:
        entries = result if isinstance(result, tuple) else ()
        kinds = get_args(kind)
        if kinds[-1] is Ellipsis:
            kinds = kinds[:1] * len(entries)
        if not entries or len(entries) != len(kinds):
            raise MistakeError(
                f'{name} returns {text_of(result)}: expected a tuple of {len(kinds) or "vectors"}'
            )
        for number, (entry, of_entry) in enumerate(zip(entries, kinds, strict=True)):
            _check_result(f'{name}, entry {number},', entry, of_entry, mechanism)


def _settings(mechanism: Mechanism, theta: tuple[float, ...]) -> CheckedLane:
    """Return example settings of a law with all fields that formulas of mechanisms read."""
    own = (field_of(parameter) for parameter in mechanism.law_parameters)
    fields = (*_fields_of(LawSettings), *(field for field in own if field is not None))
    record = new_record(fields, mechanism.sizes, 1, {'mechanism': mechanism.tag})
    fill(record, 'nominal', np.array(theta))
    fill(record, 'gamma', 1.0)
    fill(record, 'period', 1e-3)
    return CheckedLane(record[0], 'settings')


def _run_arrays(
    mechanism: Mechanism, values: Values, lengths: Array, position: tuple[float, ...]
) -> None:
    """Call the functions of arrays and texts."""
    module, sizes, frames = mechanism.formulas, mechanism.sizes, len(mechanism.frames)
    positions, velocities = np.tile(position, (_COUNT, 1)), np.zeros((_COUNT, sizes['positions']))
    unreachable = module.out_of_reach(lengths, np.full((_COUNT, sizes['axes']), 0.1))
    if unreachable is not None and np.shape(unreachable) != (2,):
        raise MistakeError(
            f'out_of_reach returns {text_of(unreachable)}: expected a row and a reason, or None'
        )
    origins = module.frame_origins(lengths)
    _check_shape('frame_origins', origins, frames, 3)
    transforms = module.frame_transforms(origins, positions)
    _check_shape('frame_transforms', transforms, _COUNT, frames, 7)
    poses, twists = module.base_motion(positions, velocities)
    _check_shape('base_motion, poses,', poses, _COUNT, 7)
    _check_shape('base_motion, twists,', twists, _COUNT, 6)
    whole = {f'robot.{name}': value for name, value in values.items()}
    urdf = module.description(whole, [joint.name for joint in mechanism.joints], '')
    if not isinstance(urdf, str):
        raise MistakeError(f'description returns {text_of(urdf)}: expected the text of a URDF')
    drawing = module.outline(lengths, np.array(position))
    if not isinstance(drawing, Outline):
        raise MistakeError(f'outline returns {text_of(drawing)}: expected an Outline')


def _check_shape(name: str, array: Array, *shape: int) -> None:
    if np.shape(array) != shape:
        raise MistakeError(f'{name} returns the shape {np.shape(array)}: expected {shape}')
