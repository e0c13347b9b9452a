# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Which parameters each node declares. Knows nothing of ROS: offline commands read it too."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from difflib import get_close_matches
from functools import cache
from typing import Any

from masmc_ros.errors import InputError, suggestion
from masmc_ros.law import registry
from masmc_ros.loop import simulated_robot
from masmc_ros.loop.runaway import PARAMETER as RUNAWAY_DETECTION
from masmc_ros.loop.safe_stop import PARAMETER as FAULT_ACTION
from masmc_ros.loop.timing import TIMING
from masmc_ros.params.declaration import Parameter
from masmc_ros.reference import trajectory
from masmc_ros.robot import registry as mechanisms
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.names import joint_names_parameter, PREFIX

PACING = ('lockstep', 'realtime')

_PACING = Parameter(
    'pacing',
    'realtime',
    'The plant advances when the command for the present state arrives, or by the wall '
    'clock; a controller of real hardware: realtime',
    choices=PACING,
)


def shared(mechanism: Mechanism = mechanisms.DEFAULT) -> tuple[Parameter, ...]:
    """Return what a file may give to all nodes at once, needed there or not."""
    return (
        *TIMING,
        *PREFIX,
        _PACING,
        *mechanisms.parameters(),
        *mechanism.parameters,
        joint_names_parameter(mechanism),
    )


_PLANT_NODE = (
    Parameter(
        'real_time_factor',
        1.0,
        'Simulated seconds per second with realtime pacing',
        minimum=0.01,
        maximum=100.0,
        read_only=False,
    ),
    Parameter(
        'command_timeout',
        0.1,
        'With realtime pacing, a command older than this is none: the drives hold',
        unit='s',
        minimum=0.0,
        exclusive_minimum=True,
    ),
    Parameter(
        'wait_for',
        ('controller',),
        'Nodes of the same namespace without which the run does not begin',
    ),
    Parameter(
        'odom_decimation',
        2,
        'Ticks between two messages on odom and base_twist, and on plant/contact with MuJoCo',
        minimum=1,
    ),
    Parameter(
        'clock_decimation',
        1,
        'Ticks between two messages on clock, which is /clock without a namespace; 0: no messages',
        minimum=0,
    ),
    Parameter(
        'tf_decimation',
        1,
        'Ticks between two messages on /tf, or on tf in a namespace without a frame_prefix; '
        '0: no messages',
        minimum=0,
    ),
)

_LATEST_START = 2e9
"""Time in s: stamps end some years later."""

_MOST = 1e9
"""Size in MB or time in s that no recording reaches."""

_LEAST_PART = 1.0
"""Size in MB and time in s of a part of a recording: less makes a file of every message."""


def _is_part(value: float) -> bool:
    """Return True for the size or the time of a part, and for 0, which is one file."""
    return value == 0.0 or value >= _LEAST_PART


_PART_TEXT = f'0, or a number in [{_LEAST_PART:g}, {_MOST:g}]'

_SHORTEST_WINDOW = 0.001
"""Time in s: with a horizon of 10 s there are then 10 000 windows ahead of the robot."""

_TRAJECTORY_NODE = (
    Parameter(
        'window',
        0.5,
        'Length of the reference windows',
        unit='s',
        minimum=_SHORTEST_WINDOW,
        maximum=5.0,
    ),
    Parameter(
        'horizon',
        2.0,
        'How far ahead of the robot the reference is sent',
        unit='s',
        minimum=_SHORTEST_WINDOW,
        maximum=10.0,
    ),
    Parameter(
        'start_time',
        0.0,
        'Stamp at which the trajectory begins; negative: the stamp of the first state after '
        'the controller has become active',
        unit='s',
        maximum=_LATEST_START,
    ),
)


def _controller_node(mechanism: Mechanism) -> tuple[Parameter, ...]:
    return (
        Parameter(
            'telemetry_decimation',
            1,
            'Ticks between two messages on each telemetry topic, such as '
            'controller/tracking_error; 0: no messages',
            minimum=0,
        ),
        Parameter(
            'active_on_start',
            True,
            'Whether the controller moves the robot from the start; otherwise ~/enable does it',
        ),
        FAULT_ACTION,
        RUNAWAY_DETECTION,
        Parameter(
            'pose_source',
            'joint_states',
            "Where the platform's pose comes from: the joints base_..._joint, or odom",
            choices=('joint_states', 'odom') if mechanism.is_planar else ('joint_states',),
        ),
        Parameter(
            'state_timeout',
            0.1,
            'In real time, a fault when no usable state has come for so long, or for five control '
            'periods if that is longer',
            unit='s',
            minimum=0.0,
            exclusive_minimum=True,
            maximum=1e6,
            read_only=False,
        ),
        Parameter(
            'reference_timeout',
            0.0,
            'In real time, a fault when the reference has ended for so long; 0 holds for ever',
            unit='s',
            minimum=0.0,
            maximum=1e6,
            read_only=False,
        ),
        Parameter(
            'approach_speed',
            0.25,
            'Speed per task axis at which the controller goes to a reference that it is away '
            'from, in real time and when it is enabled; 0 jumps',
            unit='m/s',
            minimum=0.0,
        ),
        Parameter(
            'approach_on_start',
            False,
            'Whether a run in lock-step or by masmc simulate starts with an approach, as runs in '
            'real time always do; runs side by side start on the reference',
        ),
    )


