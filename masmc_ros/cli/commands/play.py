# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc play`: a robot in real time on a page, with sliders of its gains."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from importlib import import_module
import json
from pathlib import Path
import re
import sys
from tempfile import TemporaryDirectory
import time
import webbrowser

from masmc_ros.cli.arguments import add_file, add_overwrite, add_settings, print_choices
from masmc_ros.cli.file_server import has_desktop, tunnel_hint
from masmc_ros.cli.node_processes import node_processes, NodeProcesses, private_domain
from masmc_ros.errors import InputError, require_rclpy, UserError
from masmc_ros.files import check_absent, scenario_file, shared_file, write_file
from masmc_ros.log.bag import check_apart
from masmc_ros.log.read.reader import is_log, read_run
from masmc_ros.log.write.writer import check_log_path
from masmc_ros.scenario.scenario import load_scenario, readers, source_of

NODES = ('trajectory', 'controller', 'plant')
"""Nodes of the run, in the order of their start."""

_PAGE = 'play'

_ADDRESS = re.compile(r'open (http://\S+) in a browser')
"""Line in the log of the node `play`."""

_START = 60.0
"""Longest time in s until the page is served."""

_DECIMATED = ('odom_decimation', 'clock_decimation', 'tf_decimation')

_SETTINGS = (
    *('-p', 'pacing:=lockstep', '-p', 'plant:max_real_time_factor:=1.0'),
    *('-p', 'duration:=0.0'),
    *(word for name in _DECIMATED for word in ('-p', f'plant:{name}:=20')),
)
"""
Settings of the nodes, which may be set otherwise.

On a machine that is too slow the time of the robot passes more slowly, so no torque is held for
longer than its period. Page and report need no transforms.
"""

_PART = 60.0
"""Robot time in s of a part of a recording that ends with the command."""

_PARTS = 6
"""Number of its parts that are kept, the current one included."""

