# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Pages in a headless Chromium, driven by the WebDriver protocol."""

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

import pytest

PATIENCE = 60.0
CHROMIUM = next(
    filter(None, map(shutil.which, ('chromium', 'chromium-browser', 'google-chrome'))), None
)
DRIVER = shutil.which('chromedriver')
needs_webdriver = pytest.mark.skipif(
    CHROMIUM is None or DRIVER is None, reason='no Chromium with its driver here'
)

# Runs in a report's page and writes its results into an element of the page. What an event
# changes is drawn in a later frame, on a busy machine much later: the page is settled when two
# frames were drawn and nothing has changed for a while.
_LOOK = """
<script>
(async () => {
  const problems = [];
  addEventListener('error', (event) => problems.push(event.message));
  addEventListener('unhandledrejection', (event) => problems.push(String(event.reason)));
  addEventListener('securitypolicyviolation', (event) => problems.push(event.violatedDirective));
  let changed = performance.now();
  new MutationObserver(() => (changed = performance.now())).observe(
    document.documentElement, { subtree: true, childList: true, attributes: true },
  );
  const frame = () => new Promise((go) => requestAnimationFrame(() => setTimeout(go, 0)));
  const settle = async () => {
    changed = performance.now();
    do {
      await frame();
      await frame();
    } while (performance.now() - changed < 300);
  };
  while (!document.documentElement.dataset.drawn) await frame();
  // Plots are drawn when they come near the window.
  for (const plot of document.querySelectorAll('.plot')) {
    plot.scrollIntoView();
    while (!plot.data) await frame();
  }
  scrollTo(0, 0);
  await settle();
%s
  found.problems = problems;
  const element = document.createElement('pre');
  element.id = 'found';
  element.textContent = JSON.stringify(found);
  document.body.append(element);
})();
</script>
"""


class BrowserError(AssertionError):
    """Error of the browser or of a script in the page, with its message."""


class Browser:
    """Session of a browser; every request has a timeout."""

    def __init__(self, address: str, folder: Path, size: tuple[int, int], *options: str) -> None:
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
                f'--user-data-dir={folder / "home"}',
                *options,
            ],
            'prefs': {'download.default_directory': str(folder)},
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
def browser(
    folder: Path, size: tuple[int, int] = (900, 500), *options: str
) -> Iterator[Browser]:
    """Yield a browser of a size in pixels that saves files in a folder."""
    assert DRIVER is not None
    process = subprocess.Popen(
        [DRIVER, '--port=0'], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    try:
        assert process.stdout is not None
        started: Callable[[str], Any] = re.compile(r'started successfully on port (\d+)').search
        port = next(filter(None, map(started, process.stdout)))[1]
        session = Browser(f'http://127.0.0.1:{port}', folder, size, *options)
        try:
            yield session
        finally:
            session.close()
    finally:
        # Its browsers end with it.
        process.send_signal(signal.SIGINT)
        process.wait(PATIENCE)


def look(
    report: Path, script: str, home: Path, *options: str, width: int = 1400
) -> dict[str, Any]:
    """Return the object `found` that a script fills in a report's page after it is drawn."""
    page = home / 'page.html'
    page.write_text(report.read_text().replace('<noscript>', f'{_LOOK % script}<noscript>'))
    with browser(home, (width, 900), *options) as session:
        session.open(page.as_uri())
        result: dict[str, Any] = json.loads(
            session.until("return document.querySelector('#found')?.textContent;", 'results')
        )
    return result
