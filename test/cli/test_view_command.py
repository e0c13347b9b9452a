# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc view`: file server of a log for viewers, and start of installed viewers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from http.client import HTTPConnection, HTTPResponse
import os
from pathlib import Path
import re
import signal
import socket
import subprocess
import sys
import threading
from typing import NamedTuple
from urllib.parse import parse_qs, urlsplit

from helpers.viewed_run import computed_run, ROOT
from hypothesis import given, settings
from hypothesis import strategies as st
from masmc_ros.cli import file_server
from masmc_ros.cli.file_server import FileServer, tunnel_hint
from masmc_ros.cli.served_meshes import described
from masmc_ros.errors import InputError
from mcap.reader import make_reader
import pytest

PATIENCE = 60.0


@pytest.fixture(scope='module')
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return computed_run(tmp_path_factory.mktemp('a run'), 0.5)


class Served(NamedTuple):
    process: subprocess.Popen[str]
    lines: list[str]
    url: str


@contextmanager
def viewing(log: Path, *arguments: str, path: str = '/usr/bin:/bin') -> Iterator[Served]:
    """Yield a running `masmc view` that has printed its instructions."""
    with subprocess.Popen(
        [sys.executable, '-m', 'masmc_ros.cli.main', 'view', str(log), *arguments],
        env={**os.environ, 'PATH': path, 'PYTHONPATH': os.pathsep.join(sys.path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        # The timer ends the reading of its output in any case.
        guard = threading.Timer(PATIENCE, process.kill)
        guard.start()
        try:
            assert process.stdout is not None
            lines = []
            for line in process.stdout:
                lines.append(line.rstrip('\n'))
                if 'Ctrl-C' in line:
                    break
            urls = re.findall(r'http://\S+', '\n'.join(lines))
            yield Served(process, lines, urls[0] if urls else '')
        finally:
            process.terminate()  # it removes its folder; the timer kills it otherwise
            process.wait()
            guard.cancel()


def ask(url: str, method: str = 'GET', **headers: str) -> tuple[HTTPResponse, bytes]:
    parts = urlsplit(url)
    connection = HTTPConnection(parts.hostname or '', parts.port, timeout=PATIENCE)
    try:
        connection.request(method, parts.path, headers=headers)
        response = connection.getresponse()
        return response, response.read()
    finally:
        connection.close()


class Remote:
    """Seekable file at an address, read by ranges as viewers do."""

    def __init__(self, url: str) -> None:
        self._url = url
        self._size = int(ask(url, 'HEAD')[0].headers['Content-Length'])
        self._position = 0

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = 0) -> int:
        self._position = offset + (0, self._position, self._size)[whence]
        return self._position

    def tell(self) -> int:
        return self._position

    def read(self, count: int = -1) -> bytes:
        end = self._size if count < 0 else min(self._size, self._position + count)
        if end == self._position:
            return b''
        response, data = ask(self._url, Range=f'bytes={self._position}-{end - 1}')
        assert response.status == 206
        self._position = end
        return data


def test_view_log_read_by_ranges(log: Path) -> None:
    with viewing(log) as served, log.open('rb') as stream:
        remote = make_reader(Remote(served.url))
        local = make_reader(stream)
        assert list(remote.iter_messages()) == list(local.iter_messages())


def test_view_output_has_addresses_and_layout(log: Path) -> None:
    with viewing(log) as served:
        text = '\n'.join(served.lines)
        addresses = re.findall(r'(?:https://app\.foxglove\.dev/|foxglove://open)\?\S+', text)
        assert len(addresses) == 2
        for address in addresses:
            query = parse_qs(urlsplit(address).query)
            assert query == {'ds': ['remote-file'], 'ds.url': [served.url]}
        assert str(ROOT / 'config' / 'foxglove.json') in text
        assert urlsplit(served.url).hostname == '127.0.0.1'


@pytest.mark.parametrize(
    ('variables', 'way'),
    [
        ({'DISPLAY': ':0'}, ''),
        ({}, f'@{socket.gethostname()}`'),
        ({'SSH_CONNECTION': '10.0.0.2 5555 10.0.0.7 2222'}, '@10.0.0.7 -p 2222`'),
    ],
)
def test_view_without_desktop_prints_ssh_command(
    log: Path, variables: dict[str, str], way: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ('DISPLAY', 'WAYLAND_DISPLAY', 'SSH_CONNECTION'):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    with viewing(log) as served:
        port = urlsplit(served.url).port
        lines = [line for line in served.lines if f'ssh -N -L {port}:127.0.0.1:{port} ' in line]
        assert len(lines) == bool(way)
        assert all(way in line and '--port' in line for line in lines)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_view_signal_status_0(log: Path, number: signal.Signals) -> None:
    if signal.getsignal(number) is signal.SIG_IGN:
        pytest.skip('processes in the background of a script ignore it')
    with viewing(log) as served:
        served.process.send_signal(number)
        assert served.process.wait(PATIENCE) == 0
        assert served.process.stderr is not None
        assert served.process.stderr.read().strip() == ''


@pytest.fixture(scope='module')
def small() -> Iterator[tuple[str, bytes]]:
    """Yield the address of a small file that this process serves, and its content."""
    import tempfile

    content = bytes(range(256)) * 4
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'a file.mcap'
        path.write_bytes(content)
        with FileServer() as server:
            thread = threading.Thread(target=server.serve_forever)
            thread.start()
            try:
                yield server.add(path), content
            finally:
                server.shutdown()
                thread.join()


@given(st.integers(0, 1200), st.integers(0, 1200))
@settings(max_examples=60)
def test_file_server_any_range_has_bytes_of_file(
    small: tuple[str, bytes], first: int, length: int
) -> None:
    url, content = small
    response, data = ask(url, Range=f'bytes={first}-{first + length}')
    if first >= len(content):
        assert response.status == 416
        assert response.headers['Content-Range'] == f'bytes */{len(content)}'
        return
    assert data == content[first:first + length + 1]
    assert int(response.headers['Content-Length']) == len(data)
    if len(data) < len(content):
        assert response.status == 206
        last = first + len(data) - 1
        assert response.headers['Content-Range'] == f'bytes {first}-{last}/{len(content)}'


@pytest.mark.parametrize(
    ('header', 'start', 'end'),
    [
        ('bytes=100-', 100, 1024),
        ('bytes=-100', 924, 1024),
        ('bytes=-5000', 0, 1024),
        ('bytes=', 0, 1024),
        ('bytes=5-3', 0, 1024),
        ('bytes=0-1,5-6', 0, 1024),
        ('lines=1-2', 0, 1024),
        (f'bytes=5-{"9" * 900}', 5, 1024),
        (f'bytes={"9" * 5000}-', 0, 1024),
        (f'bytes=-{"9" * 5000}', 0, 1024),
    ],
)
def test_file_server_other_forms_of_range_served(
    small: tuple[str, bytes], header: str, start: int, end: int
) -> None:
    url, content = small
    response, data = ask(url, Range=header)
    assert data == content[start:end]
    assert response.status == (200 if len(data) == len(content) else 206)


def test_file_server_cors_headers_allow_ranges_and_size(small: tuple[str, bytes]) -> None:
    url, content = small
    response, _ = ask(url, 'OPTIONS', Origin='https://app.foxglove.dev')
    assert response.status == 204
    assert 'Range' in response.headers['Access-Control-Allow-Headers']
    assert response.headers['Access-Control-Allow-Private-Network'] == 'true'
    response, data = ask(url, 'HEAD')
    assert data == b''
    assert response.headers['Content-Length'] == str(len(content))
    assert response.headers['Accept-Ranges'] == 'bytes'
    for method in ('HEAD', 'GET', 'OPTIONS'):
        assert ask(url, method)[0].headers['Access-Control-Allow-Origin'] == '*'
    exposed = response.headers['Access-Control-Expose-Headers']
    assert {'Content-Length', 'Content-Range', 'Accept-Ranges'} <= set(exposed.split(', '))


def test_file_server_other_path_status_404(small: tuple[str, bytes]) -> None:
    url, _ = small
    root = '{0.scheme}://{0.netloc}'.format(urlsplit(url))
    secret = urlsplit(url).path.split('/')[1]
    for path in ('/', '/a%20file.mcap', f'/{secret}/', f'/{secret}/../../etc/passwd'):
        response, data = ask(f'{root}{path}')
        assert (response.status, data) == (404, b'')
    assert ask(url, 'POST')[0].status == 501


def test_file_server_malformed_url_status_400(small: tuple[str, bytes]) -> None:
    with _connected(small[0]) as connection:
        connection.sendall(b'GET http://[ HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n')
        assert connection.recv(1000).startswith(b'HTTP/1.1 400 ')


@pytest.mark.parametrize('part', [b'', b'GET /', b'GET / HTTP/1.1\r\nHost'])
def test_file_server_unfinished_request_connection_ends(
    small: tuple[str, bytes], part: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(file_server._Handler, 'timeout', 0.2)
    with _connected(small[0]) as connection:
        connection.sendall(part)
        assert connection.recv(1000) == b''


def test_file_server_too_many_connections_status_503(
    small: tuple[str, bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    request = b'GET / HTTP/1.1\r\nHost: a\r\n'
    with _connected(small[0]) as first:
        first.sendall(request + b'\r\n')
        assert first.recv(1000).startswith(b'HTTP/1.1 404 ')
        # Threads of earlier connections may still end.
        monkeypatch.setattr(file_server, '_MOST_THREADS', 0)
        with _connected(small[0]) as second:
            assert second.recv(1000).startswith(b'HTTP/1.1 503 ')
        first.sendall(request + b'Connection: close\r\n\r\n')
        assert b'HTTP/1.1 404 ' in first.recv(10_000)


def _connected(url: str) -> socket.socket:
    parts = urlsplit(url)
    return socket.create_connection((parts.hostname, parts.port), PATIENCE)


@pytest.mark.parametrize('status', [0, 1])
def test_view_installed_viewer_opens_file(log: Path, tmp_path: Path, status: int) -> None:
    program = tmp_path / 'foxglove-studio'
    opened = tmp_path / 'opened'
    program.write_text(f'#!/bin/sh\nprintf "%s" "$1" > "{opened}"\nexit {status}\n')
    program.chmod(0o755)
    with viewing(log, path=f'{tmp_path}:/usr/bin:/bin') as served:
        assert opened.read_text() == str(log.resolve())
        if status:  # another program of that name
            assert served.url
        else:
            assert served.process.wait(PATIENCE) == 0
            assert not served.url
            assert any('foxglove.json' in line for line in served.lines)


def test_view_user_without_name_prints_ssh_command(monkeypatch: pytest.MonkeyPatch) -> None:
    """A container may run as such a user."""
    for name in ('LOGNAME', 'USER', 'LNAME', 'USERNAME', 'DISPLAY', 'WAYLAND_DISPLAY'):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(os, 'getuid', lambda: 2_000_000_001)
    assert f'USER@{socket.gethostname()}' in tunnel_hint(8766)


def test_view_damaged_summary_raises_one_line(log: Path, tmp_path: Path) -> None:
    damaged = tmp_path / 'damaged.mcap'
    content = bytearray(log.read_bytes())
    # The definitions at the start of the summary.
    start = int.from_bytes(content[-28:-20], 'little')
    content[start:start + 100] = bytes(100 * [0x59])
    damaged.write_bytes(content)
    with pytest.raises(InputError, match=r'damaged\.mcap: the log is damaged: .*masmc recover'):
        described(damaged)


def test_file_server_file_name_without_text_is_served(tmp_path: Path) -> None:
    path = tmp_path / 'bad\udcff.mcap'
    path.write_bytes(b'content')
    with FileServer() as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        assert ask(server.add(path))[1] == b'content'
        server.shutdown()


@pytest.mark.slow
def test_view_invalid_input_one_error_line(log: Path, tmp_path: Path) -> None:
    text = tmp_path / 'text.mcap'
    text.write_text('no log')
    torn = tmp_path / 'torn.mcap'
    torn.write_bytes(log.read_bytes()[:-100])
    short = tmp_path / 'short.mcap'
    short.write_bytes(log.read_bytes()[:8])
    with socket.socket() as used:
        used.bind(('127.0.0.1', 0))
        used.listen()
        port = str(used.getsockname()[1])
        for arguments, words in (
            ((str(tmp_path / 'none.mcap'),), ('none.mcap',)),
            ((str(tmp_path),), ('folder',)),
            ((str(text),), ('text.mcap', 'MCAP')),
            ((str(torn),), ('torn.mcap', 'truncated', f'`masmc recover {torn}`')),
            ((str(short),), ('short.mcap',)),
            ((str(log), '--port', port), (port,)),
            ((str(log), '--port', '70000'), ('70000',)),
            ((str(log), '--port', 'x'), ('port',)),
            ((), ('RUN.mcap',)),
        ):
            result = subprocess.run(
                [sys.executable, '-m', 'masmc_ros.cli.main', 'view', *arguments],
                env={
                    **os.environ,
                    'PATH': '/usr/bin:/bin',
                    'PYTHONPATH': os.pathsep.join(sys.path),
                },
                capture_output=True,
                text=True,
                timeout=PATIENCE,
            )
            assert result.returncode == 2, arguments
            assert result.stdout == ''
            assert result.stderr.count('\n') == 1, result.stderr
            for word in words:
                assert word in result.stderr
