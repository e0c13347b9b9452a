# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Links of pages to files outside docs/ become links to the repository."""

from __future__ import annotations

import posixpath
import re
from typing import Any

_LINK = re.compile(r'\[((?:`[^`]*`|[^\[\]`])*)\]\((\.\./[^)\s#]*)(#[^)\s]*)?\)')


def _rewrite_links(app: Any, docname: str, source: list[str]) -> None:
    """
    Replace relative targets outside docs/ by addresses in the repository, if that has one.

    Parameters
    ----------
    app
        Sphinx application; `repository_url` of its settings is the base of the addresses, empty
        for texts instead of links.
    docname
        Name of the page, relative to docs/ and without suffix.
    source
        List with the text of the page as its only entry, which is replaced.

    """
    folder = posixpath.join('docs', posixpath.dirname(docname))

    def _address(match: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(folder, match[2]))
        if target == 'docs' or target.startswith('docs/'):
            return match[0]
        if not app.config.repository_url:
            return match[1]
        address = f'{app.config.repository_url}/blob/main/{target}{match[3] or ""}'
        return f'[{match[1]}](<{address}>)'

    source[0] = _LINK.sub(_address, source[0])


def setup(app: Any) -> dict[str, bool]:
    """Register the setting and the hook."""
    app.add_config_value('repository_url', '', 'env')
    app.connect('source-read', _rewrite_links)
    return {'parallel_read_safe': True, 'parallel_write_safe': True}
