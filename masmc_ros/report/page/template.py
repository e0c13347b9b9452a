# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Templates of pages; a name without a value is an error."""

from __future__ import annotations

from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template

STYLE = Path(__file__).with_name('page.css')


def template_at(path: Path) -> Template:
    """Return the template in a file; what it is filled with is escaped."""
    environment = Environment(
        loader=FileSystemLoader(path.parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(path.name)
