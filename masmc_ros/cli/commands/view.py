# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc view`: a logged run in Foxglove."""

from __future__ import annotations

import argparse
from contextlib import suppress
import os
from pathlib import Path
import shutil
import subprocess
import sys
from tempfile import TemporaryDirectory
from urllib.parse import urlencode

from masmc_ros.cli.commands.layout import robot_in, write_layout
from masmc_ros.cli.file_server import FileServer, tunnel_hint
from masmc_ros.cli.served_meshes import described, write_with_addresses
from masmc_ros.errors import InputError
from masmc_ros.files import shared_file
from masmc_ros.log.codec import check_magic, MAGIC, truncated_message
from masmc_ros.log.recover import is_complete
from masmc_ros.robot.mechanisms import DEFAULT
from masmc_ros.user_folder import runtime_folder

_DESKTOP = ('foxglove-studio', 'foxglove', 'lichtblick')
"""Viewers that open a file of their command line."""

_GRACE = 1.5
"""Time in s after which a program that still runs has opened the file."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Open a logged run in an installed Foxglove; otherwise serve it to the Foxglove app on'
        ' this machine, and print its address.'
    )
    parser.add_argument('log', metavar='RUN.mcap', help='logged run')
    text = 'port to serve it at; 0: any free port (%(default)s)'
    parser.add_argument('--port', type=int, default=0, help=text)


def run(options: argparse.Namespace) -> int:
    """Open a log in a viewer of this machine, or serve it until interrupted."""
    path = Path(options.log)
    _check(path)
    layout = _layout_of(path)
    viewer = _open(path)
    if viewer is None:
        _serve(path, options.port, layout)
        return 0
    print(f'{path} opens in {viewer}')
    print(_layout_hint(layout))
    return 0


def _serve(path: Path, port: int, layout: Path) -> None:
    with FileServer(port) as server, TemporaryDirectory(prefix='masmc_view_') as folder:
        try:
            url = _served(server, path, Path(folder))
            query = urlencode({'ds': 'remote-file', 'ds.url': url})
            print(f'{path} is at {url}')
            print(f'open in the browser: https://app.foxglove.dev/?{query}')
            print(f'or in the application: foxglove://open?{query}')
            if tunnel := tunnel_hint(server.server_port):
                print(tunnel)
            print(_layout_hint(layout))
            print('until Ctrl-C', flush=True)
            server.serve_forever()
        except KeyboardInterrupt:
            print(file=sys.stderr)


def _served(server: FileServer, path: Path, folder: Path) -> str:
    """Serve a log, and the meshes of its robot if there are any; return the log's address."""
    description = described(path)
    if description is None:
        return server.add(path)

    def address(mesh: Path) -> str:
        # With numbers, as meshes of several folders may have the same name.
        return server.add(mesh, f'{len(server.files)}/{mesh.name}')

    copy = folder / path.name
    try:
        write_with_addresses(path, copy, description, address)
    except OSError as error:
        raise InputError(
            f'{copy}: cannot be written: {error.strerror}; set TMPDIR to a folder with space for'
            ' a copy of the log'
        ) from error
    return server.add(copy)


def _layout_of(path: Path) -> Path:
    """Return the layout for the robot of a log, by default that of the paper's robot."""
    with suppress(InputError):
        robot = robot_in(str(path))
        if robot.mechanism.name != DEFAULT.name or robot.is_hybrid:
            layout = runtime_folder() / 'layout.json'
            write_layout(robot, layout)
            return layout
    return shared_file('config', 'foxglove.json')


def _layout_hint(layout: Path) -> str:
    return f'layout, once: Layouts > Import from file > {layout}'


def _open(path: Path) -> str | None:
    """Open a file in an installed viewer; return its name, None if none is installed."""
    for name in _DESKTOP:
        program = shutil.which(name)
        if program is None:
            continue
        process = subprocess.Popen(
            [program, str(path.resolve())],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        # A command line tool of Foxglove has the same name and opens no file.
        try:
            if process.wait(_GRACE) == 0:
                return name
        except subprocess.TimeoutExpired:
            return name
    return None


def _check(path: Path) -> None:
    """Raise InputError for a file that no viewer would open."""
    if os.path.isdir(path):
        raise InputError(f'{path}: is a folder; name the .mcap file in it')
    try:
        with path.open('rb') as stream:
            check_magic(path, stream.read(len(MAGIC)))
        is_whole = is_complete(path)
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise InputError(f'{path}: cannot be read: {reason}') from error
    if not is_whole:
        raise InputError(truncated_message(path))
