# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Pages in a headless Chromium, if one is installed."""

from __future__ import annotations

import html
import json
from pathlib import Path
import re
import shutil
import subprocess
from typing import Any

import pytest

LIMIT = 120.0
CHROMIUM = next(
    filter(None, map(shutil.which, ('chromium', 'chromium-browser', 'google-chrome'))), None
)
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason='no Chromium here')

# Runs in the page and writes its results into an element of the page.
_LOOK = """
<script>
(async () => {
  const problems = [];
  addEventListener('error', (event) => problems.push(event.message));
  addEventListener('unhandledrejection', (event) => problems.push(String(event.reason)));
  addEventListener('securitypolicyviolation', (event) => problems.push(event.violatedDirective));
  const settle = () => new Promise((go) => setTimeout(go, 500));
  while (!document.documentElement.dataset.drawn) await new Promise((go) => setTimeout(go, 50));
%s
  found.problems = problems;
  const element = document.createElement('pre');
  element.id = 'found';
  element.textContent = JSON.stringify(found);
  document.body.append(element);
})();
</script>
"""


def chromium(home: Path, page: Path, *options: str) -> str:
    """Open a page and return what the browser prints."""
    assert CHROMIUM is not None
    command = [
        CHROMIUM,
        '--headless=new',
        '--no-sandbox',  # Chromium rejects the user root otherwise
        '--disable-gpu',
        '--disable-dev-shm-usage',
        f'--user-data-dir={home}',
        '--virtual-time-budget=30000',
        *options,
        page.as_uri(),
    ]
    return subprocess.run(command, capture_output=True, text=True, timeout=LIMIT).stdout


def look(report: Path, script: str, home: Path, *options: str) -> dict[str, Any]:
    """Return the object `found` that a script fills in a report's page after it is drawn."""
    page = home / 'page.html'
    page.write_text(report.read_text().replace('<noscript>', f'{_LOOK % script}<noscript>'))
    dom = chromium(home / 'home', page, '--dump-dom', *options)
    element = re.search(r'<pre id="found">(.*?)</pre>', dom)
    assert element, dom[-500:]
    result: dict[str, Any] = json.loads(html.unescape(element[1]))
    return result
