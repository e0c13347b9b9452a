# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Two levels of pages in the navigation of every page.

The theme would list all modules of the Python API on every page, which takes most of the build
time. The pages of the API link to their modules themselves.
"""

from __future__ import annotations

from typing import Any

LEVELS = 2


def _limit_depth(
    app: Any, page: str, template: str, context: dict[str, Any], doctree: Any
) -> None:
    """Limit the depth of the toctree that the theme requests."""
    toctree = context.get('toctree')
    if toctree is not None:
        context['toctree'] = lambda **options: toctree(**{**options, 'maxdepth': LEVELS})


def setup(app: Any) -> dict[str, bool]:
    """Register the hook before that of the theme."""
    app.connect('html-page-context', _limit_depth, priority=100)
    return {'parallel_read_safe': True, 'parallel_write_safe': True}
