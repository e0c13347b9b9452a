# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
One page of HTML that computes runs of a parameter file in a browser.

The page contains the compiled laws and the plant as a module of WebAssembly, and their initial
records. It writes values of live parameters into the records. Settings from which Python derives
others, such as the control period, have a few values whose records are computed here.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
import gzip
from pathlib import Path
from typing import Any, NamedTuple

from markupsafe import Markup
from masmc_ros.aliases import Records
from masmc_ros.compare.contenders import Contender, contenders
from masmc_ros.errors import InputError
from masmc_ros.jit.sized_records import has_layout
from masmc_ros.jit.vectors import WORKSPACE
from masmc_ros.law import registry
from masmc_ros.law.command_interface import COMMAND_INTERFACE
from masmc_ros.law.parts.model import PAYLOAD_MASS
from masmc_ros.law.registry import LAW, SWITCHING_TERM
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.plant_parameters import parameters as plant_parameters
from masmc_ros.loop.records import read_by
from masmc_ros.loop.scenario import Scenario
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.timing import DURATION
from masmc_ros.native.entries import entries, PLANT, records_of
from masmc_ros.native.library import DERIVED, exported_simulation
from masmc_ros.native.object_code import joined_object, merged, optimised
from masmc_ros.native.targets import WEB
from masmc_ros.native.web_module import web_module
from masmc_ros.params.declaration import Parameter
from masmc_ros.params.presentation import FACTOR, level_of, range_up_to
from masmc_ros.reference.trajectory import TYPE
from masmc_ros.report.page.template import rendered
from masmc_ros.result_text import json_text
from masmc_ros.robot import mechanisms
from masmc_ros.robot.tree.frames import STANDS
from masmc_ros.robot.tree.tree_mechanism import TreeMechanism
from masmc_ros.scenario.scenario import load_scenario

_TEMPLATES = Path(__file__).parent / 'templates'

MOST_TICKS = 200_000
"""Ticks of the longest run of a page: their signals are in the memory of the browser."""

CHOICES: Mapping[str, tuple[float, ...]] = {
    'control_period': (0.0005, 0.001, 0.002, 0.003, 0.004, 0.005, 0.006, 0.008, 0.01),
    'plant.payload.mass': (0.0, 0.25, 0.5, 1.0, 2.0),
    'plant.velocity_noise': (0.0, 0.001, 0.002, 0.005, 0.01, 0.02),
}
"""Values of settings from which others are derived; that of the file is added."""

_CHOSEN_RECORDS = ('settings', 'plant_settings')
"""Records that depend on these settings; the plant writes the others at its start."""

SHARED = ('k_s1', 'k_s2', 'sigma', 'gamma')
"""Gains with a slider for every law."""

FURTHER = ('leakage', 'e_modification', 'dead_zone', 'torque_limit', 'torque_rate_limit')
"""Further parameters with a slider, which the page shows on request."""

_WITHOUT_EFFECT = 'slip_backoff'
"""Parameter about slip of the wheels, which this plant lacks."""

SCALE = 'model_scale'
"""Assumed part of the masses: nominal parameters are its products with those of the robot."""

_DISTURBANCE = 'disturbance.amplitude'

_STACK = 131072
"""Bytes in the memory of the browser below the records: constants, and the stack of a call."""

_OTHER_LAWS = ('smc:sign', 'smc:tanh', 'smc:implicit', 'rasmc:tanh', 'rasmc:implicit')
"""Laws of a page in addition to that of the file."""

_ENDS = {
    'leakage': 1.0, 'e_modification': 1.0, 'dead_zone': 0.01, SCALE: 2.0,
    'torque_limit': 50.0, 'torque_rate_limit': 1000.0, 'observer_gain': 1.0,
}  # fmt: skip
"""Ends of sliders whose parameters are usually 0 or have a known range."""


class Page(NamedTuple):
    """A page, and laws that it lacks with the reasons."""

    html: str
    laws: tuple[str, ...]
    omitted: tuple[str, ...]


