# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameter declarations of each node, without ROS: offline commands use them as well."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from difflib import get_close_matches
from functools import cache

from masmc_ros.errors import InputError, suggestion
from masmc_ros.law import registry
from masmc_ros.loop import plant_parameters
from masmc_ros.loop.runaway import PARAMETER as RUNAWAY_DETECTION
from masmc_ros.loop.safe_stop import PARAMETER as FAULT_ACTION
from masmc_ros.loop.timing import TIMING
from masmc_ros.params.declaration import MutableValues, Parameter
from masmc_ros.params.values import FileValue
from masmc_ros.reference import trajectory
from masmc_ros.robot import mechanisms
from masmc_ros.robot.declaration import Mechanism, URDF
from masmc_ros.robot.joint_names import joint_names_parameter, PREFIX

PACING = ('lockstep', 'realtime')

_PACING = Parameter(
    'pacing',
    'realtime',
    'lockstep: the plant advances when the command to the last state arrives; realtime: it '
    'advances with time. A controller of real hardware needs realtime',
    choices=PACING,
)


def shared(mechanism: Mechanism = mechanisms.DEFAULT) -> tuple[Parameter, ...]:
    """Return the parameters that a file may set for all nodes; not all nodes need them."""
    return (
        *TIMING,
        *PREFIX,
        _PACING,
        *mechanisms.parameters(),
        *mechanism.parameters,
        joint_names_parameter(mechanism),
    )


def _is_speed_limit(value: float) -> bool:
    """Return True for a speed that `real_time_factor` may have, and for 0, which is no limit."""
    return value == 0.0 or value >= 0.01


_PLANT_NODE = (
    Parameter(
        'real_time_factor', 1.0,
        'Speed of the simulated time relative to real time, with pacing realtime',
        minimum=0.01, maximum=100.0, read_only=False,
    ),
    Parameter(
        'max_real_time_factor', 0.0,
        'Largest speed of the simulated time relative to real time, with pacing lockstep; '
        '0: no limit',
        minimum=0.0, maximum=100.0, rule=_is_speed_limit,
        rule_text='0, or a number in [0.01, 100]',
    ),
    Parameter(
        'command_timeout', 0.1,
        'Age from which a command is ignored and the drives hold, with pacing realtime',
        unit='s', minimum=0.0, exclusive_minimum=True,
    ),
    Parameter(
        'wait_for', ('controller',),
        'Nodes of the same namespace for which the plant waits before the run starts',
    ),
    Parameter(
        'odom_decimation', 2,
        'Ticks between two messages on odom and base_twist, and on plant/contact with MuJoCo',
        minimum=1,
    ),
    Parameter(
        'clock_decimation', 1,
        'Ticks between two messages on clock (/clock without a namespace); 0: no messages',
        minimum=0,
    ),
    Parameter(
        'tf_decimation', 1,
        'Ticks between two messages on /tf, or on tf of the namespace if frame_prefix is empty; '
        '0: no messages',
        minimum=0,
    ),
)

_LATEST_START = 2e9
"""Latest start in s, before the last valid stamp."""

_MOST = 1e9
"""Largest size in MB and time in s of a recording."""

_LEAST_PART = 1.0
"""Smallest size in MB and time in s of a part; less would give one file for each message."""


def _is_part(value: float) -> bool:
    """Return True for a valid size or time of a part, and for 0, which disables parts."""
    return value == 0.0 or value >= _LEAST_PART


def _are_parts(value: float) -> bool:
    """Return True for a number of parts that keeps a complete one, and for 0, which keeps all."""
    return value != 1


_PART_TEXT = f'0, or a number in [{_LEAST_PART:g}, {_MOST:g}]'

_SHORTEST_WINDOW = 0.001
"""Shortest window and horizon in s."""

_POSE_FRAME = Parameter(
    'pose_frame', '',
    'Frame of the path, such as map, with pose_source odom of the controller: a localisation '
    'sends its transform to the frame of odom on /tf; empty: the frame of odom',
)  # fmt: skip

_TRAJECTORY_NODE = (
    Parameter(
        'window', 0.5, 'Length of the reference windows',
        unit='s', minimum=_SHORTEST_WINDOW, maximum=5.0,
    ),
    Parameter(
        'horizon', 2.0, 'Time ahead of the robot for which the reference is published',
        unit='s', minimum=_SHORTEST_WINDOW, maximum=10.0,
    ),
    Parameter(
        'start_time', 0.0,
        'Stamp at which the trajectory starts; negative: stamp of the first state after the '
        'activation of the controller',
        unit='s', maximum=_LATEST_START,
    ),
    _POSE_FRAME,
    Parameter(
        'path_speed', 0.25,
        'Largest speed on paths from messages without times, and of the transition to a path',
        unit='m/s', minimum=0.0, exclusive_minimum=True,
    ),
    Parameter(
        'path_turn_rate', 0.5, 'Largest turn rate on paths of poses without times',
        unit='rad/s', minimum=0.0, exclusive_minimum=True,
    ),
    Parameter(
        'path_acceleration', 0.5,
        'Largest acceleration on the way to a goal, with path_jerk > 0; that of angles is as many '
        'times larger as path_turn_rate is than path_speed',
        unit='m/s²', minimum=0.0, exclusive_minimum=True,
    ),
    Parameter(
        'path_jerk', 0.0,
        'Largest jerk on the way to a goal, which needs ruckig; 0: the motion has minimum jerk, '
        'and no limit of acceleration',
        unit='m/s³', minimum=0.0,
    ),
    Parameter(
        'path_base', 'follow',
        'Axes of the base in the task on paths from messages for the end effector only: follow '
        'it, or hold them',
        choices=('follow', 'hold'),
    ),
    Parameter(
        'path_lead', 0.2,
        'Time from the latest state of the robot to the start of a path from a message, with '
        'pacing realtime',
        unit='s', minimum=_SHORTEST_WINDOW, maximum=5.0,
    ),
)


