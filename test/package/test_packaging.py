# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Packaging: declared dependencies match imports, and a missing package is one error line."""

from __future__ import annotations

import ast
from itertools import pairwise
from pathlib import Path
import re
import shutil
import subprocess
import sys
from xml.etree import ElementTree

from helpers.child_environment import child_environment
from masmc_ros.errors import PACKAGES
from masmc_ros.jit.supported_numba import FIRST_UNSUPPORTED, OLDEST
import pytest

ROOT = Path(__file__).resolve().parents[2]
MANIFEST = ElementTree.parse(ROOT / 'package.xml').getroot()
SETUP = (ROOT / 'setup.py').read_text(encoding='utf-8')
CONSTRAINTS = (ROOT / 'constraints.txt').read_text(encoding='utf-8')

ROSDEP = {
    'argcomplete': 'python3-argcomplete',
    'jinja2': 'python3-jinja2',
    'llvmlite': 'python3-numba',
    'markupsafe': 'python3-jinja2',
    'matplotlib': 'python3-matplotlib',
    'numba': 'python3-numba',
    'numpy': 'python3-numpy',
    'tqdm': 'python3-tqdm',
    'yaml': 'python3-yaml',
    'mcap_ros2': 'mcap-ros2-support',
    'rosbags': 'python3-rosbags-pip',
}
"""Modules and their rosdep keys (those of jinja2 and numba include markupsafe and llvmlite)."""

PIP = {**PACKAGES, 'yaml': 'PyYAML'}


def imported(*folders: str) -> set[str]:
    """Return all modules imported in folders, except the standard library."""
    modules = set()
    for folder in folders:
        for path in (ROOT / folder).rglob('*.py'):
            for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
                names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
                if isinstance(node, ast.ImportFrom) and node.level == 0:
                    names = [str(node.module)]
                modules |= {name.partition('.')[0] for name in names}
    return modules - set(sys.stdlib_module_names) - {'masmc_ros'}


def declared(*kinds: str) -> set[str]:
    return {str(element.text) for kind in kinds for element in MANIFEST.findall(kind)}


def test_package_xml_declares_all_imports() -> None:
    modules = imported('masmc_ros', 'launch') - (set(PACKAGES) - set(ROSDEP))
    assert {ROSDEP.get(name, name) for name in modules} <= declared('exec_depend', 'depend')


def test_setup_py_declares_all_pip_installed_imports() -> None:
    ros = declared('exec_depend') - set(ROSDEP.values())
    for module in imported('masmc_ros') - ros - {'rclpy'}:
        assert re.search(rf"'{PIP.get(module, module)}[>='=]", SETUP), module


def pip_requirements() -> set[str]:
    """Return the names of all packages in the lists of setup.py that pip may install."""
    lists = [
        node.value
        for node in ast.walk(ast.parse(SETUP))
        if isinstance(node, ast.keyword) and node.arg in ('install_requires', 'extras_require')
    ]
    names = set()
    for entries in (n for extras in lists for n in ast.walk(extras) if isinstance(n, ast.List)):
        for entry in entries.elts:
            text = entry.values[0] if isinstance(entry, ast.JoinedStr) else entry
            requirement = str(ast.literal_eval(text))
            names |= set(re.findall(r'^[\w-]+', requirement.lower()))
    return names


STABLE = {'distributed', 'pandas', 'pyarrow', 'scipy', 'xarray'}
"""Packages of the commands' extras; any recent version of them fits."""


def test_extras_bind_tested_versions_at_both_ends() -> None:
    extras = next(
        node.value for node in ast.walk(ast.parse(SETUP))
        if isinstance(node, ast.keyword) and node.arg == 'extras_require'
    )
    tested = dict(re.findall(r'^([\w-]+)==(\S+)$', CONSTRAINTS, re.MULTILINE))
    names = []
    for entry in ast.walk(extras):
        text = entry.value if isinstance(entry, ast.Constant) else ''
        if bounded := re.fullmatch(r'([\w-]+)>=([\d.]+),<([\d.]+)', str(text)):
            names.append(bounded[1])
            low, version, high = (
                [int(part) for part in number.split('.')]
                for number in (bounded[2], tested[bounded[1]], bounded[3])
            )
            assert low <= version < high, text
    assert {'mujoco-core', 'clarabel', 'pin'} <= set(names)
    lists = [node for node in ast.walk(extras) if isinstance(node, ast.List)]
    texts = [str(n.value) for entry in lists for n in entry.elts if isinstance(n, ast.Constant)]
    free = {text.lower() for text in texts if re.fullmatch(r'[\w-]+', text)}
    assert free & {name.lower() for name in PACKAGES.values()} <= STABLE


