# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Values of every node from a parameter file and the settings of a command line."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from functools import lru_cache
from itertools import chain
import os
from pathlib import Path
from typing import NamedTuple, TYPE_CHECKING

from masmc_ros.aliases import Numbers
from masmc_ros.errors import InputError, suggestion
from masmc_ros.log.read.reader import Run
from masmc_ros.loop.controller_events import ACTIVATED, EVENTS
from masmc_ros.loop.plant_parameters import PAYLOAD_MASS, PUSH
from masmc_ros.loop.scenario import Scenario
from masmc_ros.loop.tick_block import Change
from masmc_ros.loop.timing import Timing
from masmc_ros.messages.topics import PARAMETER_NODES
from masmc_ros.params.declaration import check_all, MutableValues, Parameter, Values
from masmc_ros.params.file import (
    content_of,
    is_urdf,
    node_values,
    ParameterFile,
    parse_value,
    parsed,
)
from masmc_ros.params.yaml_nodes import FileValue
from masmc_ros.reference.reference import PATH_RECEIVED, SampledTrajectory
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.mechanisms import mechanism_from
from masmc_ros.robot.packages import resource_path
from masmc_ros.scenario.node_parameters import (
    accepted,
    declared,
    drop_foreign,
    foreign_text,
    NODES,
    shared,
    with_posture,
)
import numpy as np

if TYPE_CHECKING:
    from masmc_ros.robot.tree.urdf_defaults import Defaults

_MOST_MISSING = 1000
"""Ticks per state above which a log lacks most of its states."""

_UNSTATED_DURATION = 20.0
"""Duration in s of an offline run without a `duration`; nodes then run until interrupted."""

_ABSENT = {'plant': {'torque_rate_limit': 0.0}}
"""Values for logs that lack a parameter, if they differ from its default."""


class Source(NamedTuple):
    """
    Content of a parameter file, or that of the defaults of a URDF.

    Attributes
    ----------
    path
        Parameter file, or path or URI of a URDF.
    settings
        NAME=VALUE of the command line.
    text
        Content of the parameter file.
    file
        Its blocks.
    defaults
        Choices for the robot of a URDF; None for a parameter file.

    """

    path: str
    settings: tuple[str, ...]
    text: bytes
    file: ParameterFile
    defaults: Defaults | None = None

    def scenario(self) -> Scenario:
        """Return the checked values; see `load_scenario`."""
        return _loaded(self)

    def strays(self) -> list[str]:
        """Return a line for each block that applies to no node, and one for unknown names."""
        return _strays(self)


def source_of(path: str, settings: Iterable[str] = (), folder: str | None = None) -> Source:
    """
    Read a parameter file, or write one for the robot of a URDF.

    Parameters
    ----------
    path
        Parameter file, or path or URI of a URDF.
    settings
        As in `load_scenario`; the defaults of a URDF follow those of its robot.
    folder
        Folder of the parameter file for a URDF; None for that of the URDF.

    Raises
    ------
    InputError
        If there is no such file, or no robot in it.

    """
    settings = tuple(settings)
    is_uri = '://' in path
    data = content_of(str(resource_path(path)) if is_uri else path)
    if not is_urdf(data):
        if path.endswith(('.urdf', '.xacro', '.xml')):
            raise InputError(f'{path}: no XML in it; expected a URDF')
        return Source(path, settings, data, parsed(data, path))
    return _of_urdf(path, settings, folder, data)


@lru_cache(maxsize=4)
def _of_urdf(
    path: str, settings: tuple[str, ...], folder: str | None, data: bytes
) -> Source:
    """Return the source of a URDF; cached by its content, as commands need it several times."""
    # Imported here: the import takes time, and only a URDF needs it.
    from masmc_ros.robot.tree.urdf_defaults import parameter_text, urdf_defaults, urdf_value

    stated = {
        name.removeprefix('plant.') if name.startswith('plant.robot.') else name: value
        for name, value in map(_parsed, settings)
    }
    defaults = urdf_defaults(path, stated)
    of_file = os.path.dirname(path) if folder is None else folder
    value = urdf_value(path, of_file)
    text = parameter_text(value, stated, defaults).encode()
    return Source(path, settings, text, parsed(text, path), defaults)


