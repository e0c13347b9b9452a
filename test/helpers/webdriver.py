# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""A page with a live connection in a headless Chromium, driven by the WebDriver protocol."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterator
from contextlib import contextmanager
import json
from pathlib import Path
import re
import shutil
import signal
import subprocess
import time
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

from helpers.browser import CHROMIUM
import pytest

PATIENCE = 60.0
DRIVER = shutil.which('chromedriver')
needs_webdriver = pytest.mark.skipif(
    CHROMIUM is None or DRIVER is None, reason='no Chromium with its driver here'
)


class BrowserError(AssertionError):
    """Error of the browser or of a script in the page, with its message."""


class Browser:
    """Session of a browser; every request has a timeout."""

    def __init__(
        self, address: str, downloads: Path, home: Path, size: tuple[int, int]
    ) -> None:
        width, height = size
        self._address = address
        options = {
            'binary': CHROMIUM,
            'args': [
                '--headless=new',
                '--no-sandbox',  # Chromium rejects the user root otherwise
                '--disable-dev-shm-usage',
                # WebGL without a graphics card.
                '--use-angle=swiftshader',
                '--enable-unsafe-swiftshader',
                f'--window-size={width},{height}',
                f'--user-data-dir={home}',
            ],
            'prefs': {'download.default_directory': str(downloads)},
        }
        capabilities = {'alwaysMatch': {'goog:chromeOptions': options}}
        session = self._request('POST', '/session', {'capabilities': capabilities})
        self._session = f'/session/{session["sessionId"]}'

    def open(self, url: str) -> None:
        """Open a page."""
        self._request('POST', f'{self._session}/url', {'url': url})

    def run(self, script: str, *arguments: object) -> Any:
        """Return the result of the body of a function in the page."""
        content = {'script': script, 'args': arguments}
        return self._request('POST', f'{self._session}/execute/sync', content)

    def until(self, script: str, awaited: str, *arguments: object) -> Any:
        """Run a script until its result is true; return it."""
        if not (value := self.result(script, *arguments)):
            raise AssertionError(f'timeout: {awaited}\n{self.text()}')
        return value

    def result(self, script: str, *arguments: object, patience: float = PATIENCE) -> Any:
        """Run a script until its result is true, for `patience` s at most; return the result."""
        limit = time.monotonic() + patience
        while True:
            # Elements of a page that is being drawn may be missing: the script fails, and is
            # repeated.
            try:
                value, error = self.run(script, *arguments), None
            except BrowserError as failure:
                value, error = None, failure
            if value or time.monotonic() > limit:
                break
            time.sleep(0.1)
        if error is not None:
            raise error
        return value

    def press(self, selector: str, keys: str) -> None:
        """Send keys to the first element of a CSS selector."""
        element = self._request(
            'POST', f'{self._session}/element', {'using': 'css selector', 'value': selector}
        )
        (number,) = element.values()
        self._request('POST', f'{self._session}/element/{number}/value', {'text': keys})

    def text(self) -> str:
        """Return the text of the page."""
        return str(self.run('return document.body.innerText;'))

    def screenshot(self, path: Path) -> None:
        """Write a picture of the page."""
        path.write_bytes(base64.b64decode(self._request('GET', f'{self._session}/screenshot')))

    def close(self) -> None:
        """End the session and its browser."""
        self._request('DELETE', self._session)

    def _request(self, method: str, path: str, content: object = None) -> Any:
        data = None if content is None else json.dumps(content).encode()
        headers = {'Content-Type': 'application/json'}
        request = Request(f'{self._address}{path}', data, headers, method=method)
        try:
            with urlopen(request, timeout=PATIENCE) as response:
                return json.load(response)['value']
        except HTTPError as error:
            raise BrowserError(f'{path}: {error.read().decode()}') from None


@contextmanager
def browser(folder: Path, size: tuple[int, int] = (900, 500)) -> Iterator[Browser]:
    """Yield a browser of a size in pixels that saves files in a folder."""
    assert DRIVER is not None
    process = subprocess.Popen(
        [DRIVER, '--port=0'], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    try:
        assert process.stdout is not None
        started: Callable[[str], Any] = re.compile(r'started successfully on port (\d+)').search
        port = next(filter(None, map(started, process.stdout)))[1]
        session = Browser(f'http://127.0.0.1:{port}', folder, folder / 'home', size)
        try:
            yield session
        finally:
            session.close()
    finally:
        # Its browsers end with it.
        process.send_signal(signal.SIGINT)
        process.wait(PATIENCE)
