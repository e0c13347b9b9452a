# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""List of the files that a report wrote, for the next report to remove."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
import hashlib
from operator import itemgetter
from pathlib import Path

from masmc_ros.output_files import write_file

MANIFEST = 'report.sha256'
"""Checksums in the form of `sha256sum`."""

Entry = tuple[str, str]
"""Checksum and name of a file."""


def entry(name: str, content: bytes) -> Entry:
    """Return the entry of a file in the manifest."""
    return hashlib.sha256(content).hexdigest(), name


def read_manifest(folder: Path) -> set[Entry]:
    """Return the entries of an earlier report; empty without one."""
    with suppress(OSError, UnicodeDecodeError):
        lines = (folder / MANIFEST).read_text(encoding='utf-8').splitlines()
        entries = (line.partition('  ') for line in lines)
        return {(digest, name) for digest, _, name in entries if Path(name).name == name}
    return set()


def write_manifest(folder: Path, entries: Iterable[Entry]) -> Path:
    """Write the manifest; return its path."""
    path = folder / MANIFEST
    lines = (f'{digest}  {name}\n' for digest, name in sorted(entries, key=itemgetter(1)))
    write_file(path, ''.join(lines).encode())
    return path


def remove_stale(folder: Path, earlier: Iterable[Entry], names: Iterable[str]) -> None:
    """
    Remove files of an earlier report whose names this report does not have.

    Files with a different content are kept.
    """
    kept = set(names)
    for digest, name in earlier:
        path = folder / name
        with suppress(OSError):
            if name not in kept and entry(name, path.read_bytes()) == (digest, name):
                path.unlink()
