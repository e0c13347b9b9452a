# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Headers, programs and code for a GPU from the files in `templates/`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

INTERMEDIATE_CODE = [
    str(path) for path in sorted(Path(__file__).with_name('templates').glob('*.ll.jinja'))
]
"""Templates of LLVM, whose changes make stored object code outdated."""


def filled(template: str, content: Mapping[str, Any]) -> str:
    """Return a template of the folder `templates` with its content."""
    return _environment().get_template(template).render(content)


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader('masmc_ros.native'), undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True, keep_trailing_newline=True, autoescape=False,
    )  # fmt: skip
    environment.filters['wrapped'] = _wrapped
    return environment


def _wrapped(values: Iterable[str]) -> str:
    """Return numbers of an initialiser, a few in each line."""
    texts = list(values)
    lines = [', '.join(texts[i:i + 4]) for i in range(0, len(texts), 4)]
    return ',\n        '.join(lines)
