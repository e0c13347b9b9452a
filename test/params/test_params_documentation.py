# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters as Markdown tables and values as YAML."""

import math

from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.params.declaration import Parameter
from masmc_ros.params.file import parse_value
from masmc_ros.params.presentation import markdown_table
from masmc_ros.params.text import yaml_text
import pytest


def test_markdown_table_lists_parameters() -> None:
    table = markdown_table(
        [
            Parameter(
                'k_s1', 100.0, 'Gain', 'N·s/m', 4, broadcast=True, minimum=0.0, read_only=False
            ),
            Parameter('switching', 'tanh', 'Either a|b', choices=('sign', 'tanh')),
            Parameter('initial_pose', (0.0, 0.5), 'Pose', length=2),
            Parameter('topics', (), 'Topics'),
        ]
    )
    assert table == (
        '| parameter | meaning | unit | default | range | change |\n'
        '| --- | --- | --- | --- | --- | --- |\n'
        '| `k_s1` | Gain | N·s/m | `100.0` | a number or 4 numbers, each >= 0 | live |\n'
        '| `switching` | Either a\\|b |  | `tanh` | one of sign, tanh | read-only |\n'
        '| `initial_pose` | Pose |  | `[0.0, 0.5]` | 2 numbers | read-only |\n'
        '| `topics` | Topics |  | `[]` | an array of strings | read-only |\n'
    )


@given(st.text(), st.text(), st.text())
def test_markdown_table_any_text_has_six_cells_per_row(name: str, text: str, default: str) -> None:
    table = markdown_table([Parameter(f'x{name}'.split('|')[0].split()[0], default, text, text)])
    lines = table.splitlines()
    assert len(lines) == 3
    assert lines[2].replace(r'\|', '').count('|') == 7


@pytest.mark.parametrize(
    ('value', 'text'),
    [
        (True, 'true'),
        (20, '20'),
        (20.0, '20.0'),
        (1e-5, '1e-05'),
        (math.nan, '.nan'),
        (-math.inf, '-.inf'),
        ('rasmc', 'rasmc'),
        ('/scan', '/scan'),
        ('on', '"on"'),
        ('inf', '"inf"'),
        ('', '""'),
        ((1.0, 2.0), '[1.0, 2.0]'),
        (None, '[]'),
    ],
)
def test_yaml_text_of_value(value: object, text: str) -> None:
    assert yaml_text(value) == text


_STRINGS = st.text(st.characters(codec='utf-8', exclude_characters='\0'))
_SCALARS = (
    st.booleans(),
    st.integers(-(2**63), 2**63 - 1),
    # A subnormal double underflows in C's strtod; ROS 2 then reads a string.
    st.floats(allow_nan=False, allow_subnormal=False),
    _STRINGS,
)


@given(st.one_of(*_SCALARS, *(st.lists(scalar, min_size=1, max_size=4) for scalar in _SCALARS)))
def test_yaml_text_parsed_returns_value(value: object) -> None:
    text = yaml_text(value)
    assert len(text.splitlines()) == 1
    assert repr(parse_value(text)) == repr(value)
