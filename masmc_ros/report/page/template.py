# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Pages from templates; a name without a value is an error."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from masmc_ros import __version__

_STYLE = Path(__file__).with_name('page.css')


def rendered(path: Path, **values: object) -> str:
    """Return the page of a template file with escaped values, the version and the style."""
    style = Markup(_STYLE.read_text(encoding='utf-8'))
    template = _environment(path.parent).get_template(path.name)
    return template.render(version=__version__, style=style, **values)


@cache
def _environment(folder: Path) -> Environment:
    """Return the environment of a folder; it keeps the compiled templates."""
    return Environment(
        loader=FileSystemLoader(folder),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
