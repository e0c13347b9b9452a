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
from typing import Any

from helpers import small_tree
from helpers.processes import PAPER
from helpers.webdriver import browser, needs_webdriver
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import interpreted
from masmc_ros.law.registry import LAWS
from masmc_ros.loop.simulation import Simulation
from masmc_ros.native.page import page_of
from masmc_ros.params.declaration import Values
from masmc_ros.params.text import yaml_text
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
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


def digests_in_node(page: Path, *runs: list[Any]) -> list[str]:
    """Return the digests of runs (law, settings) of a page."""
    script = str(Path(__file__).with_name('run_page.mjs'))
    command = ['node', script, str(page), *map(json.dumps, runs)]
    run = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    return run.stdout.split()


def digest_in_python(values: Mapping[str, Values]) -> str:
    """Return the digest of a short run in plain Python."""
    digest = sha256()
    with interpreted(), np.errstate(all='ignore'):
        for block in Simulation(values).run():
            digest.update(block.signals.tobytes())
    return digest.hexdigest()


@pytest.mark.skipif(shutil.which('node') is None, reason='Node.js is not installed')
def test_page_in_node_has_the_bits_of_simulate(page: Path) -> None:
    runs = [[LAW, settings] for settings in RUNS]
    assert digests_in_node(page, *runs) == [digest_here(settings) for settings in RUNS]


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


@pytest.fixture(scope='module')
def all_laws(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    """Return a page of all laws, and the digests of their runs in plain Python."""
    path = tmp_path_factory.mktemp('all_laws') / 'page.html'
    settings = ('duration=0.1',)
    page = page_of(str(PAPER), settings, 'all', 'paper')
    path.write_text(page.html, encoding='utf-8')
    digests = {}
    for name in page.laws:
        law, _, switching = name.partition(':')
        chosen = f'controller.law={law}', f'controller.switching={switching or "tanh"}'
        digests[name] = digest_in_python(load_scenario(str(PAPER), [*settings, *chosen]))
    return path, digests


@pytest.mark.skipif(shutil.which('node') is None, reason='Node.js is not installed')
@pytest.mark.slow
def test_page_of_all_laws_in_node_has_bits_of_python(
    all_laws: tuple[Path, dict[str, str]],
) -> None:
    path, digests = all_laws
    other_names = {'input_output_decoupling'}
    assert {name.partition(':')[0] for name in digests} == set(LAWS) - other_names
    assert path.stat().st_size < 300_000
    assert digests_in_node(path, *([name, {}] for name in digests)) == list(digests.values())


@needs_webdriver
@pytest.mark.slow
def test_page_of_all_laws_in_browser_has_bits_of_python(
    all_laws: tuple[Path, dict[str, str]], tmp_path: Path
) -> None:
    path, digests = all_laws
    with browser(tmp_path) as opened:
        opened.open(path.as_uri())
        opened.until('return document.documentElement.dataset.digest;', 'digest')
        for name, digest in digests.items():
            computed = opened.run(
                'engine.run(arguments[0], {});'
                "return crypto.subtle.digest('SHA-256', engine.history()).then(hex);", name
            )  # fmt: skip
            assert computed == digest, name


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


@pytest.mark.skipif(shutil.which('node') is None, reason='Node.js is not installed')
@pytest.mark.slow
def test_page_of_urdf_robot_in_node_has_bits_of_python(tmp_path: Path) -> None:
    scenario = str(small_tree.write_scenario(tmp_path, small_tree.hand_at_start(), 0.05))
    path = tmp_path / 'page.html'
    page = page_of(scenario, (), '', 'small')
    path.write_text(page.html, encoding='utf-8')
    assert path.stat().st_size < 300_000
    settings: tuple[dict[str, float], ...] = (
        {}, {'control_period': 0.002, 'plant.velocity_noise': 0.002, 'controller.gamma': 0.37},
        {'controller.model_scale': 0.83},
    )  # fmt: skip
    runs = [[page.laws[0], changes] for changes in settings]
    assert digests_in_node(path, *runs) == [
        digest_in_python(load_scenario(scenario, [f'{key}={value}' for key, value in run.items()]))
        for run in settings
    ]