def load_scenario(path: str, settings: Iterable[str] = ()) -> Scenario:
    """
    Read a parameter file as the nodes do; settings replace its values.

    Parameters
    ----------
    path
        Parameter file, or a URDF, for which `source_of` chooses the values.
    settings
        NAME=VALUE of the command line. NAME is NODE.parameter, or a shared parameter, which
        then applies to every node.

    Raises
    ------
    InputError
        If a node would reject a value.

    """
    return source_of(path, settings).scenario()


def _loaded(source: Source) -> Scenario:
    path, settings, file = source.path, source.settings, source.file
    extra = _settings(settings, file.for_node('plant'))
    plant = {**file.for_node('plant'), **extra['plant']}
    # For every node: one that needs no robot skips the parameters of its mechanism.
    robot = _of_robot(dict(map(_parsed, settings)))
    nodes = {}
    for node in NODES:
        start = node_values((file,), robot | _of_robot(extra[node]), node)
        stated = with_posture(start.values, plant)
        places = {**dict.fromkeys(stated, ''), **start.places}
        mechanism = mechanism_from(stated)
        for name in accepted(node, mechanism) & stated.keys():
            # Shared parameters are checked in the file, even if this node does not need them.
            value = stated.pop(name)
            if name not in extra['plant']:
                parameter = next(p for p in shared(mechanism) if p.name == name)
                check_all([parameter], {name: value}, places[name])
        drop_foreign(node, stated, start.shared, places)
        declarations = declared(node, mechanism)
        # A value that a setting replaces is not checked, as a node does not receive it.
        kept = {name: value for name, value in stated.items() if name not in extra[node]}
        values = check_all(declarations, kept, places) | _checked(declarations, extra[node])
        if 'duration' in values and 'duration' not in stated | extra[node]:
            values['duration'] = _UNSTATED_DURATION
        if 'control_period' in values:
            _check_timing(values, path, node)
        nodes[node] = values
    scenario = Scenario.of(nodes, path, settings)
    check_start(scenario, path)
    return scenario


def lowest_limits(scenario: Scenario) -> Numbers:
    """Return the lower one of the torque limits of controller and plant; 0: no limit."""
    limits = scenario.controller['torque_limit'], scenario.plant['torque_limit']
    pairs = zip(*limits, strict=True)
    return tuple(min(filter(None, pair), default=0.0) for pair in pairs)


def activation(scenario: Scenario) -> list[Change]:
    """Return the activation of a controller that is inactive at the start: no user enables it."""
    return [] if scenario.controller['active_on_start'] else [Change(0, {}, ACTIVATED)]


