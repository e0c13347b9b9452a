# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Directive `mermaid`: a diagram drawn by the browser from a script next to the pages.

The script is loaded as a classic script, because browsers reject modules in pages that are
opened from a disk. Without JavaScript, the source of the diagram is shown.
"""

from __future__ import annotations

import html
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import Directive

_START = "mermaid.initialize({startOnLoad: true, theme: 'neutral', securityLevel: 'strict'});"


class MermaidDiagram(Directive):
    """Content of the directive as a `pre` element of class `mermaid`."""

    has_content = True
    option_spec: ClassVar[dict[str, Any]] = {}

    def run(self) -> list[nodes.Node]:
        """Return the HTML of the diagram."""
        source = html.escape('\n'.join(self.content))
        return [nodes.raw('', f'<pre class="mermaid">\n{source}\n</pre>', format='html')]


def _add_script(
    app: Any, page: str, template: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Load the script on pages with a diagram."""
    if doctree is None:
        return
    if any('class="mermaid"' in raw.astext() for raw in doctree.findall(nodes.raw)):
        app.add_js_file('mermaid/mermaid.min.js')
        app.add_js_file(None, body=_START)


def setup(app: Any) -> dict[str, bool]:
    """Register the directive and the hook."""
    app.add_directive('mermaid', MermaidDiagram)
    app.connect('html-page-context', _add_script)
    return {'parallel_read_safe': True, 'parallel_write_safe': True}
