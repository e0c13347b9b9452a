# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Folder with a controller and its robot as a static library, a C header and examples."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
import hashlib
from pathlib import Path
import pickle
import re
import subprocess
import sys
from typing import Any, cast, NamedTuple

from masmc_ros import __version__
from masmc_ros.aliases import Records
from masmc_ros.child_process import module_command, processors
from masmc_ros.errors import InputError
from masmc_ros.files import check_absent, make_folder, write_file
from masmc_ros.jit.compiled import interpreted, stored
from masmc_ros.jit.sized_records import has_layout, LAYOUT, TAG
from masmc_ros.jit.vectors import WORKSPACE
from masmc_ros.law.parts.delay_fields import ENABLING
from masmc_ros.law.parts.model import PAYLOAD
from masmc_ros.law.registry import LAW, SWITCHING_TERM
from masmc_ros.loop.closed_loop import NOT_FINITE, SINGULAR
from masmc_ros.loop.controller_parameters import ACTIVE_ON_START, APPROACH_ON_START
from masmc_ros.loop.plant_parameters import PAYLOAD_MASS, PAYLOAD_TIME, PHYSICS
from masmc_ros.loop.records import read_by
from masmc_ros.loop.scenario import Scenario
from masmc_ros.loop.signals import inputs, SIGNALS
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.supervision import NAMES, PROGRAM_FIELDS
from masmc_ros.native import object_code
from masmc_ros.native.entries import (
    entries,
    Entry,
    FAILED,
    LIBRARY,
    OTHER_RECORDS,
    records_of,
    SUPERVISION,
)
from masmc_ros.native.object_code import archive, merged, object_of
from masmc_ros.native.ros2_control import check_supervised, package_contents, package_name
from masmc_ros.native.targets import Target
from masmc_ros.native.template import filled, INTERMEDIATE_CODE
from masmc_ros.params.declaration import Parameter
from masmc_ros.result_text import json_text
from masmc_ros.robot.dead_reckoning import has_odometry
import numpy as np

_KINDS = {'f8': 'double', 'i8': 'int64_t', 'i4': 'int32_t'}

DERIVED = {*PAYLOAD, *ENABLING, 'velocity_source'}
"""Live parameters that determine other settings, or whose change resets memory."""


class _Field(NamedTuple):
    """Member of a record in C."""

    name: str
    kind: str
    shape: tuple[int, ...]
    place: int
    description: str
    values: tuple[str, ...]


class _Record(NamedTuple):
    name: str
    size: int
    tags: int
    """Number of its last bytes, by which the compiler has selected formulas."""
    fields: tuple[_Field, ...]


def write_library(
    folder: Path,
    name: str,
    scenario: Scenario,
    targets: Mapping[str, Target],
    *,
    overwrite: bool,
    supervised: bool = True,
    ros2_control: bool = False,
) -> list[Path]:
    """
    Write the library of a scenario, and return the files.

    Parameters
    ----------
    folder
        Folder of the library, which is created.
    name
        Name of the library, the beginning of all names in C.
    scenario
        Scenario of the run.
    targets
        Processors by name, see `targets.TARGETS`.
    overwrite
        True to replace existing files.
    supervised
        False to leave out the supervision, which takes a third of the time.
    ros2_control
        True to add the package of a controller for ros2_control, which needs the supervision.

    Raises
    ------
    InputError
        If the law or the robot cannot leave Python, if a file exists or cannot be written.

    """
    if not re.fullmatch(r'[A-Za-z][A-Za-z0-9_]*', name):
        raise InputError(f"name '{name}': expected letters, digits and _, a letter first")
    paths = {
        'header': folder / f'{name}.h',
        'description': folder / f'{name}.json',
        'reference': folder / 'reference.bin',
        'example': folder / 'example.c',
        'makefile': folder / 'Makefile',
        **{target: folder / target / f'lib{name}.a' for target in targets},
    }
    package = folder / package_name(name)
    for path in (*paths.values(), *([package] if ros2_control else ())):
        check_absent(path, overwrite=overwrite)
    if ros2_control:
        check_supervised(scenario.controller)
    simulation = exported_simulation(scenario, 'a library')
    names = [entry for entry in LIBRARY if supervised or entry not in (*SUPERVISION, 'odometry')]
    if 'odometry' in names and not has_odometry(scenario.controller):
        names.remove('odometry')
    found = _compiled(simulation, scenario, names)
    functions = {f'{name}_{entry}': function for entry, function in found.items()}
    text = cache(lambda: merged(functions))
    contents = {
        target: archive(f'{name}.o', _object_of(functions, kind, text), list(functions))
        for target, kind in targets.items()
    }
    described = _described(simulation, name, found)
    reference = simulation.trajectory.sample(0, described['ticks'])
    contents |= {
        'header': filled('library.h.jinja', described).encode(),
        'example': filled('example.c.jinja', described).encode(),
        'makefile': filled(
            'Makefile.jinja', {**described, 'targets': tuple(targets)}
        ).encode(),
        'description': _json(described, simulation).encode(),
        'reference': reference.astype('<f8').tobytes(),
    }
    files = {path: contents[key] for key, path in paths.items()}
    if ros2_control:
        added = package_contents(
            described, scenario.controller,
            {target: contents[target] for target in targets}, contents['reference'],
        )  # fmt: skip
        files |= {package / path: content for path, content in added.items()}
    for path, content in files.items():
        make_folder(path.parent)
        write_file(path, content)
    return list(files)