def test_architecture_names_every_dependency() -> None:
    page = (ROOT / 'docs' / 'development' / 'architecture.md').read_text(encoding='utf-8')
    section = page.partition('## Dependencies')[2].partition('\n## ')[0]
    cells = [line.split('|')[1:-2] for line in section.splitlines() if line.startswith('|')]
    named = {name for row in cells for cell in row for name in re.findall(r'[\w-]+', cell.lower())}
    rosdep = {
        key.removeprefix('python3-').removesuffix('-pip')
        for key in declared('exec_depend', 'test_depend')
    }
    rosdep = {'pyyaml' if key == 'yaml' else key for key in rosdep}
    requirements = pip_requirements()
    assert {'numba', 'scipy', 'ros-jazzy-rclpy', 'sphinx'} <= requirements
    assert requirements | rosdep <= named


def metadata(root: Path) -> dict[str, str]:
    """Return version, maintainer, e-mail and URL from the setup.py in a folder."""
    names = ('version', 'maintainer', 'maintainer-email', 'url')
    result = subprocess.run(
        [sys.executable, 'setup.py', '--quiet', *(f'--{name}' for name in names)],
        cwd=root, capture_output=True, text=True, timeout=180.0, check=True,
    )  # fmt: skip
    return dict(zip(names, result.stdout.splitlines()[-len(names):], strict=True))


def test_contact_of_setup_py_is_that_of_package_xml(tmp_path: Path) -> None:
    maintainer = MANIFEST.find('maintainer')
    assert maintainer is not None
    version, email = str(MANIFEST.findtext('version')), str(maintainer.get('email'))
    url = MANIFEST.findtext("url[@type='repository']")
    expected = {
        'version': version,
        'maintainer': str(maintainer.text),
        'maintainer-email': 'None' if email.endswith('.invalid') else email,
        'url': str(url),
    }
    assert metadata(ROOT) == expected
    for name in ('setup.py', 'package.xml', 'README.md'):
        shutil.copy(ROOT / name, tmp_path)
    shutil.copytree(ROOT / 'masmc_ros' / 'jit', tmp_path / 'masmc_ros' / 'jit')
    text = (tmp_path / 'package.xml').read_text(encoding='utf-8')
    released = '<url type="repository">https://host.example/masmc_ros</url>\n  <author>'
    text = text.replace(email, 'team@host.example').replace('<author>', released)
    (tmp_path / 'package.xml').write_text(text, encoding='utf-8')
    contact = {'maintainer-email': 'team@host.example', 'url': 'https://host.example/masmc_ros'}
    assert metadata(tmp_path) == {**expected, **contact}


def test_contact_stands_in_package_xml_alone() -> None:
    """No file names another address or repository of this package, real or not."""
    maintainer = MANIFEST.find('maintainer')
    assert maintainer is not None
    kinds = ('*.md', '*.rst', '*.cff', '*.toml', '*.cfg', '*.xml', '*.yaml', '*.ipynb', '*.py')
    folders = ('docs', 'masmc_ros', '.github', 'launch', 'config')
    files = [path for kind in kinds for path in ROOT.glob(kind)]
    files += [path for folder in folders for kind in kinds for path in (ROOT / folder).rglob(kind)]
    addresses, repositories = set(), set()
    for path in files:
        text = path.read_text(encoding='utf-8')
        addresses |= set(re.findall(r'[\w.+-]+@[\w-]+\.[a-z][\w.-]*', text))
        repositories |= set(re.findall(r'https?://[^\s<>"\')]*masmc[\w./-]*', text))
    assert addresses <= {maintainer.get('email')}
    urls = {element.text for element in MANIFEST.findall('url')}
    assert repositories <= urls, repositories - urls
    assert len(files) > 500


