# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Origin of a run in its log: versions, files and parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import cache
from importlib.metadata import version
import json
from pathlib import Path
import platform
import subprocess
from typing import TYPE_CHECKING

from masmc_ros import __version__
from masmc_ros.messages.parameter_record import ParameterRecord
from masmc_ros.params.declaration import Values

if TYPE_CHECKING:
    from masmc_ros.log.write.writer import LogWriter

PARAMETERS = 'parameters'
"""Metadata record: the parameters at the start, a JSON object by node name."""

CHANGES = 'parameter_changes'
"""Metadata record: later changes and events in order, as JSON objects."""

_PACKAGE = Path(__file__).resolve().parents[2]


def write_origin(writer: LogWriter, files: Mapping[str, bytes]) -> None:
    """Write versions, and files by name, such as the parameter file."""
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
        kind = 'xml' if name.endswith('.urdf') else 'yaml'
        writer.attach(Path(name).name, f'application/{kind}', content)


def write_parameters(
    writer: LogWriter,
    parameters: Mapping[str, Values],
    changes: Iterable[ParameterRecord] = (),
) -> None:
    """
    Write the parameters of a run.

    Parameters
    ----------
    writer
        the log.
    parameters
        values at the start by node.
    changes
        later changes and events in their order.

    """
    starts = {node: json.dumps(dict(values)) for node, values in parameters.items()}
    writer.metadata(PARAMETERS, starts)
    texts = {
        f'{number:06d}': json.dumps(
            {
                'node': change.node, 'tick': change.tick, 'stamp': change.stamp,
                'parameters': change.changes, 'event': change.event,
            }
        )
        for number, change in enumerate(changes)
    }
    if texts:
        writer.metadata(CHANGES, texts)


@cache
def git_state() -> str:
    """Return the commit of the package, `-dirty` with changes; empty if unknown."""
    if not (_PACKAGE.parent / '.git').exists():
        return ''
    with suppress(OSError, subprocess.SubprocessError):
        command = ('git', 'describe', '--always', '--dirty', '--abbrev=12', '--exclude=*')
        done = subprocess.run(
            command, cwd=_PACKAGE, capture_output=True, text=True, timeout=60.0, check=True
        )
        return done.stdout.strip()
    return ''
