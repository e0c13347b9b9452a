# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""The documents' tables are generated and current, and their local links lead somewhere."""

import importlib.util
from pathlib import Path
import re
from types import ModuleType

from masmc_ros.params.file import read
from masmc_ros.robot.two_link.paper_robot import TORQUE_LIMIT, TORQUE_RATE_LIMIT
from masmc_ros.scenario.node_parameters import declared, NODES
from masmc_ros.scenario.scenario import load_scenario
import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = [
    ROOT / 'README.md',
    ROOT / 'CONTRIBUTING.md',
    ROOT / 'examples' / 'README.md',
    *(p for p in sorted((ROOT / 'docs').rglob('*.md')) if ROOT / 'docs' / 'api' not in p.parents),
]
LINK = re.compile(r'\]\((?!https?:|#)([^)#\s]+)')


def _tables() -> ModuleType:
    spec = importlib.util.spec_from_file_location('tables', ROOT / 'tools' / 'tables.py')
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize('path', DOCUMENTS, ids=lambda path: path.name)
def test_tables_are_current(path: Path) -> None:
    text = path.read_text(encoding='utf-8')
    assert _tables().renewed(text) == text, 'run: python tools/tables.py'


def test_tables_are_those_of_the_package_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = _tables().tables()
    (tmp_path / 'plugged_in_beside.py').write_text('class Push:\n    parameters = ()\n')
    package = tmp_path / 'acme-1.0.dist-info'
    package.mkdir()
    (package / 'METADATA').write_text('Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n')
    (package / 'entry_points.txt').write_text(
        '[masmc_ros.laws]\nacme = plugged_in_beside:Push\n'
        '[masmc_ros.references]\nacme = plugged_in_beside:Push\n'
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    for node, name in ('controller', 'law'), ('trajectory', 'type'):
        assert 'acme' in next(p for p in declared(node) if p.name == name).choices
    assert _tables().tables() == expected


def test_every_table_is_shown_somewhere() -> None:
    shown = ' '.join(path.read_text(encoding='utf-8') for path in DOCUMENTS)
    for name in _tables().tables():
        assert f'<!-- table: {name} -->' in shown


@pytest.mark.parametrize('path', DOCUMENTS, ids=lambda path: path.name)
def test_local_links_lead_somewhere(path: Path) -> None:
    for target in LINK.findall(path.read_text(encoding='utf-8')):
        assert (path.parent / target).exists(), f'{path.name} links to {target}'


EXPERIMENT = {
    'plant': {
        'control_period': 0.001,
        'duration': 20.0,
        'pacing': 'lockstep',
        'integrator_step': 0.0005,
        'torque_limit': (0.0,) * 4,
        'torque_rate_limit': (0.0,) * 4,
    },
    'controller': {
        'control_period': 0.001,
        'pacing': 'lockstep',
        'law': 'rasmc',
        'k_s1': (100.0,) * 4,
        'k_s2': (100.0,) * 4,
        'sigma': (2.0,) * 4,
        'gamma': (1.0,) * 7,
        'switching': 'tanh',
        'boundary_layer': 0.2,
        'model_scale': 0.5,
        'observer_gain': 0.0,
        'leakage': 0.0,
        'e_modification': 0.0,
        'dead_zone': 0.0,
        'projection.lower': 0.0,
        'freeze_when_saturated': False,
        'torque_limit': (0.0,) * 4,
        'torque_rate_limit': (0.0,) * 4,
    },
}
"""Parameters of the paper's experiment, independent of the defaults of the nodes."""


@pytest.mark.parametrize('node', EXPERIMENT)
def test_paper_yaml_states_all_that_makes_the_experiment(node: str) -> None:
    path = str(ROOT / 'config' / 'paper.yaml')
    assert EXPERIMENT[node].keys() <= read(path).for_node(node).keys()
    assert EXPERIMENT[node].items() <= load_scenario(path)[node].items()


def test_the_defaults_are_those_that_survive() -> None:
    defaults = {node: {p.name: p.default for p in declared(node)} for node in NODES}
    for node in ('plant', 'controller'):
        assert defaults[node]['pacing'] == 'realtime'
        assert defaults[node]['torque_limit'] == TORQUE_LIMIT
        assert defaults[node]['torque_rate_limit'] == TORQUE_RATE_LIMIT
    assert defaults['controller']['switching'] == 'implicit'
    assert defaults['controller']['observer_gain'] > 0.0
    assert defaults['controller']['projection.lower'] > 0.0
