# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameter files of config/: every node in every namespace reads all values."""

from __future__ import annotations

from pathlib import Path

from masmc_ros.files import scenarios
from masmc_ros.params.file import read
from masmc_ros.scenario.node_parameters import NODES
import pytest

FILES = sorted(scenarios().values())
KEYS = {'/**', *(f'/**/{node}' for node in NODES)}

all_files = pytest.mark.parametrize('file', FILES, ids=[file.stem for file in FILES])


@all_files
def test_shipped_file_keys_match_every_namespace(file: Path) -> None:
    blocks = read(file).blocks
    assert {block.pattern for block in blocks} <= KEYS
    assert '/**' in {block.pattern for block in blocks}


@all_files
@pytest.mark.parametrize('namespace', ['/left', '/left/arm', '/a/b/c/d'])
def test_shipped_file_node_in_namespace_reads_all_values(file: Path, namespace: str) -> None:
    parameters = read(file)
    for node in NODES:
        values = parameters.for_node(node, namespace)
        assert values == parameters.for_node(node)
        for block in parameters.blocks:
            if block.pattern in ('/**', f'/**/{node}'):
                assert values.keys() >= block.values.keys()


@all_files
def test_shipped_file_contains_pacing(file: Path) -> None:
    """Without `pacing` a robot whose ticks exceed the period falls behind real time."""
    expected = 'realtime' if file.stem == 'realtime' else 'lockstep'
    for node in ('plant', 'controller'):
        assert read(file).for_node(node)['pacing'] == expected