def page_of(file: str, settings: Sequence[str], laws: str, name: str) -> Page:
    """
    Return the page of a parameter file.

    Parameters
    ----------
    file
        Path of the file.
    settings
        Settings of the command line, NODE.parameter=VALUE.
    laws
        LAW or LAW:SWITCHING, separated by commas; `all`; or '' for the law of the file and a few
        others. Of `all`, laws that cannot be exported are omitted.
    name
        Name of the file in the commands on the page.

    Raises
    ------
    InputError
        If the scenario or a named law cannot leave Python.

    """
    scenario = load_scenario(file, settings)
    simulation = _simulation(scenario)
    functions = entries(simulation, PLANT)
    modules, names = [optimised(merged(functions), WEB)], list(functions)
    described: dict[str, Any] = {}
    omitted: list[str] = []
    for contender in _contenders(laws, simulation):
        tick = f'law_{len(described)}'
        try:
            own = _simulation(load_scenario(file, [*settings, *contender.settings]))
            function = entries(own, ['control_tick'])['control_tick']
            modules.append(optimised(merged({tick: function}), WEB))
        except InputError as error:
            if laws != 'all':
                raise InputError(f'--laws: {contender.label}: {error}') from error
            omitted.append(f'{contender.label}: {error}')
            continue
        names.append(tick)
        described[contender.label] = _described_law(own.controller, tick)
    code = web_module(joined_object(modules, WEB), names)
    description = {
        'file': name,
        'settings': list(settings),
        'own': _contender_of(simulation).label,
        'laws': described,
        'choices': _choices(file, settings, scenario, simulation),
        'plant': _described_plant(simulation, scenario),
    }  # fmt: skip
    html = rendered(
        _TEMPLATES / 'page.html',
        title=Path(file).stem,
        engine=_script('engine.js'),
        script=_script('page.js'),
        description=_packed(json_text(description).encode()),
        code=_packed(code),
    )
    return Page(html, tuple(described), tuple(omitted))


def _simulation(scenario: Scenario) -> Simulation:
    """Return the simulation of a scenario; InputError if a page cannot show it."""
    simulation = exported_simulation(scenario, 'a page')
    mechanism = simulation.plant.mechanism
    if mechanism is not mechanisms.DEFAULT and not isinstance(mechanism, TreeMechanism):
        raise InputError(
            f"robot.mechanism = {mechanism.name}: a page draws the paper's robot and those of URDF"
            ' files only'
        )
    path = TYPE.of(scenario.trajectory)
    if path != 'line_sine':
        raise InputError(f'trajectory.type = {path}: a page computes line_sine only')
    if simulation.controller.commands_rates or simulation.controller.is_hybrid:
        raise InputError(
            f'command_interface = {COMMAND_INTERFACE.of(scenario.controller)}: expected effort'
            ' for a page'
        )
    assert simulation.timing.last is not None
    if simulation.timing.last >= MOST_TICKS:
        raise InputError(
            f'duration = {DURATION.of(scenario.plant):g}: {simulation.timing.last + 1} ticks;'
            f' expected at most {MOST_TICKS} for a page'
        )
    simulation.trajectory.sample(0, simulation.timing.last + 1)  # checks the reach
    return simulation


def _contenders(laws: str, simulation: Simulation) -> tuple[Contender, ...]:
    """
    Return the laws of a page with their switching terms; by default that of the file first.

    Those of a robot from a URDF take a minute each to compile, so there are no others by default.
    """
    mechanism, switching = simulation.controller.mechanism, _switching(simulation)
    others = _OTHER_LAWS if mechanism is mechanisms.DEFAULT else ()
    names = laws or ','.join([_contender_of(simulation).label, *others])
    return tuple(dict.fromkeys(
        contender if contender.switching or not registry.uses_switching(contender.law)
        else contender._replace(switching=switching)
        for contender in contenders(names, mechanism, switching)
    ))  # fmt: skip


def _contender_of(simulation: Simulation) -> Contender:
    """Return the law of the file."""
    law = LAW.of(simulation.controller.values)
    return Contender(law, _switching(simulation) if registry.uses_switching(law) else '')


