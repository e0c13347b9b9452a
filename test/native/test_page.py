# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Pages that compute runs: in Node and in a browser, they have the bits of this process."""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import sha256
import json
from pathlib import Path
import shutil
import subprocess

from helpers import small_tree
from helpers.processes import PAPER
from helpers.webdriver import browser, needs_webdriver
from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.loop.simulation import Simulation
from masmc_ros.native.page import page_of
from masmc_ros.params.text import yaml_text
from masmc_ros.scenario.scenario import load_scenario
import pytest

LAW = 'rasmc:tanh'
SHORT = ('duration=2.0',)
RUNS: tuple[dict[str, float | list[float]], ...] = (
    {},
    {
        'control_period': 0.002, 'plant.payload.mass': 0.5, 'plant.velocity_noise': 0.002,
        'plant.disturbance.amplitude': [3.0, 3.0, 6.0, 6.0], 'controller.model_scale': 0.83,
        'controller.gamma': 0.37, 'controller.torque_limit': 10.0,
    },
)  # fmt: skip
"""Settings of each kind: derived by Python, scaled, and written to records."""


@pytest.fixture(scope='module')
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp('page') / 'page.html'
    path.write_text(page_of(str(PAPER), SHORT, LAW, 'paper').html, encoding='utf-8')
    return path


def digest_here(settings: Mapping[str, float | list[float]]) -> str:
    texts = [f'{name}={yaml_text(value)}' for name, value in settings.items()]
    digest = sha256()
    for block in Simulation(load_scenario(str(PAPER), [*SHORT, *texts])).run():
        digest.update(block.signals.tobytes())
    return digest.hexdigest()


@pytest.mark.skipif(shutil.which('node') is None, reason='Node.js is not installed')
def test_page_in_node_has_the_bits_of_simulate(page: Path) -> None:
    runs = [json.dumps([LAW, settings]) for settings in RUNS]
    command = ['node', str(Path(__file__).with_name('run_page.mjs')), str(page), *runs]
    output = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout
    assert output.split() == [digest_here(settings) for settings in RUNS]


@needs_webdriver
@pytest.mark.slow
def test_moved_slider_in_browser_has_the_bits_of_simulate(page: Path, tmp_path: Path) -> None:
    shown = 'return document.documentElement.dataset.digest;'
    with browser(tmp_path) as opened:
        opened.open(page.as_uri())
        assert opened.until(shown, 'digest') == digest_here({})
        opened.press('#set-controller-k_s1', '\ue014')  # one step to the right
        moved = opened.until(
            'const { digest } = document.documentElement.dataset;'
            'return digest !== arguments[0] && digest;', 'digest after a change', digest_here({})
        )  # fmt: skip
        command = str(opened.run('return document.getElementById("command").textContent;'))
        (value,) = (float(word[16:]) for word in command.split() if 'k_s1' in word)
        assert value != 100.0
        assert moved == digest_here({'controller.k_s1': value})
        opened.run('document.getElementById("keep").click();')
        link = opened.until('return location.hash.includes("vs.law") && location.href;', 'link')
        opened.open('about:blank')
        opened.open(str(link))
        assert opened.until(shown, 'digest') == moved
        assert len(opened.run('return [...document.querySelectorAll("#results thead th")];')) == 3


@pytest.mark.parametrize(
    ('settings', 'laws', 'line'),
    [
        (('trajectory.type=arc',), '', 'trajectory.type = arc: a page computes line_sine only'),
        (('duration=1000.0',), '', 'duration = 1000: 1000001 ticks; expected at most 200000'),
        ((), 'smc:foo', "'foo' in 'smc:foo' is unknown"),
    ],
)
def test_page_that_cannot_be_computed_is_one_line(
    settings: tuple[str, ...], laws: str, line: str
) -> None:
    with pytest.raises(InputError, match=line):
        page_of(str(PAPER), settings, laws, 'paper')


def test_page_of_urdf_robot_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, page = tmp_path / 'small.urdf', tmp_path / 'page.html'
    file.write_text(small_tree.URDF, encoding='utf-8')
    assert main(['page', str(file), '--output', str(page)]) == 2
    assert "robot.urdf: a page draws the paper's robot only" in capsys.readouterr().err
    assert not page.exists()
