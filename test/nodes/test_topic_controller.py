# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Controllers in other processes in `masmc compare`, on ROS topics."""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
import subprocess
import sys

from helpers.child_environment import child_environment, domain, domain_variables, ended
from helpers.processes import PAPER, Processes, ros_arguments
from masmc_ros.cli.main import main
from masmc_ros.nodes import topic_controller
from masmc_ros.params import plug_ins
import pytest

DAMPER = Path(__file__).parents[2] / 'examples' / 'damper.py'
LIMIT = 60.0
SHORT = ('--set', 'duration=0.1', '--trials', 'as it is')


@pytest.fixture(autouse=True)
def _no_controllers_remain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plug_ins, '_added', {})


@pytest.fixture
def number(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Yield the ROS domain of this process."""
    with domain() as number:
        for name, value in domain_variables(number).items():
            monkeypatch.setenv(name, value)
        yield number


def rows(folder: Path, *arguments: str) -> dict[str, dict[str, object]]:
    """Return the rows of a comparison by law."""
    assert main(['compare', str(PAPER), *SHORT, *arguments, '--output', str(folder)]) == 0
    found = json.loads((folder / 'compare.json').read_text())
    return {row.pop('law'): row for row in found}


def test_controller_node_has_row_of_its_law(tmp_path: Path, number: int) -> None:
    """Each run of two starts the node's estimate again."""
    with ended(Processes(number, tmp_path)) as started:
        started.start('controller', *ros_arguments(controller__law='rasmc'))
        found = rows(
            tmp_path, '--laws', 'rasmc', '--seeds', '2', '--controller', 'topics:node'
        )
    assert found['node']['lost'] == 0
    ignored = {'switching', 'observes'}
    node, law = ({n: v for n, v in row.items() if n not in ignored} for row in found.values())
    assert node == law


def test_other_node_has_row_of_same_function(tmp_path: Path, number: int) -> None:
    """Torques without a label answer the last state."""
    function = tmp_path / 'function.py'
    function.write_text('def braking(state, reference):\n    return -0.5 * state.velocity[-4:]\n')
    command = [sys.executable, str(DAMPER)]
    with subprocess.Popen(command, env=child_environment(), stderr=subprocess.PIPE) as node:
        try:
            found = rows(
                tmp_path, '--laws', 'smc', '--controller', f'{function}:braking',
                '--controller', 'topics:damper',
            )  # fmt: skip
        finally:
            node.kill()
    assert found['damper'] == found['braking'] != found['smc']


@pytest.mark.parametrize(
    ('arguments', 'error'),
    [
        (['topics:'], "--controller 'topics:': expected one topics:NAME"),
        (['topics:a', 'topics:b'], "'topics:b': expected one topics:NAME"),
        (['topics:smc'], "--controller 'smc': a law has this name"),
        (['topics:node'], 'topics:node: no node answers joint_states with effort_commands'),
    ],
)
def test_wrong_or_missing_node_is_one_line(
    tmp_path: Path,
    number: int,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    arguments: list[str],
    error: str,
) -> None:
    monkeypatch.setattr(topic_controller, 'DISCOVERY', 0.5)
    options = [option for name in arguments for option in ('--controller', name)]
    assert main(['compare', str(PAPER), *SHORT, '--laws', 'smc', *options,
                 '--output', str(tmp_path / 'out')]) == 2  # fmt: skip
    (line,) = capfd.readouterr().err.splitlines()
    assert error in line
    assert not (tmp_path / 'out').exists()


@pytest.mark.parametrize(
    ('answer', 'patience', 'error'),
    [
        ('return', 0.5, 'no answer on effort_commands to the state of 0 s within 0.5 s'),
        ('torques = [0.0] * 3', LIMIT, 'effort command: 3 numbers; expected 4'),
        (
            "torques = [float('nan')] * 4",
            LIMIT,
            "the torque of 'wheel_right_joint' is not a finite number",
        ),
    ],
)
def test_wrong_answer_of_node_is_one_line(
    tmp_path: Path,
    number: int,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    answer: str,
    patience: float,
    error: str,
) -> None:
    text = DAMPER.read_text()
    place = '        self._torques.publish('
    assert text.count(place) == 1
    program = tmp_path / 'node.py'
    program.write_text(text.replace(place, f'        {answer}\n{place}'))
    monkeypatch.setattr(topic_controller, 'PATIENCE', patience)
    with subprocess.Popen([sys.executable, str(program)], env=child_environment()) as node:
        try:
            status = main(['compare', str(PAPER), *SHORT, '--laws', 'smc', '--controller',
                           'topics:damper', '--output', str(tmp_path / 'out')])  # fmt: skip
        finally:
            node.kill()
    assert status == 2
    assert error in capfd.readouterr().err
    assert not (tmp_path / 'out').exists()
