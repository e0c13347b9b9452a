# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Figures of tools/docs_figures.py: one on each page of a law, one on the first page."""

from __future__ import annotations

from pathlib import Path
import posixpath
from typing import Any

FIGURES = Path(__file__).resolve().parents[2] / 'build' / 'docs_figures'


def _insert(app: Any, docname: str, source: list[str]) -> None:
    """Insert the figure of a page after the summary, or before the first table."""
    folder, name = posixpath.split(docname)
    if folder == 'reference/laws' and (figure := FIGURES / f'{name}.html').exists():
        before, heading, after = source[0].partition('\n## Equations')
    elif docname == 'index' and (figure := FIGURES / 'animation.html').exists():
        before, heading, after = source[0].partition('\n<a href="_static/paper.html">')
    else:
        return
    app.env.note_dependency(str(figure))  # a later build reads the page again if it changes
    source[0] = f'{before}\n{figure.read_text(encoding="utf-8")}{heading}{after}'


def setup(app: Any) -> dict[str, bool]:
    """Register the hook."""
    app.connect('source-read', _insert)
    return {'parallel_read_safe': True, 'parallel_write_safe': True}