def logged_scenario(
    run: Run, settings: Iterable[str] = ()
) -> tuple[Scenario, list[Change]]:
    """
    Return the parameters and changes of a run, with which it can be recomputed.

    Parameters
    ----------
    run
        Logged run; the computed one has its length.
    settings
        As in `load_scenario`. Later changes of a controller parameter that is set are skipped.

    Returns
    -------
        The scenario, and the changes of controller and plant.

    Raises
    ------
    InputError
        If the log lacks them, or has values that this version does not know.

    """
    settings = tuple(settings)
    for node in PARAMETER_NODES:
        if node not in run.parameters:
            raise InputError(
                f'{run.path}: no parameters of the {node} in it; expected {node}/parameters, as'
                ' the nodes of this package publish them, or the metadata of their recorder'
            )
    if run.restarted:
        raise InputError(
            f'{run.path}: {" and ".join(run.restarted)} restarted while the robot moved; only a'
            ' run without a restart can be recomputed'
        )
    extra = _settings(settings, run.parameters['plant'])
    nodes = {}
    for node in NODES:
        logged = {**_ABSENT.get(node, {}), **run.parameters.get(node, {})}
        declarations = declared(node, mechanism_from({**logged, **extra[node]}))
        if 'duration' in logged and 'duration' not in extra[node]:
            logged['duration'] = _length(run)
        values = logged | _checked(declarations, extra[node])
        nodes[node] = check_all(declarations, values, f'{run.path}: {node}: ')
    scenario = Scenario.of(nodes, str(run.path), settings)
    check_start(scenario, run.path)
    _check_length(run, Timing.from_values(scenario.plant))
    if run.reference is not None and np.isnan(run.reference[0]).any():
        has_path = ~np.isnan(run.reference).any(axis=1)
        when = f'at t = {run.times[np.argmax(has_path)]:g} s' if has_path.any() else 'never'
        raise InputError(
            f'{run.path}: its path starts {when}; only a run that follows it from its first'
            ' state on can be recomputed'
        )
    return scenario, _changes(run, without=extra)


def logged_trajectory(run: Run, settings: Iterable[str] = ()) -> SampledTrajectory | None:
    """
    Return the samples of a run that followed paths of messages, None for one without.

    Its parameters do not determine its reference. With settings of the trajectory it is computed
    from them instead.
    """
    has_paths = any(
        change.node.rpartition('/')[2] == 'trajectory' and change.event == PATH_RECEIVED
        for change in run.changes
    )
    is_set = any(setting.startswith('trajectory.') for setting in settings)
    if run.reference is None or is_set or not has_paths:
        return None
    period = run.parameters['trajectory']['control_period']
    return SampledTrajectory(np.rint(run.times / period).astype(np.int64), run.reference)


def _check_timing(values: MutableValues, path: str, node: str) -> None:
    """Raise InputError if no run has these times, as the node does."""
    try:
        Timing.from_values(values)
    except InputError as error:
        raise InputError(f'{path}: {node}: {error}') from None


def check_start(scenario: Scenario, place: str | Path) -> None:
    """Raise InputError if the path starts later than the robot."""
    start = scenario.trajectory['start_time']
    if start > 0.0:
        raise InputError(
            f'{place}: trajectory: start_time = {start}: a simulated path starts with the robot;'
            ' expected 0 or a negative number'
        )


def _changes(run: Run, without: Mapping[str, Values]) -> list[Change]:
    """Return the checked changes of controller and plant, except some parameters by node."""
    known = {
        node: {p.name: p for p in declared(node, mechanism_from(run.parameters[node]))}
        for node in ('controller', 'plant')
    }
    # The other changes of a plant are those of its pacing.
    known['plant'] = {name: known['plant'][name] for name in (PAYLOAD_MASS.name, PUSH.name)}
    changes = []
    for change in run.changes:
        node = change.node.rpartition('/')[2]
        if node not in known:
            continue
        new = {
            name: known[node][name].check(value)
            for name, value in change.changes.items()
            if name not in without[node] and (node == 'controller' or name in known[node])
        }
        if node == 'controller' and change.event and change.event not in EVENTS:
            raise InputError(
                f'{run.path}: event {change.event!r} of the controller at tick {change.tick};'
                f' expected one of {", ".join(EVENTS)}'
            )
        if new or change.event:
            changes.append(Change(change.tick, new, change.event, node))
    return changes


def _length(run: Run) -> float:
    """Return the time in s from tick 0 to the last state."""
    if len(run.times) < 2:
        raise InputError(f'{run.path}: {len(run.times)} states in it; expected a run')
    return float(run.times[-1])


def _check_length(run: Run, timing: Timing) -> None:
    """Raise InputError if the time of a log does not start at 0, or if it has few states."""
    if (timing.last or 0) > _MOST_MISSING * len(run.times):
        raise InputError(
            f'{run.path}: its {len(run.times)} states end at t = {run.times[-1]:g} s, after'
            f' {timing.last} ticks; only a run whose time starts at 0 can be recomputed'
        )