def exported_simulation(scenario: Scenario, product: str) -> Simulation:
    """
    Return the simulation of a scenario at its start, for a product such as 'a library'.

    Raises InputError if the scenario cannot leave Python.
    """
    control, plant = scenario.controller, scenario.plant
    if APPROACH_ON_START.of(control) or not ACTIVE_ON_START.of(control):
        raise InputError(
            f'approach_on_start or active_on_start: {product} has no approach and is always'
            ' active; expected approach_on_start false and active_on_start true'
        )
    if PAYLOAD_MASS.of(plant) and PAYLOAD_TIME.of(plant):
        raise InputError(
            f'plant.payload.time = {PAYLOAD_TIME.of(plant):g}: the robot of {product} has its'
            ' payload from the start; expected 0'
        )
    # The product has its own compiled code. Plain Python warns of a NaN that it computes.
    with interpreted(), np.errstate(all='ignore'):
        simulation = Simulation(scenario)
    if simulation.timing.last is None:
        raise InputError(f'duration = 0.0: expected a length > 0 s for the run of {product}')
    if not simulation.plant.is_compiled:
        raise InputError(f'plant.physics = {PHYSICS.of(plant)}: expected rigid for {product}')
    if not simulation.controller.is_compiled:
        raise InputError(f'law = {LAW.of(control)}: it is plain Python, expected a compiled law')
    with interpreted(), np.errstate(all='ignore'):
        simulation.controller.reset()
    return simulation


class _AbsentError(Exception):
    """Raised if the disk has no code of an entry."""


def _raise_absent() -> None:
    raise _AbsentError