def _switching(simulation: Simulation) -> str:
    return SWITCHING_TERM.of(simulation.controller.values)


def _described_law(controller: Controller, tick: str) -> dict[str, Any]:
    """Return the records of a law, its function and its parameters with sliders."""
    values = controller.values
    law = registry.load(LAW.of(values))
    declared = [*SHARED, *(p.name for p in getattr(law, 'parameters', ()))]
    if controller.uses_switching:
        declared += [p.name for p in registry.REACHING[SWITCHING_TERM.of(values)].parameters]
    parameters = {
        parameter.name: {
            'field': field,
            **_slider(parameter, values[parameter.name]),
            'is_further': parameter.name not in declared,
        }
        for parameter, field in read_by(controller.settings, controller.mechanism)
        if parameter.name in (*declared, *FURTHER) and parameter.kind in ('double', 'doubles')
        and not parameter.read_only and parameter.name not in {*DERIVED, _WITHOUT_EFFECT}
    }  # fmt: skip
    return {
        'law': LAW.of(values),
        'switching': SWITCHING_TERM.of(values) if controller.uses_switching else '',
        'tick': tick,
        'settings': _described_record(controller.settings),
        'memory': _described_record(controller.memory),
        'parameters': parameters,
    }


def _described_plant(simulation: Simulation, scenario: Scenario) -> dict[str, Any]:
    """Return the records of the plant, its path, and names of the signals."""
    plant, controller = simulation.plant, simulation.controller
    mechanism, line = plant.mechanism, scenario.trajectory
    amplitude = scenario.plant[_DISTURBANCE]
    sliders = {}
    if any(amplitude):
        parameter = next(p for p in plant_parameters(mechanism) if p.name == _DISTURBANCE)
        sliders[_DISTURBANCE] = {'field': 'amplitude', **_slider(parameter, amplitude)}
    if PAYLOAD_MASS.of(controller.values) == 0.0:
        scale = next(p for p, _ in read_by(controller.settings, mechanism) if p.name == SCALE)
        sliders[SCALE] = _slider(scale, controller.values[SCALE])
    is_sized = has_layout(plant.settings.dtype)
    names = ('offset', 'slope', 'amplitude', 'frequency', 'phase')
    return {
        'plant_settings': _described_record(plant.settings),
        'plant_memory': _described_record(plant.memory),
        'signals': _described_record(plant.signals),
        'path': [list(line[f'line_sine.{name}']) for name in names],
        'theta': controller.robot.theta,
        'sliders': sliders,
        **_described_grid(simulation),
        'stack': _STACK + is_sized * 2 * WORKSPACE,
        'links': _links(mechanism) if isinstance(mechanism, TreeMechanism) else None,
        'points': [
            {'symbol': p.symbol, 'name': p.name, 'first': p.first, 'size': p.size, 'unit': p.unit,
             'is_place': p.is_place}
            for p in mechanism.points
        ],
        'axes': [axis.name for axis in mechanism.axes],
        'joints': [joint.short for joint in mechanism.joints],
        'parameters': [quantity.name.replace('_', ' ') for quantity in mechanism.theta],
    }


def _links(mechanism: TreeMechanism) -> dict[str, Any]:
    """
    Return the frames on the way to the tips, parents first, and the joints on each way.

    A frame has the number of its parent, -1 without one; its kind of motion, the place of the
    position that moves it, and its factor; translation, quaternion x, y, z, w and axis.
    """
    motion, pairs = mechanism.frame_motion, mechanism.frames
    above = {child: parent for parent, child in pairs}
    numbers = {child: i for i, (_, child) in enumerate(pairs)}
    ways = []
    for link in mechanism.tips:
        way = [numbers[link]]
        while above[link] in numbers:
            link = above[link]
            way.append(numbers[link])
        ways.append(way[::-1])
    kept = {number: i for i, number in enumerate(sorted({n for way in ways for n in way}))}
    return {
        'frames': [
            [kept.get(numbers.get(pairs[n][0], -1), -1), int(motion.motion[n]),
             int(motion.place[n]), float(motion.multiplier[n]), *motion.origin[n].tolist(),
             *motion.axis[n].tolist()]
            for n in kept
        ],
        'ways': [
            [kept[n] for n in way if motion.motion[n] != STANDS or n == way[-1]] for way in ways
        ],
    }  # fmt: skip


