# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Dry run of a mechanism of another package: mistakes in one line with their place.

Every function of the interface is called in plain Python with example arguments, before it is
compiled. A successful dry run is noted next to the compiled code.
"""

from __future__ import annotations

from pathlib import Path

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError, suggestion
from masmc_ros.jit.checked_lane import (
    check_decorators,
    check_vector,
    CheckedLane,
    function_of,
    run_dry_once,
    text_of,
)
from masmc_ros.jit.compiled import interpreted
from masmc_ros.jit.field import Field, field_of
from masmc_ros.jit.generated import is_generated
from masmc_ros.jit.record import fill, new_record
from masmc_ros.jit.sources import closure, files_of
from masmc_ros.mistakes import MistakeError, place_and_text
from masmc_ros.params.declaration import Values
from masmc_ros.robot.declaration import Mechanism, Outline
import numpy as np

_PACKAGE = str(Path(__file__).parents[1])

_SETTINGS = (
    Field('nominal', 'parameters'),
    Field('period'),
    Field('takes_rates', kind='i8'),
    Field('gamma', 'parameters'),
    Field('projection_lower'),
    Field('projection_upper'),
)
"""Fields of `formula_types.LawSettings`."""

_COUNT = 2
"""Number of rows of arrays of examples."""

_RESULTS = {
    'posture': ('position', ''),
    'posture_of_joints': ('angles', ''),
    'motion': ('rates', 'joints'),
    'joint_rates': ('motion', 'joints'),
    'joint_torques': ('forces', 'joints'),
    'forces': ('torques', 'joints'),
    'position_rates': ('posture rates', 'positions'),
    'task_position': ('posture position', 'axes'),
    'task_velocity': ('posture motion', 'axes'),
    'task_error': ('posture position task', 'axes'),
    'tracking': ('posture position motion desired', ''),
    'motion_from_task': ('posture task motion', 'joints'),
    'forces_from_task': ('posture task motion', 'joints'),
    'reference_motion': ('posture position motion task task', ''),
    'motion_error': ('posture motion motion task', 'joints'),
    'regressor': ('posture motion motion motion', ''),
    'regressor_times': ('regressor theta', 'joints'),
    'regressor_transpose_times': ('regressor motion theta', 'parameters'),
    'inertia': ('posture theta', ''),
    'inertia_times': ('inertia motion', 'joints'),
    'inertia_solve': ('inertia forces', 'joints'),
    'coriolis': ('posture theta motion', 'joints'),
    'task_inertia': ('posture theta task', ''),
    'joint_accelerations': ('posture theta rates torques', 'joints'),
    'weakest_motion': ('theta', ''),
    'consistency_normal': ('direction theta', 'parameters'),
    'rate_command': ('motion', 'joints'),
    'commanded_joint_rates': ('command', 'joints'),
    'dead_reckoned': ('pose rates', 'base'),
    'counts_turns': ('rates', ''),
    'theta_step': ('settings theta theta period', 'parameters'),
    'preserves_consistency': ('settings', ''),
}
"""Arguments after the lengths, and size of the result; in an order in which results are known."""

_FUNCTIONS = (
    'constants', 'start', 'out_of_reach', 'base_motion', 'frame_origins', 'frame_transforms',
    'description', 'outline', 'model_of', *_RESULTS,
)  # fmt: skip


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
        formulas = [getattr(module, name) for name in ('model_of', *_RESULTS)]
        check_decorators(formulas, files)
        for formula, name in zip(formulas, ('model_of', *_RESULTS), strict=True):
            _check_is_formula(name, formula)
        with interpreted(), np.errstate(all='ignore'):
            _run(mechanism, values)
    except Exception as error:  # of formulas with any mistake
        line = place_and_text(error, files, ', '.join(sorted(own)))
        raise InputError(f'robot.mechanism = {mechanism.name}: {line}') from error


def _check_names(mechanism: Mechanism) -> None:
    """Raise MistakeError if the module lacks a part of the interface, or its lengths differ."""
    module, known = mechanism.formulas, vars(mechanism.formulas)
    for name in ('MODEL', *_FUNCTIONS):
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
    if not hasattr(formula, 'py_func') and not is_generated(function):
        code = function.__code__
        raise MistakeError(
            f'{code.co_filename}:{code.co_firstlineno}: {name} is an ordinary function; expected '
            'a function with @formula'
        )


def _run(mechanism: Mechanism, values: Values) -> None:
    module, sizes = mechanism.formulas, mechanism.sizes
    lengths, theta = module.constants(values)
    check_vector('constants', tuple(lengths), sizes['lengths'], per='the lengths')
    check_vector('constants', tuple(theta), sizes['parameters'], per='theta')
    pose = (0.0,) * len(mechanism.start_names or mechanism.base)
    angles = mechanism.default('initial_joints', 'joints')
    position = module.start(values, pose, angles)
    check_vector('start', position, sizes['positions'], per='base, then joints')

    record = new_record((Field('geometry', 'lengths'),), sizes, 1, {'mechanism': mechanism.tag})
    fill(record, 'geometry', np.array(lengths))
    model = module.model_of(CheckedLane(record[0], 'record'))
    if not isinstance(model, module.MODEL):
        raise MistakeError(f'model_of returns {text_of(model)}: expected {module.MODEL.__name__}')

    def example(size: str) -> tuple[float, ...]:
        return tuple(np.linspace(0.1, 0.3, sizes[size]).tolist())

    task, motion = example('axes'), example('joints')
    known: dict[str, object] = {
        'position': position, 'angles': angles, 'task': task, 'desired': (task, task, task),
        'theta': tuple(theta), 'pose': position[:sizes['base']], 'period': 1e-3,
        'settings': _settings(mechanism, theta),
    }  # fmt: skip
    known |= dict.fromkeys(('motion', 'rates', 'torques', 'forces', 'command'), motion)
    for name, (arguments, size) in _RESULTS.items():
        result = getattr(module, name)(model, *(known[argument] for argument in arguments.split()))
        if size:
            check_vector(name, result, sizes[size], per=f'the {size}')
        elif result is None:
            raise MistakeError(f'{name} returns nothing: expected a result')
        if name in ('posture', 'regressor', 'inertia'):
            known[name] = result
        elif name == 'weakest_motion':
            known['direction'] = result[1]
        elif name == 'reference_motion':
            for part, text in zip(result[:2], ('v_r', 'a_r'), strict=True):
                check_vector(f'{name}, {text},', part, sizes['joints'], per='the joints')
    _run_arrays(mechanism, values, np.array(lengths), position)


def _settings(mechanism: Mechanism, theta: tuple[float, ...]) -> CheckedLane:
    """Return example settings of a law with all fields that formulas of mechanisms read."""
    own = (field_of(parameter) for parameter in mechanism.law_parameters)
    fields = (*_SETTINGS, *(field for field in own if field is not None))
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
