# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc warm`: after it, neither a simulation nor a node compiles."""

from __future__ import annotations

from pathlib import Path

from helpers.small_tree import hand_at_start, write_scenario
from masmc_ros.cli.compile_notice import compile_notice
from masmc_ros.cli.main import main
import pytest


def test_warm_second_call_everything_present(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['warm', '--laws', 'rasmc']) == 0
    capsys.readouterr()
    assert main(['warm', '--laws', 'rasmc']) == 0
    assert capsys.readouterr().out == 'rasmc, tanh δ 0.2 for two_link: present\n'
    with compile_notice('') as watch:
        assert main(['simulate', 'paper', '--set', 'duration=0.5']) == 0
    assert watch.total == 0.0


@pytest.mark.slow
def test_warm_without_arguments_urdf_compiles_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['warm']) == 0
    assert 'for robots of URDFs' in capsys.readouterr().out.splitlines()[-1]
    file = write_scenario(tmp_path, hand_at_start(), 0.05)
    with compile_notice('') as watch:
        assert main(['simulate', str(file)]) == 0
    assert watch.total == 0.0


def test_warm_unknown_law_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['warm', '--laws', 'rasmc,pip']) == 2
    line = "masmc warm: --laws: 'pip' is unknown; did you mean pid?\n"
    assert capsys.readouterr().err == line
