# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Files over HTTP for an application of this machine: parts of them, from any web page.

A viewer reads the parts of a log that it shows by range requests. The addresses hold a secret,
so that other pages that the browser has open do not find the files.
"""

from __future__ import annotations

from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
import re
import secrets
import threading
from typing import Any, BinaryIO
from urllib.parse import quote, urlsplit

from masmc_ros.errors import InputError

HOST = '127.0.0.1'
_BLOCK = 1 << 16
"""Bytes that are sent within the timeout: a slow connection is not ended."""

_TIMEOUT = 30.0
"""Time in s for which a connection waits for the other side."""

_MOST_THREADS = 64
"""Threads of this process beyond which a connection is rejected; each connection has one."""

_BUSY = b'HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\nConnection: close\r\n\r\n'
_RANGE = re.compile(r'bytes=(\d{0,999})-(\d{0,999})', re.ASCII)


class FileServer(ThreadingHTTPServer):
    """Serves files to this machine alone; a context manager."""

    daemon_threads = True

    def __init__(self, port: int = 0) -> None:
        """Listen at a port, 0 being any free one; InputError where that is not possible."""
        self.files: dict[str, Path] = {}
        self._secret = secrets.token_urlsafe(12)
        try:
            super().__init__((HOST, port), _Handler)
        except (OSError, OverflowError) as error:
            raise InputError(f'port {port}: {error}; name a free one, or 0 for any') from error

    def add(self, path: Path, name: str = '') -> str:
        """Serve a file, by another name than its own if one is given; return its address."""
        location = f'/{self._secret}/{quote(name or path.name)}'
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
        """Say nothing: a viewer that hangs up does so while it is being sent something."""


class _Handler(BaseHTTPRequestHandler):
    server: FileServer
    protocol_version = 'HTTP/1.1'
    timeout = _TIMEOUT

    def do_OPTIONS(self) -> None:
        """Allow a page from elsewhere to ask for parts of the file."""
        self.send_response(HTTPStatus.NO_CONTENT)
        self._allow_pages()
        self.send_header('Access-Control-Allow-Methods', 'GET, HEAD, OPTIONS')
        self.send_header('Access-Control-Allow-Headers', 'Range')
        self.send_header('Access-Control-Max-Age', '600')
        # Browsers ask this of servers on the machine that they run on.
        self.send_header('Access-Control-Allow-Private-Network', 'true')
        self.end_headers()

    def do_HEAD(self) -> None:
        """Respond with the size of the file."""
        self._answer(with_content=False)

    def do_GET(self) -> None:
        """Send the file or a part of it."""
        self._answer(with_content=True)

    def log_message(self, *message: object) -> None:
        """Say nothing."""

    def _answer(self, *, with_content: bool) -> None:
        try:
            path = self.server.files[urlsplit(self.path).path]
        except ValueError:
            self._refuse(HTTPStatus.BAD_REQUEST)
            return
        except KeyError:
            self._refuse(HTTPStatus.NOT_FOUND)
            return
        try:
            stream = path.open('rb')
        except OSError:
            self._refuse(HTTPStatus.NOT_FOUND)
            return
        with stream:
            size = stream.seek(0, 2)
            part = _part(self.headers.get('Range'), size)
            if part is None:
                self._refuse(HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE, f'bytes */{size}')
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

    def _refuse(self, status: HTTPStatus, content_range: str = '') -> None:
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
    Return the bytes that a request asks for; None where the file has none of them.

    As HTTP allows, a header that is not understood, such as several ranges, asks for all.
    """
    match = _RANGE.fullmatch((header or '').replace(' ', ''))
    if match is None or match[0] == 'bytes=-':
        return range(size)
    first, last = match.groups()
    if not first:  # the last so many
        part = range(max(0, size - int(last)), size)
    elif last and int(last) < int(first):
        return range(size)
    else:
        part = range(int(first), min(size, int(last) + 1) if last else size)
    return part if len(part) else None