@contextmanager
def _compiling(scenario: Scenario, names: Sequence[str]) -> Iterator[None]:
    """Compile entries in another process meanwhile; their code is then on the disk."""
    if processors() < 2:
        yield
        return
    with subprocess.Popen(
        module_command(__name__), stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as process:  # fmt: skip
        try:
            assert process.stdin is not None
            with suppress(BrokenPipeError), process.stdin:
                process.stdin.write(pickle.dumps((scenario, names)))
            yield
            process.wait()
        finally:
            process.kill()


def _compiled(
    simulation: Simulation, scenario: Scenario, names: Sequence[str]
) -> dict[str, Entry]:
    """Return entries; another process compiles those of the plant, unless the disk has them."""
    of_plant = [name for name in names if name.startswith('plant')]
    others = [name for name in names if name not in of_plant]
    try:
        plant = entries(simulation, of_plant, _raise_absent)
    except _AbsentError:
        with _compiling(scenario, of_plant):
            found = entries(simulation, others)
        # If the process or the disk has failed, they are compiled here.
        return found | entries(simulation, of_plant)
    return entries(simulation, others) | plant


def _object_of(
    functions: Mapping[str, Entry], target: Target, text: Callable[[], str]
) -> bytes:
    """Return the object code of entries, from the disk if it is there."""
    described = hashlib.sha256(repr(functions).encode()).hexdigest()
    return cast(bytes, stored(
        'library', [object_code.__file__, *INTERMEDIATE_CODE], (), (described, *target),
        lambda: object_of(text(), target),
    ))  # fmt: skip


def _described(
    simulation: Simulation, name: str, found: Mapping[str, Entry]
) -> dict[str, Any]:
    """Return what the templates and the JSON file contain."""
    controller, plant = simulation.controller, simulation.plant
    mechanism = controller.mechanism
    parameters = {
        field: parameter
        for parameter, field in read_by(controller.settings, mechanism)
        if not (parameter.read_only or parameter.name in DERIVED)
    }
    axes = ', '.join(dict.fromkeys(point.unit for point in mechanism.points))
    signals = {
        signal.name: f'{signal.description}, {signal.unit_of(axes)}' for signal in SIGNALS
    }
    descriptions = {
        'settings': {field: _sentence(parameter) for field, parameter in parameters.items()},
        'signals': signals,
        'supervision': {
            field.name: f'{field.description}{", " * bool(field.unit)}{field.unit}'
            for field in PROGRAM_FIELDS
        },
    }
    assert simulation.timing.last is not None
    is_fixed = controller.values.get('robot.base') == 'fixed'
    pose = tuple(plant.memory['position'][0, :len(mechanism.base), 0].tolist())
    return {
        'pose': pose,
        'fixed': tuple(map(_number, pose)) if is_fixed else (),
        'has_odometry': 'odometry' in found,
        'name': name,
        'version': __version__,
        'law': LAW.of(controller.values),
        'switching': SWITCHING_TERM.of(controller.values) if controller.uses_switching else '',
        'period': simulation.timing.period,
        'ticks': simulation.timing.last + 1,
        'sizes': dict(zip(
            ('position', 'velocity', 'reference'),
            (len(values) for values in inputs(controller.signals)), strict=True,
        )),
        'delay_line': plant.delayed.size,
        # The approach and the safe stop are kernels with vectors of their own.
        'memory': has_layout(controller.settings.dtype) * WORKSPACE * (
            2 if set(SUPERVISION) <= found.keys() else 1),
        'statuses': {
            'SINGULAR': SINGULAR, 'NOT_FINITE': NOT_FINITE, 'FAILED': FAILED,
            'OTHER_RECORDS': OTHER_RECORDS,
        },
        'supervision': NAMES if set(SUPERVISION) <= found.keys() else {},
        'points': mechanism.points,
        'parameters': parameters,
        'records': [
            _record(key, record, descriptions.get(key, {}))
            for key, record in records_of(simulation).items()
            if key != 'supervision' or set(SUPERVISION) <= found.keys()
        ],
        'functions': {
            entry: {
                'arguments': _arguments(name, function.arguments),
                'description': function.description,
            }
            for entry, function in found.items()
        },
    }  # fmt: skip


def _record(name: str, record: Records, descriptions: Mapping[str, str]) -> _Record:
    fields, tags = [], 0
    fields_of = record.dtype.fields
    assert fields_of is not None
    for field in fields_of:
        kind, place = fields_of[field][:2]
        if TAG in field and field != LAYOUT:
            tags += 1
            continue
        shape = kind.shape[:-1] if kind.shape[-1] == 1 else kind.shape
        text = descriptions.get(field, '').replace('*/', '* /')
        numbers = tuple(_number(value) for value in record[field].ravel().tolist())
        name_in_c = field.replace(TAG, '')
        fields.append(_Field(name_in_c, _KINDS[kind.base.str[1:]], shape, place, text, numbers))
    fields.sort(key=lambda field: field.place)  # the layout is the first member
    return _Record(name, record.dtype.itemsize, tags, tuple(fields))


def _number(value: float) -> str:
    """Return a constant of C with the bits of a number."""
    text = value.hex() if isinstance(value, float) else str(value)
    return {'nan': 'NAN', 'inf': 'INFINITY', '-inf': '-INFINITY'}.get(text, text)


def _arguments(name: str, kinds: Sequence[str]) -> str:
    """Return the declaration of arguments in C."""
    usual = iter(('position', 'velocity', 'reference'))
    named = []
    for kind in kinds:
        if '*' in kind and not kind.endswith('*'):
            named.append(kind)
        elif kind == 'const double *':
            named.append(f'{kind}{next(usual)}')
        elif kind == 'double *':
            named.append(f'{kind}delay_line')
        elif kind == 'int64_t':
            named.append(f'{kind} tick')
        elif kind.startswith('int64_t '):
            named.append(kind)
        elif kind.startswith('const '):
            named.append(f'const {name}_{kind[6:]} *initial')
        else:
            constant = 'const ' if kind.endswith('settings') else ''
            named.append(f'{constant}{name}_{kind} *{kind}')
    return ', '.join(named)


def _sentence(parameter: Parameter) -> str:
    """Return the description of a parameter with its unit and range."""
    parts = [parameter.description]
    if parameter.unit:
        parts.append(parameter.unit)
    if parameter.choices and not callable(parameter.choices):
        parts.append(', '.join(f'{i}: {text}' for i, text in enumerate(parameter.choices)))
    for word, limit in (('>=', parameter.minimum), ('<=', parameter.maximum)):
        if limit is not None:
            parts.append(f'{word} {limit:g}')
    return '; '.join(parts)


def _json(described: Mapping[str, Any], simulation: Simulation) -> str:
    values = simulation.controller.values
    parameters = {
        parameter.name: {
            'field': field, 'value': values[parameter.name], 'unit': parameter.unit,
            'minimum': parameter.minimum, 'maximum': parameter.maximum,
            'description': parameter.description,
        }
        for field, parameter in described['parameters'].items()
    }  # fmt: skip
    records = {
        record.name: {
            'size': record.size,
            'fields': {
                field.name: {'place': field.place, 'shape': field.shape, 'type': field.kind}
                for field in record.fields
            },
        }
        for record in described['records']
    }
    names = (
        'name', 'version', 'law', 'switching', 'period', 'sizes', 'delay_line', 'statuses',
        'supervision',
    )  # fmt: skip
    return json_text({
        **{key: described[key] for key in names},
        'parameters': parameters,
        'records': records,
        'functions': described['functions'],
    })


def main() -> None:
    """Compile entries for the process that names them and their scenario on the input."""
    scenario, names = pickle.load(sys.stdin.buffer)
    entries(exported_simulation(scenario, 'a library'), names)


if __name__ == '__main__':
    main()
