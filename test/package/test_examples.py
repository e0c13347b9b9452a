# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Programs in examples/ run as they are."""

from __future__ import annotations

from pathlib import Path
import re
import subprocess
import sys

from helpers.child_environment import child_environment, domain_variables
from helpers.processes import PAPER, peer, processes, ros_arguments
import pytest

EXAMPLES = Path(__file__).parents[2] / 'examples'
LIMIT = 300.0
"""Time in s for a program, which may compile."""


def output_of(name: str) -> str:
    """Return what a program prints."""
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / f'{name}.py')],
        capture_output=True, text=True, timeout=LIMIT, env=child_environment(), check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def errors(table: str) -> list[tuple[str, float]]:
    """Return labels and the first RMS error in mm of the tables of runs."""
    row = re.compile(r'^(\S.*?)  +[\d.]+-[\d.]+ +([\d.]+) ', re.MULTILINE)
    return [(label, float(error)) for label, error in row.findall(table)]


def test_every_example_is_in_the_table() -> None:
    text = (EXAMPLES / 'README.md').read_text(encoding='utf-8')
    programs = {path.name for path in EXAMPLES.glob('*.py')}
    assert programs == set(re.findall(r'\[`(\w+\.py)`\]', text))


@pytest.mark.slow
def test_robot_follows_its_path() -> None:
    ((label, error),) = errors(output_of('cart_arm'))
    assert label.startswith('rasmc, implicit')
    assert error < 0.05


@pytest.mark.slow
def test_law_is_compared_with_smc() -> None:
    (smc, own) = errors(output_of('power_rate'))
    assert (smc[0], own[0]) == ('smc, tanh δ 0.2', 'power_rate')
    assert own[1] < smc[1]


@pytest.mark.slow
def test_path_is_followed() -> None:
    ((_, error),) = errors(output_of('lissajous'))
    assert error < 10.0


@pytest.mark.slow
def test_metric_grows_with_the_gain() -> None:
    energies = [float(value) for value in re.findall(r': ([\d.]+) J', output_of('energy'))]
    assert len(energies) == 3
    assert energies == sorted(energies)


def test_node_prints_errors_of_a_run(tmp_path: Path) -> None:
    with processes(tmp_path) as started, peer(started.domain) as tester:
        out = tmp_path / 'errors.txt'
        with out.open('w') as file:
            listener = subprocess.Popen(
                [sys.executable, str(EXAMPLES / 'largest_error.py')], stdout=file,
                env={**child_environment(), **domain_variables(started.domain)},
            )  # fmt: skip
        try:
            tester.until(lambda: 'largest_error' in tester.node.get_node_names(), 'the node')
            started.start_all(
                *ros_arguments(PAPER, duration=2.5), nodes=('plant', 'trajectory', 'controller')
            )
            assert set(started.wait().values()) == {0}, started.output()
            listener.wait(LIMIT)
        finally:
            listener.kill()
            listener.wait()
        lines = re.findall(r'^(\d) s: ([\d.]+) mm$', out.read_text(), re.MULTILINE)
        assert [second for second, _ in lines] == ['0', '1', '2']
        first, *_, last = (float(error) for _, error in lines)
        assert last < first
