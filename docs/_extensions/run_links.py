# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Links from the pages of the laws to the page that computes runs, with the law selected."""

from __future__ import annotations

import posixpath
from typing import Any

_WITHOUT = {'index', 'claims', 'comparison', 'input_output_decoupling'}  # no law, or an alias
"""Pages without a link."""


def _add_link(app: Any, docname: str, source: list[str]) -> None:
    """Add a link before the first section of a law's page."""
    folder, name = posixpath.split(docname)
    if folder != 'reference/laws' or name in _WITHOUT:
        return
    title, heading, rest = source[0].partition('\n## ')
    address = f'../../_static/paper.html#law={name}'
    link = f'<a href="{address}">Try this law in the browser</a>, on the path of the paper.\n'
    source[0] = f'{title}\n{link}{heading}{rest}'


def setup(app: Any) -> dict[str, bool]:
    """Register the hook."""
    app.connect('source-read', _add_link)
    return {'parallel_read_safe': True, 'parallel_write_safe': True}
