# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Desktop of this machine, and the way to its ports from another one."""

from __future__ import annotations

from contextlib import suppress
import getpass
import os
import socket
import sys

from masmc_ros.cli.show.file_server import HOST


def has_desktop() -> bool:
    """Return True if programs of this process can open windows."""
    return sys.platform == 'darwin' or bool(
        os.environ.get('DISPLAY') or os.environ.get('WAYLAND_DISPLAY')
    )


def tunnel_hint(port: int) -> str:
    """Return how a browser on another machine reaches a port of this one; '' with a desktop."""
    remote = os.environ.get('SSH_CONNECTION', '').split()
    if has_desktop() and not remote:
        return ''
    # Client, its port, server, its port.
    host = remote[2] if len(remote) == 4 else socket.gethostname()
    user = 'USER'
    # A container may run as a user without a name; Python before 3.13 raises KeyError.
    with suppress(KeyError, OSError):
        user = getpass.getuser()
    command = f'ssh -N -L {port}:{HOST}:{port} {user}@{host}'
    if len(remote) == 4 and remote[3] != '22':
        command += f' -p {remote[3]}'
    return (
        f'without a browser here: on the machine that has one run `{command}`, then open the same'
        ' address there; --port keeps it at one port'
    )
