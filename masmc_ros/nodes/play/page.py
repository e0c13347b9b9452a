# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Page of the node: its server, and its layout with plots on the left and controls on the right.

viser checks neither the page that opens a connection nor a port in use, and its clients may
request a tunnel through a server of its authors. `PlayServer` adds the checks and removes the
tunnel.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from html import escape
import io
from ipaddress import ip_address
import logging
import socket
from typing import TypeVar
from urllib.parse import urlsplit

from masmc_ros.errors import InputError
from masmc_ros.nodes.play.plots import EstimateReference, Plots, ShownRobot
from masmc_ros.nodes.play.samples import WINDOW
from masmc_ros.nodes.play.scene import RobotScene
from viser import GuiInputHandle, ViserServer

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


T = TypeVar('T')

RATE = 20
"""Rate in Hz at which the robot is shown and sampled."""

SLOW = 4
"""Updates of the robot per update of plots and texts, which is at 5 Hz."""

MOST = int(RATE * WINDOW)
"""Largest number of samples of a plot."""

MOST_POINTS = 5000
"""Largest number of points of a path."""

CHANGES = 6
"""Number of changes that the page lists."""

_COMPARED = 'Dashed: the errors before the last change of a parameter, shifted to the current time'

_PLOTS = 380.0
"""Width of the plots in pixels."""


class Page:
    """
    Page without content.

    Attributes
    ----------
    server
        Server of the page, which listens.

    """

    def __init__(self, server: PlayServer) -> None:
        """Build the page of a server."""
        self.server = server
        gui = server.gui
        gui.configure_theme(control_layout='collapsible', show_logo=False, show_share_button=False)
        self.server.initial_camera.position = (-0.9, -1.1, 1.2)
        self.server.initial_camera.look_at = (0.2, 0.0, 0.1)
        panel = gui.add_panel()
        panel.dock_left()
        panel.set_width(_PLOTS)
        self._plot_tab = panel.add_tab('Plots')
        with self._plot_tab:
            self._compare = gui.add_checkbox(
                'Compare with before', initial_value=False, hint=_COMPARED, order=-2.0
            )
            self._compared = gui.add_html('', order=-1.0)
            self._plot_folder = gui.add_folder(None)
        self._follow = gui.add_checkbox('Follow robot', initial_value=True, order=9.0)
        hint = 'Green: torques of the motors; purple: disturbance of the simulated robot'
        self._arrows = gui.add_checkbox('Torques', initial_value=False, hint=hint, order=9.5)

    @property
    def is_followed(self) -> bool:
        """Return True if the camera follows the robot."""
        return bool(self._follow.value)

    @property
    def has_arrows(self) -> bool:
        """Return True if torques are shown as arrows."""
        return bool(self._arrows.value)

    def compare(self, plots: Plots) -> None:
        """Compare errors with those before the last change, if a viewer has selected it."""
        content = text_block([text] if (text := plots.compare(is_on=self._compare.value)) else [])
        if content != self._compared.content:
            self._compared.content = content

    @property
    def is_viewed(self) -> bool:
        """Return True if a viewer is connected."""
        return bool(self.server.get_clients())

    def add_scene(self, shown: ShownRobot, log: Callable[[str], object]) -> RobotScene:
        """Add the scene of a robot in place of a previous one; InputError if it is invalid."""
        return RobotScene(self.server.scene, shown.robot, shown.description, log)

    def add_plots(self, reference: EstimateReference) -> Plots:
        """Add the plots of a controller in place of previous ones."""
        self._plot_folder.remove()
        with self._plot_tab:
            self._plot_folder = self.server.gui.add_folder(None)
        with self._plot_folder:
            return Plots(
                self.server.gui, reference.mechanism, reference.theta, reference.meaning, MOST
            )


def change_text(time: float, text: str) -> str:
    """Return a change or an event at a time in s as a line of the page."""
    return f't = {time:.2f} s: {text}'


def text_block(lines: Sequence[str], style: str = '') -> str:
    """Return lines as HTML; texts of other nodes are escaped."""
    if not lines:
        return ''
    text = '<br>'.join(map(escape, lines))
    return f'<div style="font-size:0.8em;padding:0.3em 0.8em;{style}">{text}</div>'


def show_value(handle: GuiInputHandle[T], value: T) -> None:
    """Set the value that a slider or menu shows."""
    handle.value = value  # type: ignore[misc]  # its setter is not next to its getter
