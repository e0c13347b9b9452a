# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Output of `masmc run NODE --help`: usage of a node, and its parameters."""

from __future__ import annotations

import shutil
import textwrap

from masmc_ros.params.presentation import plain_list
from masmc_ros.scenario.node_parameters import declared, shared

_COMPOSED = ('plant', 'trajectory', 'controller', 'recorder')
_WIDEST = 99


def node_help(name: str, description: str) -> str:
    """Return the help of a node, as wide as the terminal."""
    width = min(_WIDEST, shutil.get_terminal_size().columns)
    own = '' if name != 'composed' else '[--record] '
    example = f'{name}:NAME' if name != 'composed' else 'NODE:NAME'
    intro = (
        'Set a parameter by -p NAME:=VALUE, or in a ROS 2 parameter file under ros__parameters;'
        f' -p {example}:=VALUE applies to one node. Parameters marked live can be changed while'
        ' the node runs, with `ros2 param set` or `masmc param set`.'
    )
    usage = f'usage: masmc run {name} '
    lines = [
        f'{usage}{own}[--ros-args [-p NAME:=VALUE]',
        f'{" " * len(usage)}[--params-file FILE] [-r FROM:=TO] ...]',
        '',
        description,
        '',
        *textwrap.wrap(intro, width),
    ]
    if own:
        lines += ['', '  --record  record the run as well']
    nodes = _COMPOSED if own else (name,)
    names = {parameter.name for parameter in shared()}
    for node in nodes:
        parameters = [p for p in declared(node) if p.name not in names]
        lines += ['', f'parameters of the node {node}:', *plain_list(parameters, width)]
    needed = {p.name for node in nodes for p in declared(node)}
    common = [p for p in shared() if p.name in needed]
    if common:
        lines += ['', 'shared parameters of all nodes:', *plain_list(common, width)]
    return '\n'.join(lines) + '\n'
