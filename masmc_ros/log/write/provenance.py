# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""What a log says of its origin: versions, files, and the parameters in force."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from importlib.metadata import version
import json
from pathlib import Path
import platform
import subprocess
from typing import Any, TYPE_CHECKING

from masmc_ros import __version__
from masmc_ros.messages.parameter_record import ParameterRecord

if TYPE_CHECKING:
    from masmc_ros.log.write.writer import LogWriter

PARAMETERS = 'parameters'
"""Metadata record: the parameters at the start, a JSON object by node name."""

CHANGES = 'parameter_changes'
"""Metadata record: later changes and events in order, JSON objects with node, tick,
parameters and event."""

_PACKAGE = Path(__file__).resolve().parents[2]


def write_origin(writer: LogWriter, files: Mapping[str, bytes]) -> None:
    """Write versions, and files by name such as the parameter file."""
    writer.metadata(
        'versions',
        {
            'masmc_ros': __version__,
            'git': git_state(),
            'python': platform.python_version(),
            'numpy': version('numpy'),
            'numba': version('numba'),
            'machine': platform.machine(),
        },
    )
    for name, content in files.items():
        writer.attach(Path(name).name, _media_type(name), content)


def write_parameters(
    writer: LogWriter,
    parameters: Mapping[str, Mapping[str, Any]],
    changes: Iterable[ParameterRecord] = (),
) -> None:
    """Write the parameters at the start by node name, and what changed later."""
    writer.metadata(PARAMETERS, {node: json.dumps(dict(v)) for node, v in parameters.items()})
    texts = {
        f'{number:06d}': json.dumps(
            {
                'node': change.node,
                'tick': change.tick,
                'stamp': change.stamp,
                'parameters': change.changes,
                'event': change.event,
            }
        )
        for number, change in enumerate(changes)
    }
    if texts:
        writer.metadata(CHANGES, texts)


@cache
def git_state() -> str:
    """Return the commit that the package is of, `-dirty` with changes; empty if unknown."""
    if not (_PACKAGE.parent / '.git').exists():
        return ''
    try:
        command = ('git', 'describe', '--always', '--dirty', '--abbrev=12', '--exclude=*')
        done = subprocess.run(
            command, cwd=_PACKAGE, capture_output=True, text=True, timeout=5.0, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return ''
    return done.stdout.strip()


def _media_type(name: str) -> str:
    return 'application/xml' if name.endswith('.urdf') else 'application/yaml'