_RECORDER_NODE = (
    Parameter(
        'output', '.', 'File to record into (*.mcap), or folder for a file named by the time'
    ),
    Parameter('overwrite', False, 'Replace a file that is there already'),
    Parameter('compression', 'zstd', 'Compression of chunks', choices=('zstd', 'lz4', 'none')),
    Parameter('extra_topics', (), 'Further topics to record, as they turn up'),
    Parameter(
        'flush_period',
        0.2,
        'Time after which what came is on the disk, whatever happens to the recorder',
        unit='s',
        minimum=0.01,
        maximum=3600.0,
    ),
    Parameter(
        'max_size',
        0.0,
        'Size at which a new part of the recording begins, in a folder; 0 is one file',
        unit='MB',
        minimum=0.0,
        maximum=_MOST,
        rule=_is_part,
        rule_text=_PART_TEXT,
    ),
    Parameter(
        'max_duration',
        0.0,
        'Time on the log at which a new part of the recording begins; 0 is one file',
        unit='s',
        minimum=0.0,
        maximum=_MOST,
        rule=_is_part,
        rule_text=_PART_TEXT,
    ),
    Parameter(
        'queue_size',
        64.0,
        'Messages that wait for a slow or full disk; what comes on top is counted and lost',
        unit='MB',
        minimum=1.0,
        maximum=_MOST,
    ),
)

_LIVE_NODE = (
    Parameter(
        'host', '127.0.0.1', 'Address to listen on; 0.0.0.0 is reachable from other machines'
    ),
    Parameter('port', 8765, 'Port to listen on; 0 is any free one', minimum=0, maximum=65535),
    Parameter(
        'rate',
        60.0,
        'How often the topics that come every tick are shown',
        unit='Hz',
        minimum=1.0,
        maximum=1000.0,
    ),
    Parameter(
        'max_viewers',
        16,
        'Number of viewers that get messages; further ones wait until one of them leaves',
        minimum=1,
        maximum=1000,
    ),
)

_FROM_RCL = ('use_sim_time', 'start_type_description_service')
_QOS_OVERRIDES = 'qos_overrides.'

_SLIP = 0.85
"""Likeness to a known name from which on another one is a slip, not somebody else's."""

NODES = ('plant', 'trajectory', 'controller', 'recorder', 'live')


def declared(node: str, mechanism: Mechanism = mechanisms.DEFAULT) -> tuple[Parameter, ...]:
    """Return the declarations of a node by its name, for a mechanism."""
    common = shared(mechanism)
    if node == 'plant':
        return (*common, *simulated_robot.parameters(mechanism), *_PLANT_NODE)
    if node == 'trajectory':
        return (*common, *trajectory.parameters(mechanism), *_TRAJECTORY_NODE)
    if node == 'controller':
        return (*common, *registry.parameters(mechanism), *_controller_node(mechanism))
    if node == 'live':
        return _LIVE_NODE
    return (*TIMING, *PREFIX, *_RECORDER_NODE)


def accepted(node: str, mechanism: Mechanism = mechanisms.DEFAULT) -> frozenset[str]:
    """Names that a node accepts without declaring them: shared ones that it does not need."""
    names = frozenset(p.name for p in shared(mechanism))
    return names - {p.name for p in declared(node, mechanism)}


def drop_foreign(
    node: str, given: dict[str, Any], shared: Collection[str], where: str | Mapping[str, str]
) -> list[str]:
    """
    Take out of what a node is given what is not for it, and return what is for nobody here.

    `shared` are the names that stand under wildcards such as `/**`, which nodes of other
    packages read too. `where` is as in `check_all`. What the node is to refuse stays.

    Raises
    ------
    InputError
        for a name under a wildcard that is a slip of a known one, and for
        quality of service, which cannot be overridden.

    """
    mechanism = mechanisms.chosen(given)
    own = {parameter.name for parameter in declared(node, mechanism)}
    known = _known(mechanism)
    foreign = []
    for name in [name for name in given if name not in own]:
        place = where if isinstance(where, str) else where.get(name, '')
        if name in _FROM_RCL or (name in shared and name in known):
            del given[name]
        elif name in shared:
            if get_close_matches(name, known, n=1, cutoff=_SLIP):
                hint = suggestion(name, known)
                raise InputError(f"{place}unknown parameter '{name}'; {hint}")
            del given[name]
            foreign.append(name)
        elif name.startswith(_QOS_OVERRIDES):
            raise InputError(
                f'{place}{name}: the quality of service of these nodes is fixed, lest runs lose '
                'messages or stand still; remove it'
            )
    return foreign


def foreign_text(names: Collection[str]) -> str:
    """Tell of names under wildcards that none of the nodes knows."""
    return f'{", ".join(names)}: no parameter of this package, without effect on its nodes'


@cache
def _known(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the names of the parameters of all nodes."""
    return tuple(dict.fromkeys(p.name for node in NODES for p in declared(node, mechanism)))
