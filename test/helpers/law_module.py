# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Module of a law from its source."""

from __future__ import annotations

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType


def module_of(path: Path, source: str) -> ModuleType:
    """Return the module of a source, written to a file."""
    path.write_text(source, encoding='utf-8')
    spec = spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
