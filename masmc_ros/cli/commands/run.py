# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
`masmc run`: a node in this process, if the `ros2` command is not installed.

Modules that take long to import are imported only once signals are handled.

`masmc run NODE --help` prints the usage of a node, and its parameters.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import importlib
from itertools import takewhile
import os
import sys
from types import FrameType

from masmc_ros.errors import remedy, require_rclpy, suggestion, UserError
from masmc_ros.nodes.process.ending import end_with_parent, on_end

NODES = {
    'plant': 'Simulated robot: receives commands, publishes its states.',
    'trajectory': 'Reference along a path, published ahead of the robot.',
    'controller': 'Control law: responds to each state of the robot with a command.',
    'recorder': 'Recorder: writes all messages of a run unmodified into an MCAP file.',
    'play': 'Page with a running robot in 3D, plots and sliders of its gains.',
    'composed': 'Plant, trajectory and controller in one process.',
}
"""Nodes and their help; the module `masmc_ros.nodes.NAME.node` contains each."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = 'Run a node as `ros2 run masmc_ros NODE` does.'
    parser.add_argument('node', help=', '.join(NODES))
    parser.add_argument('arguments', nargs=argparse.REMAINDER, help='--ros-args ...')


def run(options: argparse.Namespace) -> int:
    """Run a node until it ends; return its exit status."""
    return run_node(options.node, options.arguments)


def run_node(name: str, arguments: Sequence[str]) -> int:
    """Run a node in this process until it ends; return its exit status."""
    if name not in NODES:
        print(f"masmc run: no node '{name}'; {suggestion(name, NODES)}", file=sys.stderr)
        return 2
    if not {'-h', '--help'}.isdisjoint(takewhile(lambda word: word != '--ros-args', arguments)):

        print(_node_help(name, NODES[name]), end='')
        return 0
    end_with_parent()
    # Imports take a second, in which SIGINT would print a traceback, and nothing needs to be
    # completed yet. A running node handles the signals itself.
    on_end(_end)
    try:
        require_rclpy()
        status: int = importlib.import_module(f'masmc_ros.nodes.{name}.node').main(list(arguments))
    except ModuleNotFoundError as missing:
        print(f'masmc run: {remedy(missing)}', file=sys.stderr)
        return 2
    except UserError as error:
        print(f'masmc run: {error}', file=sys.stderr)
        return error.exit_status
    return status


def _end(number: int, frame: FrameType | None) -> None:
    os._exit(0)


_COMPOSED = ('plant', 'trajectory', 'controller', 'recorder')
_WIDEST = 99


def _node_help(name: str, description: str) -> str:
    """Return the help of a node, as wide as the terminal."""
    import shutil
    import textwrap

    from masmc_ros.params.presentation import plain_list
    from masmc_ros.scenario.node_parameters import declared, shared

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