def _described_grid(simulation: Simulation) -> dict[str, Any]:
    assert simulation.timing.last is not None
    return {
        'period': simulation.timing.period,
        'ticks': simulation.timing.last + 1,
        'delay_line': int(simulation.plant.delayed.size),
    }


def _choices(
    file: str, settings: Sequence[str], scenario: Scenario, simulation: Simulation
) -> dict[str, list[dict[str, Any]]]:
    """
    Return values of settings, each with the changes of the records that Python derives from it.

    A setting is omitted if its changes depend on the other settings.
    """
    choices: dict[str, list[dict[str, Any]]] = {}
    combined: list[str] = []
    for name, offered in CHOICES.items():
        node, dot, parameter = name.partition('.')
        own = scenario[node][parameter] if dot else scenario.plant[name]
        levels = set(own) if isinstance(own, tuple) else {own}
        if len(levels) > 1:
            continue
        found = []
        for value in sorted({*levels, *offered}):
            try:
                other = _simulation(load_scenario(file, [*settings, f'{name}={value!r}']))
            except InputError:
                continue  # such as a run of more ticks than the browser holds
            changes = _changes(simulation, other)
            found.append({'value': value, 'changes': changes, **_described_grid(other)})
        trial = [*combined, f'{name}={found[-1]["value"]!r}']
        apart = [chosen[-1]['changes'] for chosen in (*choices.values(), found)]
        together = _changes(simulation, _simulation(load_scenario(file, [*settings, *trial])))
        if len(found) > 1 and together == _united(apart):
            choices[name], combined = found, trial
    return choices


def _changes(base: Simulation, other: Simulation) -> dict[str, dict[str, list[float]]]:
    """Return the fields of records that differ, by record and field."""
    first, second = records_of(base), records_of(other)
    return {
        record: {
            field: second[record][field].ravel().tolist()
            for field in first[record].dtype.names or ()
            if first[record][field].tobytes() != second[record][field].tobytes()
        }
        for record in _CHOSEN_RECORDS
    }


def _united(
    changes: Iterable[Mapping[str, Mapping[str, list[float]]]],
) -> dict[str, dict[str, list[float]]]:
    united: dict[str, dict[str, list[float]]] = {record: {} for record in _CHOSEN_RECORDS}
    for change in changes:
        for record, fields in change.items():
            united[record] |= fields
    return united


def _described_record(record: Records) -> dict[str, Any]:
    """Return places, sizes and types of the fields of a record, and its bytes."""
    fields: Mapping[str, tuple[Any, ...]] = record.dtype.fields or {}
    return {
        'bytes': base64.b64encode(record.tobytes()).decode(),
        'fields': {
            name: [place, max(1, record[name].size), kind.base.str[1:]]
            for name, (kind, place, *_) in fields.items()
            if kind.itemsize
        },
    }


def _slider(parameter: Parameter, value: Any) -> dict[str, Any]:
    """Return value, range, unit and description of a parameter for a slider."""
    level = level_of(value)
    end = _ENDS.get(parameter.name, 0.0)
    highest = max(FACTOR * level, end) if end == 0.0 or level > end else end
    return {
        'value': value, 'unit': parameter.unit, 'description': parameter.description,
        **range_up_to(parameter, highest or 1.0)._asdict(),
    }  # fmt: skip


def _script(name: str) -> Markup:
    """Return a script without indentation, and without comments but those of its head."""
    head, body = (_TEMPLATES / name).read_text(encoding='utf-8').split('\n\n', 1)
    lines = (line.strip() for line in body.splitlines())
    return Markup('\n'.join([head, *(line for line in lines if line and line[:2] != '//')]))


def _packed(content: bytes) -> str:
    """Return compressed bytes as text; the same bytes give the same text."""
    return base64.b64encode(gzip.compress(content, 9, mtime=0)).decode()
