# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The parameter files of config/: every node in every namespace reads every value of them."""

from __future__ import annotations

from pathlib import Path

from masmc_ros.params.file import read
from masmc_ros.params.node_parameters import NODES
from masmc_ros.share import scenarios
import pytest

FILES = sorted(scenarios().values())
KEYS = {'/**', *(f'/**/{node}' for node in NODES)}

each_file = pytest.mark.parametrize('file', FILES, ids=[file.stem for file in FILES])


@each_file
def test_a_shipped_file_has_keys_for_every_namespace(file: Path) -> None:
    blocks = read(file).blocks
    assert {block.pattern for block in blocks} <= KEYS
    assert '/**' in {block.pattern for block in blocks}


@each_file
@pytest.mark.parametrize('namespace', ['/left', '/left/arm', '/a/b/c/d'])
def test_a_node_in_a_namespace_reads_all_values(file: Path, namespace: str) -> None:
    parameters = read(file)
    for node in NODES:
        values = parameters.for_node(node, namespace)
        assert values == parameters.for_node(node)
        for block in parameters.blocks:
            if block.pattern in ('/**', f'/**/{node}'):
                assert values.keys() >= block.values.keys()


@each_file
def test_a_shipped_file_states_its_pacing(file: Path) -> None:
    """Without it a robot whose ticks take longer than a period falls behind the wall clock."""
    expected = 'realtime' if file.stem == 'realtime' else 'lockstep'
    for node in ('plant', 'controller'):
        assert read(file).for_node(node)['pacing'] == expected