_POLL = 0.2
"""Time in s between two checks of the nodes."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Run plant, trajectory and controller in real time on a private domain of this machine,'
        ' and show the robot on a page with plots and sliders of its gains, until interrupted.'
        ' A logged run is replayed instead, without ROS.'
    )
    add_file(parser, ', a URDF, or a logged run (*.mcap), which is replayed')
    add_settings(parser)
    text = 'address to listen on; 0.0.0.0: reachable from other machines (%(default)s)'
    parser.add_argument('--host', default='127.0.0.1', help=text)
    text = 'port of the page; 0: any free port (%(default)s)'
    parser.add_argument('--port', type=int, default=8090, help=text)
    parser.add_argument('--no-browser', action='store_true', help='open no browser')
    text = (
        'record the whole run into this file; otherwise the last '
        f'{_PART * (_PARTS - 1) / 60.0:g} minutes are kept until the command ends'
    )
    parser.add_argument('--output', metavar='RUN.mcap', help=text)
    add_overwrite(parser)
    text = 'viewers on other machines may change gains, with --host'
    parser.add_argument('--allow-commands', action='store_true', help=text)


def run(options: argparse.Namespace) -> int:
    """Serve the page until interrupted."""
    # Their absence is one line before any process is started.
    import_module('viser')
    file = scenario_file(options.file)
    if is_log(Path(file)):
        return _replay(Path(file), options)
    if options.output is not None:
        check_log_path(Path(options.output))
        check_apart([Path(options.output)], [file])
        check_absent(Path(options.output), overwrite=options.overwrite)
    require_rclpy()
    settings = _node_settings(file, options.set)
    print_choices(source_of(file, options.set))
    with TemporaryDirectory(prefix='masmc_play_') as name, private_domain() as domain:
        folder = Path(name)
        is_kept = options.output is not None
        recording = Path(options.output) if is_kept else folder / 'run'
        arguments = ['--ros-args', *_files(file, options.set, folder)]
        arguments += [*_SETTINGS, *settings]
        with suppress(KeyboardInterrupt), node_processes(domain, folder) as nodes:
            nodes.start(_PAGE, ['--ros-args', *_page_settings(options, recording, is_kept)])
            address = _address(nodes)
            if address is None:
                return 0
            nodes.start('recorder', [*arguments, *_recorder_settings(recording, is_kept)])
            for node in NODES:
                nodes.start(node, arguments)
            _announce(address, options)
            while nodes.is_running(_PAGE) and not nodes.has_any_failed():
                time.sleep(_POLL)
    return 0


def _replay(path: Path, options: argparse.Namespace) -> int:
    """Replay a log until interrupted."""
    # Imported here: the help does not need the server of the page.
    from masmc_ros.nodes.play.page import Page, PlayServer
    from masmc_ros.nodes.play.replay import Replay

    if options.output is not None:
        raise InputError(f'--output: {path} is a recording already; expected a parameter file')
    if options.set:
        raise InputError(f'--set: {path} has the parameters of its run; expected a parameter file')
    logged = read_run(path)
    page = Page(PlayServer(options.host, options.port))
    try:
        replay = Replay(logged, page, partial(print, file=sys.stderr))
        with suppress(KeyboardInterrupt):
            _announce(page.server.address, options)
            replay.play()
    finally:
        page.server.stop()
    return 0


def _files(file: str, settings: Sequence[str], folder: Path) -> list[str]:
    """Return the arguments with the parameter files of the nodes."""
    source = source_of(file, settings, str(folder))
    if source.defaults is not None:
        written = folder / 'robot.yaml'
        write_file(written, source.text)
        return ['--params-file', str(written)]
    files = ['--params-file', file]
    # As in the launch file: the paper's gains need limits in real time.
    if Path(file).resolve() == shared_file('config', 'paper.yaml').resolve():
        files += ['--params-file', str(shared_file('config', 'realtime.yaml'))]
    return files


def _node_settings(file: str, settings: Sequence[str]) -> list[str]:
    """Return settings of the command line as arguments of the nodes; InputError for bad ones."""
    scenario = load_scenario(file, settings)
    mechanism = scenario.mechanism
    arguments = []
    for setting in settings:
        name, _, text = setting.partition('=')
        for node, parameter in readers(name, mechanism, f'--set {setting}').items():
            if node in NODES:
                arguments += ['-p', f'{node}:{parameter.name}:={text}']
    return arguments


def _recorder_settings(recording: Path, is_kept: bool) -> list[str]:
    """Return the parameters of the recorder; a recording that is not kept has a limit."""
    text = json.dumps(str(recording.with_suffix('.mcap')), ensure_ascii=False)
    settings = ['-p', f'recorder:output:={text}', '-p', 'recorder:overwrite:=true']
    if not is_kept:
        settings += ['-p', f'recorder:max_duration:={_PART}']
        settings += ['-p', f'recorder:max_parts:={_PARTS}']
    return settings


def _page_settings(options: argparse.Namespace, recording: Path, is_kept: bool) -> list[str]:
    """Return the parameters of the node `play`."""
    return [
        '-p',
        f'recorded_time:={0.0 if is_kept else _PART * (_PARTS - 1)}',
        '-p',
        f'host:={json.dumps(options.host)}',
        '-p',
        f'port:={options.port}',
        '-p',
        f'allow_commands:={str(options.allow_commands).lower()}',
        '-p',
        'asks_first:=false',
        '-p',
        f'recording:={json.dumps(str(recording), ensure_ascii=False)}',
    ]


def _address(nodes: NodeProcesses) -> str | None:
    """Return the address of the page; None if its node has ended, UserError after a minute."""
    limit = time.monotonic() + _START
    while (served := _ADDRESS.search(nodes.output(_PAGE))) is None:
        if not nodes.is_running(_PAGE):
            return None
        if time.monotonic() > limit:
            raise UserError(f'no page after {_START:.0f} s; the machine may be busy, try again')
        time.sleep(_POLL)
    return served[1]


def _announce(address: str, options: argparse.Namespace) -> None:
    """Print the address, and open it if this machine has a desktop."""
    print(f'page: {address}')
    port = int(address.rpartition(':')[2])
    # Imported here: the help does not need the server of the page.
    from masmc_ros.nodes.play.page import is_local

    if not is_local(options.host) and not options.allow_commands:
        print(
            'viewers can watch only; --allow-commands lets every machine that reaches this one'
            ' change gains'
        )
    if tunnel := tunnel_hint(port):
        print(tunnel)
    if options.output is not None:
        print(f'log: {options.output}')
    print('until Ctrl-C', flush=True)
    if not options.no_browser and has_desktop():
        webbrowser.open(address)
