# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameter declarations of each node, without ROS: offline commands use them as well."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from difflib import get_close_matches
from functools import cache

from masmc_ros.errors import InputError, suggestion
from masmc_ros.law import registry
from masmc_ros.log import recorder_parameters
from masmc_ros.loop import controller_parameters, plant_parameters, trajectory_parameters
from masmc_ros.loop.timing import PACING, TIMING
from masmc_ros.params.declaration import MutableValues, Parameter
from masmc_ros.params.yaml_nodes import FileValue
from masmc_ros.reference import trajectory
from masmc_ros.robot import mechanisms
from masmc_ros.robot.declaration import Mechanism, URDF
from masmc_ros.robot.mechanisms import joint_names_parameter, PREFIX


def shared(mechanism: Mechanism = mechanisms.DEFAULT) -> tuple[Parameter, ...]:
    """Return the parameters that a file may set for all nodes; not all nodes need them."""
    return (
        *TIMING,
        *PREFIX,
        PACING,
        *mechanisms.parameters(),
        *mechanism.parameters,
        joint_names_parameter(mechanism),
    )


HOST = Parameter(
    'host', '127.0.0.1', 'Address to listen on; 0.0.0.0: reachable from other machines'
)

PORT = Parameter('port', 8090, 'Port to listen on; 0: any free port', minimum=0, maximum=65535)

ALLOW_COMMANDS = Parameter(
    'allow_commands', False,
    'Viewers of a page that other machines reach may change gains and enable the controller; '
    'on a local address they always may',
)

ASKS_FIRST = Parameter(
    'asks_first', True,
    'Ask a viewer once before the first command, as for robots that the page did not start',
)

RECORDING = Parameter(
    'recording', '',
    "File of the recorder of this run, or folder of its parts, for 'Report this run'; "
    'empty: no such button',
)

RECORDED_TIME = Parameter(
    'recorded_time', 0.0,
    'Robot time that the recording keeps at least, which the page states; 0: the whole run',
    unit='s', minimum=0.0,
)

_PLAY_NODE = (HOST, PORT, ALLOW_COMMANDS, ASKS_FIRST, RECORDING, RECORDED_TIME)

_FROM_RCL = ('use_sim_time', 'start_type_description_service')
_QOS_OVERRIDES = 'qos_overrides.'

_SLIP = 0.85
"""Similarity to a known name from which an unknown one is a misspelling."""

_DECLARED: dict[str, Callable[[Mechanism], tuple[Parameter, ...]]] = {
    'plant': lambda kind: (
        *shared(kind), *plant_parameters.parameters(kind), *plant_parameters.NODE
    ),
    'trajectory': lambda kind: (
        *shared(kind), *trajectory.parameters(kind), *trajectory_parameters.NODE
    ),
    'controller': lambda kind: (
        *shared(kind), *registry.parameters(kind), *controller_parameters.parameters(kind)
    ),
    'recorder': lambda kind: (*TIMING, *PREFIX, *recorder_parameters.NODE),
    'play': lambda kind: _PLAY_NODE,
}
"""Parameters of the nodes for a mechanism."""

NODES = tuple(_DECLARED)


def declared(node: str, mechanism: Mechanism = mechanisms.DEFAULT) -> tuple[Parameter, ...]:
    """Return the parameters that a node declares for a mechanism."""
    return _DECLARED[node](mechanism)


def accepted(node: str, mechanism: Mechanism = mechanisms.DEFAULT) -> frozenset[str]:
    """Return the shared parameters that a node accepts and does not need."""
    names = frozenset(p.name for p in shared(mechanism))
    return names - {p.name for p in declared(node, mechanism)}


def drop_foreign(
    node: str, values: MutableValues, shared: Collection[str], where: str | Mapping[str, str]
) -> list[str]:
    """
    Remove the values of other nodes; return the names that no node of this package knows.

    Parameters
    ----------
    node
        Name of the node.
    values
        Values by name. Unknown names outside wildcards stay, so that the node rejects them.
    shared
        Names under wildcards such as `/**`, which nodes of other packages read as well.
    where
        Places of the values, as in `check_all`.

    Raises
    ------
    InputError
        If a name under a wildcard is a misspelling of a known one, or overrides a quality of
        service.

    """
    mechanism = mechanisms.mechanism_from(values)
    own = {parameter.name for parameter in declared(node, mechanism)}
    known = _known(mechanism)
    foreign = []
    for name in [name for name in values if name not in own]:
        place = where if isinstance(where, str) else where.get(name, '')
        if name in _FROM_RCL or (name in shared and name in known):
            del values[name]
        elif name in shared:
            if get_close_matches(name, known, n=1, cutoff=_SLIP):
                hint = suggestion(name, known)
                raise InputError(f"{place}unknown parameter '{name}'; {hint}")
            del values[name]
            foreign.append(name)
        elif name.startswith(_QOS_OVERRIDES):
            raise InputError(
                f'{place}{name}: the quality of service of these nodes is fixed, since runs could '
                'lose messages or stop; remove it'
            )
    return foreign


def with_posture(
    values: Mapping[str, FileValue], plant: Mapping[str, FileValue]
) -> dict[str, FileValue]:
    """
    Return values of a node, with the start of its robot as the default of `robot.posture`.

    Parameters
    ----------
    values
        Values of the node from files and settings, unchecked.
    plant
        Those of the plant, whose `initial_joints` are the start.

    """
    start = plant.get('initial_joints')
    if not values.get(URDF) or 'robot.posture' in values or not isinstance(start, list):
        return dict(values)
    mechanism = mechanisms.mechanism_from(values)
    if len(start) != len(mechanism.joints):
        return dict(values)
    return {**values, 'robot.posture': start[mechanism.groups[-1].first:]}


def foreign_text(names: Collection[str]) -> str:
    """Return a line about names under wildcards that no node knows."""
    return f'{", ".join(names)}: no parameter of this package, without effect on its nodes'


@cache
def _known(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the names of the parameters of all nodes."""
    return tuple(dict.fromkeys(p.name for node in NODES for p in declared(node, mechanism)))