def _is_estimation_time(value: float) -> bool:
    """Return True for 0, which disables the estimate, and for a time with enough blocks."""
    return value == 0.0 or value >= 3.0


def _controller_node(mechanism: Mechanism) -> tuple[Parameter, ...]:
    return (
        Parameter(
            'telemetry_decimation', 1,
            'Ticks between two messages on each telemetry topic, such as '
            'controller/tracking_error; 0: no messages',
            minimum=0,
        ),
        Parameter(
            'active_on_start', True,
            'Activate the controller at the start; false: ~/enable activates it',
        ),
        FAULT_ACTION,
        RUNAWAY_DETECTION,
        Parameter(
            'payload.estimation_time', 0.0,
            'Time of control from which a payload is estimated, in whole seconds; 0: no estimate',
            unit='s', minimum=0.0, maximum=600.0, rule=_is_estimation_time,
            rule_text='0, or a number in [3, 600]',
        ),
        Parameter(
            'pose_source', 'joint_states',
            "Source of the platform's pose: the joints base_..._joint of joint_states, or odom",
            choices=('joint_states', 'odom') if mechanism.is_planar else ('joint_states',),
        ),
        _POSE_FRAME,
        Parameter(
            'state_timeout', 0.1,
            'Time without a usable state after which the controller raises a fault, in real time; '
            'at least five control periods',
            unit='s', minimum=0.0, exclusive_minimum=True, maximum=1e6, read_only=False,
        ),
        Parameter(
            'reference_timeout', 0.0,
            'Time from the end of the reference to a fault, in real time; 0: hold indefinitely',
            unit='s', minimum=0.0, maximum=1e6, read_only=False,
        ),
        Parameter(
            'approach_speed', 0.25,
            'Speed per task axis of the approach to a distant reference, in real time and after '
            '~/enable; 0: no approach, the error steps',
            unit='m/s', minimum=0.0,
        ),
        Parameter(
            'approach_on_start', False,
            'Start with an approach in lock-step and in masmc simulate; runs in real time always '
            'do, parallel runs never',
        ),
    )


_RECORDER_NODE = (
    Parameter(
        'output', '.',
        'Output file (*.mcap), or a folder for a new file named by namespace, date and time',
    ),
    Parameter('overwrite', False, 'Replace an existing file'),
    Parameter('compression', 'zstd', 'Compression of chunks', choices=('zstd', 'lz4', 'none')),
    Parameter('extra_topics', (), 'Additional topics to record, as soon as they exist'),
    Parameter(
        'flush_period', 0.2,
        'Longest time until a received message is on disk, also if the recorder is killed',
        unit='s', minimum=0.01, maximum=3600.0,
    ),
    Parameter(
        'max_size', 0.0,
        'Size at which a new part of the recording starts, in a folder; 0: one file',
        unit='MB', minimum=0.0, maximum=_MOST, rule=_is_part, rule_text=_PART_TEXT,
    ),
    Parameter(
        'max_duration', 0.0,
        'Robot time, by its states, at which a new part of the recording starts; 0: one file',
        unit='s', minimum=0.0, maximum=_MOST, rule=_is_part, rule_text=_PART_TEXT,
    ),
    Parameter(
        'max_parts', 0,
        'Number of parts that are kept, the current one included; older ones are deleted; 0: all',
        minimum=0, rule=_are_parts, rule_text='0, or an integer >= 2',
    ),
    Parameter(
        'queue_size', 64.0,
        'Size of the queue for a slow or full disk; further messages are counted and lost',
        unit='MB', minimum=1.0, maximum=_MOST,
    ),
)

_HOST = Parameter(
    'host', '127.0.0.1', 'Address to listen on; 0.0.0.0: reachable from other machines'
)


def _port(default: int) -> Parameter:
    return Parameter(
        'port', default, 'Port to listen on; 0: any free port', minimum=0, maximum=65535
    )


_PLAY_NODE = (
    _HOST,
    _port(8090),
    Parameter(
        'allow_commands', False,
        'Viewers of a page that other machines reach may change gains and enable the controller; '
        'on a local address they always may',
    ),
    Parameter(
        'asks_first', True,
        'Ask a viewer once before the first command, as for robots that the page did not start',
    ),
    Parameter(
        'recording', '',
        "File of the recorder of this run, or folder of its parts, for 'Report this run'; "
        'empty: no such button',
    ),
    Parameter(
        'recorded_time', 0.0,
        'Robot time that the recording keeps at least, which the page states; 0: the whole run',
        unit='s', minimum=0.0,
    ),
)

_FROM_RCL = ('use_sim_time', 'start_type_description_service')
_QOS_OVERRIDES = 'qos_overrides.'

_SLIP = 0.85
"""Similarity to a known name from which an unknown one is a misspelling."""

_DECLARED: dict[str, Callable[[Mechanism], tuple[Parameter, ...]]] = {
    'plant': lambda kind: (*shared(kind), *plant_parameters.parameters(kind), *_PLANT_NODE),
    'trajectory': lambda kind: (*shared(kind), *trajectory.parameters(kind), *_TRAJECTORY_NODE),
    'controller': lambda kind: (
        *shared(kind), *registry.parameters(kind), *_controller_node(kind)
    ),
    'recorder': lambda kind: (*TIMING, *PREFIX, *_RECORDER_NODE),
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