def _strays(source: Source) -> list[str]:
    path, file = source.path, source.file
    robot = _of_robot(_settings(source.settings, file.for_node('plant'))['plant'])
    blocks = [
        f"{path}:{block.line}: block '{block.pattern}' is for none of {', '.join(NODES)}"
        for block in file.unmatched(NODES)
    ]
    foreign: dict[str, None] = {}
    for node in NODES:
        start = node_values((file,), robot, node)
        names = drop_foreign(node, dict(start.values), start.shared, start.places)
        foreign.update(dict.fromkeys(names))
    return [*blocks, f'{path}: {foreign_text(foreign)}'] if foreign else blocks


def _of_robot(values: MutableValues) -> MutableValues:
    """Return the values that describe the robot."""
    return {name: value for name, value in values.items() if name.startswith('robot.')}


def _checked(declarations: Iterable[Parameter], settings: MutableValues) -> MutableValues:
    """Return checked settings of the command line."""
    declared = {parameter.name: parameter for parameter in declarations}
    return {n: declared[n].check(v, integers_for_doubles=True) for n, v in settings.items()}


def _settings(settings: Iterable[str], plant: MutableValues) -> dict[str, MutableValues]:
    """Return NAME=VALUE settings by node; `plant` has the other values of that node."""
    by_node: dict[str, MutableValues] = {node: {} for node in NODES}
    parsed = [(setting, *_parsed(setting)) for setting in settings]
    mechanism = mechanism_from(plant | _of_robot({name: value for _, name, value in parsed}))
    for setting, name, value in parsed:
        for node, parameter in readers(name, mechanism, f'--set {setting}').items():
            by_node[node][parameter.name] = value
    return by_node


def readers(name: str, mechanism: Mechanism, place: str) -> dict[str, Parameter]:
    """
    Return the parameter of a name of the command line, by each node that reads it.

    Parameters
    ----------
    name
        NODE.parameter, or a shared parameter, which every node reads that declares it.
    mechanism
        Type of the robot.
    place
        Option with the name, for messages.

    Raises
    ------
    InputError
        If there is no such parameter.

    """
    common = {parameter.name: parameter for parameter in shared(mechanism)}
    if name in common:
        return {node: common[name] for node in NODES if name not in accepted(node, mechanism)}
    node, _, short = name.partition('.')
    if node not in NODES:
        raise InputError(f"{place}: unknown parameter '{name}'; {_meant(mechanism, name)}")
    known = {parameter.name: parameter for parameter in declared(node, mechanism)}
    if short not in known:
        raise InputError(
            f"{place}: {node} has no parameter '{short}'; {suggestion(short, known)}"
        )
    return {node: known[short]}


def _parsed(setting: str) -> tuple[str, FileValue]:
    """Return name and value of a NAME=VALUE setting."""
    name, equals, text = setting.partition('=')
    if not equals:
        raise InputError(f'--set {setting}: expected NAME=VALUE, as in controller.k_s1=150')
    return name, parse_value(text, f'--set {setting}')


def _meant(mechanism: Mechanism, name: str) -> str:
    """Return a suggestion for an unknown name, first of all one without its node."""
    common = {parameter.name for parameter in shared(mechanism)}
    full: dict[str, list[str]] = {}
    for node in NODES:
        for parameter in declared(node, mechanism):
            if parameter.name not in common:
                full.setdefault(parameter.name, []).append(f'{node}.{parameter.name}')
    if name in full:
        return f'write NODE.parameter, here {" or ".join(full[name])}'
    near = get_close_matches(name, [*common, *chain.from_iterable(full.values())])
    for short in get_close_matches(name, full):
        near += full[short]
    if near:
        return f'did you mean {" or ".join(near[:3])}?'
    return f'write NODE.parameter with a node of {", ".join(NODES)}'
