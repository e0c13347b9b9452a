# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Files over HTTP for an application of this machine, in parts and for any web page.

A viewer reads the parts of a log that it shows by range requests. The addresses contain a secret;
therefore other pages in the browser cannot find the files. `tunnel_hint` is the way to a port of
this machine from another one.
"""

from __future__ import annotations

from contextlib import suppress
import getpass
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
import os
from pathlib import Path
import re
import secrets
import socket
import sys
import threading
from typing import Any, BinaryIO
from urllib.parse import quote, urlsplit

from masmc_ros.errors import InputError

HOST = '127.0.0.1'
_BLOCK = 1 << 16
"""Bytes that are sent at a time, each within the timeout."""

_TIMEOUT = 30.0
"""Time in s after which a connection without data ends."""

_MOST_THREADS = 64
"""Maximum number of threads of this process; each connection has one."""

_BUSY = b'HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\nConnection: close\r\n\r\n'
_RANGE = re.compile(r'bytes=(\d{0,999})-(\d{0,999})', re.ASCII)


class FileServer(ThreadingHTTPServer):
    """Context manager that serves files to this machine only."""

    daemon_threads = True

    def __init__(self, port: int = 0) -> None:
        """Initialise the server at a port, 0: any free one; InputError if that is not possible."""
        self.files: dict[str, Path] = {}
        self._secret = secrets.token_urlsafe(12)
        try:
            super().__init__((HOST, port), _Handler)
        except (OSError, OverflowError) as error:
            raise InputError(f'port {port}: {error}; name a free one, or 0 for any') from error

    def add(self, path: Path, name: str = '') -> str:
        """Serve a file, by default with its own name; return its address."""
        location = f'/{self._secret}/{quote(os.fsencode(name or path.name))}'
        self.files[location] = path
        return f'http://{HOST}:{self.server_port}{location}'

    def verify_request(self, request: Any, client_address: object) -> bool:
        """Return True if a connection gets a thread; otherwise respond with a retry status."""
        if threading.active_count() <= _MOST_THREADS:
            return True
        with suppress(OSError):
            request.sendall(_BUSY)
        return False

    def handle_error(self, request: object, client_address: object) -> None:
        """Ignore errors: a viewer may close a connection at any time."""


class _Handler(BaseHTTPRequestHandler):
    server: FileServer
    protocol_version = 'HTTP/1.1'
    timeout = _TIMEOUT

    def do_OPTIONS(self) -> None:
        """Allow pages of other origins to request parts of the file."""
        self.send_response(HTTPStatus.NO_CONTENT)
        self._allow_pages()
        self.send_header('Access-Control-Allow-Methods', 'GET, HEAD, OPTIONS')
        self.send_header('Access-Control-Allow-Headers', 'Range')
        self.send_header('Access-Control-Max-Age', '600')
        # Browsers require this of servers on their own machine.
        self.send_header('Access-Control-Allow-Private-Network', 'true')
        self.end_headers()

    def do_HEAD(self) -> None:
        """Respond with the size of the file."""
        self._respond(with_content=False)

    def do_GET(self) -> None:
        """Send the file or a part of it."""
        self._respond(with_content=True)

    def log_message(self, *message: object) -> None:
        """Log no requests."""

    def _respond(self, *, with_content: bool) -> None:
        try:
            path = self.server.files[urlsplit(self.path).path]
        except ValueError:
            self._reject(HTTPStatus.BAD_REQUEST)
            return
        except KeyError:
            self._reject(HTTPStatus.NOT_FOUND)
            return
        try:
            stream = path.open('rb')
        except OSError:
            self._reject(HTTPStatus.NOT_FOUND)
            return
        with stream:
            size = stream.seek(0, 2)
            part = _part(self.headers.get('Range'), size)
            if part is None:
                self._reject(HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE, f'bytes */{size}')
                return
            whole = part == range(size)
            self.send_response(HTTPStatus.OK if whole else HTTPStatus.PARTIAL_CONTENT)
            self._allow_pages()
            self.send_header('Accept-Ranges', 'bytes')
            self.send_header('Content-Type', 'application/octet-stream')
            self.send_header('Content-Length', str(len(part)))
            if not whole:
                self.send_header('Content-Range', f'bytes {part[0]}-{part[-1]}/{size}')
            self.end_headers()
            if with_content:
                self._send(stream, part)

    def _send(self, stream: BinaryIO, part: range) -> None:
        stream.seek(part.start)
        left = len(part)
        while left and (block := stream.read(min(left, _BLOCK))):
            self.wfile.write(block)
            left -= len(block)

    def _reject(self, status: HTTPStatus, content_range: str = '') -> None:
        self.send_response(status)
        self._allow_pages()
        self.send_header('Content-Length', '0')
        if content_range:
            self.send_header('Content-Range', content_range)
        self.end_headers()

    def _allow_pages(self) -> None:
        self.send_header('Access-Control-Allow-Origin', '*')
        self.send_header(
            'Access-Control-Expose-Headers', 'Accept-Ranges, Content-Length, Content-Range'
        )


def _part(header: str | None, size: int) -> range | None:
    """
    Return the requested bytes; None if they are outside the file.

    As HTTP allows, a header that is not supported, such as several ranges, requests the file.
    """
    match = _RANGE.fullmatch((header or '').replace(' ', ''))
    if match is None or match[0] == 'bytes=-':
        return range(size)
    first, last = match.groups()
    if not first:  # the last bytes
        part = range(max(0, size - int(last)), size)
    elif last and int(last) < int(first):
        return range(size)
    else:
        part = range(int(first), min(size, int(last) + 1) if last else size)
    return part if len(part) else None


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
