# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Package of a controller for ros2_control, generated on top of a library."""

from __future__ import annotations

from collections.abc import Mapping
import math
from pathlib import Path
from typing import Any, NamedTuple

from masmc_ros.errors import InputError
from masmc_ros.law.command_interface import COMMAND_INTERFACE
from masmc_ros.loop.supervision import is_supervised
from masmc_ros.native.template import filled
from masmc_ros.params.declaration import Parameter, Values
from masmc_ros.robot.mechanisms import driven_joint_names, joint_names

_KINDS = {'bool': 'kBool', 'integer': 'kInteger', 'string': 'kInteger'}

_SUPERVISED = ('fault_action', 'state_timeout', 'reference_timeout', 'approach_speed')
"""Parameters of the supervision."""


class _Gain(NamedTuple):
    """Parameter of the law in C++."""

    name: str
    field: str
    size: int
    kind: str
    minimum: str
    maximum: str
    excludes_minimum: str
    excludes_maximum: str
    expected: str
    text: str
    """Value in YAML."""
    sentence: str


def check_supervised(values: Values) -> None:
    """Raise InputError for parameter values without a compiled supervision."""
    if not is_supervised(values):
        raise InputError(
            f'command_interface = {COMMAND_INTERFACE.of(values)}: expected effort, the only'
            ' command interface of a controller for ros2_control'
        )


def package_contents(
    described: Mapping[str, Any],
    values: Values,
    libraries: Mapping[str, bytes],
    reference: bytes,
) -> dict[Path, bytes]:
    """
    Return the files of a package by their paths in it.

    Parameters
    ----------
    described
        Content of the templates of the library.
    values
        Checked parameter values of the controller.
    libraries
        Static library by target.
    reference
        Samples of the path.

    """
    name: str = described['name']
    package = package_name(name)
    settings = next(record for record in described['records'] if record.name == 'settings')
    counts = {field.name: math.prod(field.shape) for field in settings.fields}
    memory = next(record for record in described['records'] if record.name == 'memory')
    members = {field.name for field in memory.fields}
    content = {
        **described,
        'package': package,
        'targets': tuple(libraries),
        'joints': joint_names(values),
        'driven': driven_joint_names(values),
        'rate': round(1.0 / described['period']),
        'supervised': {key: values[key] for key in _SUPERVISED},
        'gains': [
            _gain(parameter, field, counts[field], values[parameter.name])
            for field, parameter in described['parameters'].items()
        ],
        'resets_observer': 'observer_gain' in described['parameters']
        and {'disturbance', 'predicted'} <= members,
    }
    files = {
        'package.xml': 'package.xml.jinja',
        'CMakeLists.txt': 'CMakeLists.txt.jinja',
        'plugin.xml': 'plugin.xml.jinja',
        f'include/{package}/controller.hpp': 'controller.hpp.jinja',
        'src/controller.cpp': 'controller.cpp.jinja',
        'config/controller.yaml': 'controller.yaml.jinja',
        f'library/{name}.h': 'library.h.jinja',
    }
    return {
        **{Path(file): filled(template, content).encode() for file, template in files.items()},
        **{Path('library', target, f'lib{name}.a'): code for target, code in libraries.items()},
        Path('path/reference.bin'): reference,
    }


def package_name(name: str) -> str:
    """Return the name of the package for a library; names in ROS have small letters."""
    return f'{name.lower()}_controller'


def _gain(parameter: Parameter, field: str, count: int, value: Any) -> _Gain:
    kind = _KINDS.get(parameter.kind, 'kNumbers')
    choices = tuple(parameter.known_choices()) if parameter.kind == 'string' else ()
    lowest, highest = parameter.minimum, parameter.maximum
    limits = []
    if choices:
        lowest, highest, value = 0, len(choices) - 1, choices.index(value)
        limits = [f'{place}: {choice}' for place, choice in enumerate(choices)]
    else:
        if lowest is not None:
            limits.append(f'{">" if parameter.exclusive_minimum else ">="} {lowest:g}')
        if highest is not None:
            limits.append(f'{"<" if parameter.exclusive_maximum else "<="} {highest:g}')
    otherwise = 'true or false' if kind == 'kBool' else 'a finite number'
    expected = ', '.join(limits) or otherwise
    if isinstance(value, tuple):
        text = f'[{", ".join(map(repr, value))}]'
    else:
        text = str(value).lower() if isinstance(value, bool) else repr(value)
    unit = f', {parameter.unit}' if parameter.unit else ''
    return _Gain(
        parameter.name, field, count, kind, _bound(lowest, '-'), _bound(highest, ''),
        str(parameter.exclusive_minimum and not choices).lower(),
        str(parameter.exclusive_maximum and not choices).lower(), expected, text,
        f'{parameter.description}{unit}; {expected}',
    )  # fmt: skip


def _bound(value: float | None, sign: str) -> str:
    return f'{sign}kInfinity' if value is None else repr(float(value))