def test_constraints_have_both_ends_of_supported_numba() -> None:
    """`make test-oldest` and `make test` run with the oldest and the newest version."""
    oldest = (ROOT / 'constraints-oldest.txt').read_text(encoding='utf-8')
    assert re.search(rf'^numba=={re.escape(OLDEST)}\.\d+$', oldest, re.MULTILINE)
    newest = re.search(r'^numba==0\.(\d+)\.\d+$', CONSTRAINTS, re.MULTILINE)
    assert newest is not None
    assert f'0.{int(newest[1]) + 1}' == FIRST_UNSUPPORTED


def test_changelog_has_the_form_of_rep_132() -> None:
    lines = (ROOT / 'CHANGELOG.rst').read_text(encoding='utf-8').splitlines()
    assert lines[1] == 'Changelog for package masmc_ros'
    assert lines[0] == lines[2] == '^' * len(lines[1])
    sections = [(name, bar) for name, bar in pairwise(lines) if set(bar) == {'-'}]
    assert sections
    for name, bar in sections:
        assert len(bar) == len(name)
        assert name == 'Forthcoming' or re.fullmatch(r'\d+\.\d+\.\d+ \(\d{4}-\d\d-\d\d\)', name)


def without(modules: list[str], *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run `masmc` as if modules were not installed."""
    return masmc_after(f'for name in {modules!r}: sys.modules[name] = None', *arguments)


def masmc_after(preparation: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run `masmc` in a process that executes other statements first."""
    script = (
        f'import sys\n{preparation}\n'
        'from masmc_ros.cli.main import main\nsys.exit(main(sys.argv[1:]))'
    )
    return subprocess.run(
        [sys.executable, '-c', script, *arguments],
        env=child_environment(),
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=180.0,
        check=False,
    )


def test_simulate_with_rosdep_packages_only() -> None:
    result = without(sorted(PACKAGES), 'simulate', 'config/paper.yaml', '--set', 'duration=0.1')
    assert (result.returncode, result.stderr) == (0, '')


@pytest.mark.parametrize('node', ['plant', 'trajectory', 'controller'])
def test_control_nodes_with_rosdep_packages_only(node: str) -> None:
    pytest.importorskip('rclpy')
    # The node starts and rejects the unknown parameter.
    result = without(sorted(PACKAGES), 'run', node, '--ros-args', '-p', 'nothing_like_it:=1')
    assert result.returncode == 2
    assert 'nothing_like_it' in result.stderr


@pytest.mark.parametrize(
    ('module', 'arguments'),
    [
        ('mcap', ['report', 'run.mcap']),
        ('mcap', ['run', 'recorder']),
        ('plotly', ['report', 'run.mcap']),
        ('zstandard', ['recover', 'run.mcap']),
        ('ruckig', ['simulate', 'paper', '--set', 'trajectory.type=set_point']),
    ],
)
def test_masmc_missing_package_one_error_line(module: str, arguments: list[str]) -> None:
    if arguments[0] == 'run':
        pytest.importorskip('rclpy')
    result = without([module], *arguments)
    assert result.returncode == 2
    (line,) = result.stderr.splitlines()
    assert f'{module} is not installed; pip install {PACKAGES[module]}' in line


def test_simulate_old_numba_one_error_line() -> None:
    preparation = 'import numba\nnumba.__version__ = "0.57.1"'
    result = masmc_after(preparation, 'simulate', 'config/paper.yaml')
    assert result.returncode == 2
    (line,) = result.stderr.splitlines()
    assert line == (
        f'masmc simulate: numba 0.57.1 is too old: expected {OLDEST} or later;'
        ' pip install --upgrade numba'
    )


@pytest.mark.slow
def test_collection_missing_package_file_skipped() -> None:
    script = (
        'import sys\nsys.modules["mcap"] = sys.modules["websockets"] = None\n'
        'import pytest\nsys.exit(pytest.main(sys.argv[1:]))'
    )
    files = [
        f'test/{name}.py'
        for name in ('log/test_log_writer', 'nodes/test_velocity_nodes', 'robot/test_dynamics')
    ]
    result = subprocess.run(
        [sys.executable, '-c', script, '-q', '--collect-only', *files],
        env=child_environment(),
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=180.0,
        check=False,
    )
    assert result.returncode == 0, result.stdout
    assert 'test_log_writer.py:1: mcap is not installed; pip install mcap' in result.stdout
    assert 'test/robot/test_dynamics.py::' in result.stdout
