# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Server of the page: viser on one port, without its public tunnel.

viser checks neither the page that opens a connection nor a port in use, and its clients may
request a tunnel through a server of its authors. The class below adds the checks and removes the
tunnel.
"""

from __future__ import annotations

from contextlib import redirect_stdout
import io
from ipaddress import ip_address
import logging
import socket
from urllib.parse import urlsplit

from masmc_ros.errors import InputError
from viser import ViserServer

_LABEL = 'masmc play'


def is_local(host: str) -> bool:
    """Return True if only this machine reaches a host name or address."""
    if host == 'localhost':
        return True
    try:
        return ip_address(host.strip('[]')).is_loopback
    except ValueError:
        return False


class PlayServer(ViserServer):
    """Server of one page for all its viewers."""

    def __init__(self, host: str, port: int) -> None:
        """
        Listen.

        Parameters
        ----------
        host
            Address or name to listen on.
        port
            Port; 0 for any free one.

        Raises
        ------
        InputError
            If that is impossible.

        """
        _check_port(host, port)
        # Otherwise a connection that is no request of a browser prints a traceback.
        logging.getLogger('websockets').setLevel(logging.CRITICAL)
        # viser prints a table of addresses; the node logs its own line.
        with redirect_stdout(io.StringIO()):
            super().__init__(host=host, port=port, label=_LABEL, verbose=False)
        self._host = host
        if port and self.get_port() != port:
            self.stop()
            raise _rejected(host, port, 'another process has taken the port')

    @property
    def address(self) -> str:
        """Address of the page for a browser on this machine."""
        any_host = {'0.0.0.0': '127.0.0.1', '::': '[::1]'}
        host = any_host.get(self._host, self._host)
        if ':' in host and not host.startswith('['):
            host = f'[{host}]'
        return f'http://{host}:{self.get_port()}'

    def is_own_page(self, client: int | None) -> bool:
        """
        Return True if a viewer, by the number of its connection, shows the page of this server.

        Another page in the browser of this machine can connect as well. It must not command the
        robot. Its requests name its own host.
        """
        live = self._websock_server._live_connections
        connection = None if client is None else live.get(client)
        if connection is None or connection.request is None:
            return False
        headers = connection.request.headers
        origin = urlsplit(headers.get('Origin', '')).netloc
        # The name of a foreign page may lead to this machine: a local server accepts local names.
        host = urlsplit(f'//{origin}').hostname or ''
        return origin == headers.get('Host') and (is_local(host) or not is_local(self._host))

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Return None: the robot is never shared through a public server."""
        return None

    def stop(self) -> None:
        """Disconnect all viewers and stop the server."""
        with redirect_stdout(io.StringIO()):
            super().stop()


def _check_port(host: str, port: int) -> None:
    """Raise InputError for an unusable port, for which viser waits or takes another."""
    try:
        family, kind, _, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        with socket.socket(family, kind) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except (OSError, UnicodeError) as error:
        raise _rejected(host, port, getattr(error, 'strerror', None) or str(error)) from error


def _rejected(host: str, port: int, reason: str) -> InputError:
    return InputError(f'host = {host}, port = {port}: {reason}; name a free port of this machine')

