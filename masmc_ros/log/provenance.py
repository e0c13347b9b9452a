# SPDX-License-Identifier: Apache-2.0
"""What a log says of its origin: versions, parameters and the parameter file."""

from __future__ import annotations

from collections.abc import Mapping
import json
from pathlib import Path
import platform
from typing import Any

import numba
import numpy as np

from masmc_ros import __version__
from masmc_ros.log.writer import LogWriter

PARAMETERS = 'parameters'
"""Metadata record: the parameters at the start, a JSON object by node name."""

CHANGES = 'parameter_changes'
"""Metadata record: later changes in order, JSON objects with node, tick and parameters."""


def write_provenance(
    writer: LogWriter,
    parameters: Mapping[str, Mapping[str, Any]],
    changes: list[dict[str, Any]],
    files: Mapping[str, bytes],
) -> None:
    """Write parameters by node name, changes to them, and parameter files by name."""
    writer.metadata(
        'versions',
        {
            'masmc_ros': __version__,
            'python': platform.python_version(),
            'numpy': np.__version__,
            'numba': numba.__version__,
            'machine': platform.machine(),
        },
    )
    writer.metadata(PARAMETERS, {node: json.dumps(dict(v)) for node, v in parameters.items()})
    if changes:
        texts = {f'{number:06d}': json.dumps(change) for number, change in enumerate(changes)}
        writer.metadata(CHANGES, texts)
    for name, content in files.items():
        writer.attach(Path(name).name, 'application/yaml', content)
