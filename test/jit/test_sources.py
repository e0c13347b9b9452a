# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Source files on which compiled code depends: an edit invalidates what uses the file."""

from __future__ import annotations

import ast
import json
import os
from pathlib import Path
import shutil
import subprocess
import sys
import sysconfig
from types import ModuleType

from helpers.child_environment import child_environment
from helpers.small_tree import parameters
from masmc_ros.jit import sources
from masmc_ros.jit.compiled import is_interpreted
from masmc_ros.jit.sized_records import type_of
from masmc_ros.law.registry import LAWS
from masmc_ros.loop.law_code import code_of_law
from masmc_ros.numerics.scalars import minus
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.tree.tree_mechanism import tree_mechanism
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
import pytest

PACKAGE = Path(sources.__file__).parents[1]


def used(mechanism: Mechanism, law: str, switching: str = 'implicit') -> set[str]:
    """Return the files that a control tick depends on, relative to the package."""
    code = code_of_law(mechanism, LAWS[law], switching)
    files: set[str] = set()
    for kernel, arguments in code.calls:
        kinds = tuple(map(type_of, arguments))
        files |= {kernel.__code__.co_filename, *sources.files_of_types(kinds)}
    closure = sources.closure(files)
    return {Path(file).relative_to(PACKAGE).as_posix() for file in closure}


def test_imported_equals_syntax_tree() -> None:
    for path in sources._modules.values():
        names = set()
        for node in ast.walk(ast.parse(Path(path).read_text(encoding='utf-8'))):
            if isinstance(node, ast.ImportFrom) and node.module:
                names |= {node.module, *(f'{node.module}.{alias.name}' for alias in node.names)}
        expected = {file for name, file in sources._modules.items() if name in names}
        assert set(sources._imported(path)) & set(sources._modules.values()) == expected, path


def test_params_give_compiled_code_no_constants() -> None:
    """Their files are not among the sources, so classes and functions alone are imported."""
    for path in map(Path, sources._modules.values()):
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            module = node.module or '' if isinstance(node, ast.ImportFrom) else ''
            if isinstance(node, ast.ImportFrom) and module.startswith('masmc_ros.params'):
                assert not [alias.name for alias in node.names if alias.name.isupper()], path


@pytest.mark.skipif(is_interpreted(), reason='nothing is compiled')
def test_sources_of_tick_are_those_of_law_term_and_robot() -> None:
    tree = tree_mechanism(parameters())
    laws = {law: used(TWO_LINK, law) for law in ('pid', 'rasmc')}
    assert 'law/feedback/pid.py' in laws['pid'] - laws['rasmc']
    assert {'law/rasmc.py', 'law/reaching/implicit.py'} <= laws['rasmc'] - laws['pid']
    assert 'law/reaching/tanh.py' in used(TWO_LINK, 'rasmc', 'tanh') - laws['rasmc']
    assert 'robot/two_link/two_link.py' in laws['pid'] - used(tree, 'pid')
    assert 'robot/tree/articulated.py' in used(tree, 'pid') - laws['pid']
    common = {'jit/tuples.py', 'jit/compiled.py', 'loop/control.py', 'law/law.py'}
    assert all(common <= files for files in laws.values())
    assert 'law/registry.py' not in laws['pid'] | laws['rasmc']


DIGESTS = """
import json
from masmc_ros.law.registry import LAWS
from masmc_ros.loop.law_code import code_of_law
from masmc_ros.jit.compiled import code_file
from masmc_ros.robot.two_link.paper_robot import TWO_LINK

print(json.dumps({
    name: [str(code_file(kernel, *arguments)) for kernel, arguments in calls]
    for name, calls in {
        law: code_of_law(TWO_LINK, LAWS[law], 'implicit').calls
        for law in ('pid', 'smc', 'rasmc', 'terminal')
    }.items()
}))
"""

EDITS = {
    'law/feedback/pid.py': {'pid'},
    'law/rasmc.py': {'rasmc'},
    'law/smc.py': {'smc', 'rasmc'},  # rasmc adds adaptation to its torque
    'law/reaching/implicit.py': {'smc', 'rasmc'},
    'numerics/portable_math.py': {'pid', 'smc', 'rasmc', 'terminal'},
    'robot/tree/articulated.py': set(),
    'reference/waypoints.py': set(),
    'params/declaration.py': set(),
}
"""Edited files, and the laws whose code they invalidate."""


@pytest.mark.slow
def test_edit_invalidates_files_of_code_that_uses_it(tmp_path: Path) -> None:
    shutil.copytree(PACKAGE, tmp_path / PACKAGE.name, ignore=shutil.ignore_patterns('__pycache__'))
    environment = {**child_environment(), 'PYTHONPATH': str(tmp_path), 'NUMBA_DISABLE_JIT': '0'}

    def files() -> dict[str, list[str]]:
        done = subprocess.run(
            [sys.executable, '-c', DIGESTS],
            env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=120,
        )
        assert done.returncode == 0, done.stderr
        names: dict[str, list[str]] = json.loads(done.stdout)
        return names

    before = files()
    for name, laws in EDITS.items():
        path = tmp_path / PACKAGE.name / name
        text = path.read_text(encoding='utf-8')
        path.write_text(text + '\n# edited\n', encoding='utf-8')
        after = files()
        assert {law for law in before if set(before[law]) & set(after[law])} == set(before) - laws
        path.write_text(text, encoding='utf-8')
    # Files of the first sources are valid again.
    assert files() == before


PLUG_IN = {
    'mine/__init__.py': '',
    'mine/values.py': 'FACTOR = 2.0\n',
    'mine/parts.py': (
        'from masmc_ros.jit.compiled import formula\nfrom . import values\n'
        'FACTOR = values.FACTOR\n@formula\ndef scaled(x):\n    return FACTOR * x\n'
    ),
    'mine/other.py': 'UNUSED = 1.0\n',
    'mine/kernels.py': (
        'import mine.other\nfrom masmc_ros.jit.compiled import kernel\n'
        'from mine.parts import (\n    scaled,\n)\n'
        '@kernel\ndef total(values):\n    return scaled(values[0])\n'
    ),
    'mine/unrelated.py': 'LENGTH = 1.0\n',
}

CALL = """
import mine.unrelated
from mine.kernels import total
import numpy as np
print(total(np.array([3.0])), sum(total.stats.cache_hits.values()))
"""


@pytest.mark.slow
def test_edit_of_constant_in_other_package_changes_result(tmp_path: Path) -> None:
    for name, text in PLUG_IN.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    path = os.pathsep.join([str(tmp_path), child_environment()['PYTHONPATH']])
    environment = {
        **os.environ, 'PYTHONPATH': path, 'XDG_CACHE_HOME': str(tmp_path / 'cache'),
        'NUMBA_DISABLE_JIT': '0',
    }

    def run() -> str:
        done = subprocess.run(
            [sys.executable, '-c', CALL],
            env=environment, capture_output=True, text=True, timeout=120,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    assert [run(), run()] == ['6.0 0', '6.0 1']
    (tmp_path / 'mine' / 'values.py').write_text('FACTOR = 20.0\n')
    assert [run(), run()] == ['60.0 0', '60.0 1']
    (tmp_path / 'mine' / 'unrelated.py').write_text('LENGTH = 2.0\n')
    assert run() == '60.0 1'
    (tmp_path / 'mine' / 'values.py').write_text('FACTOR = 2.0\n')
    assert run() == '6.0 1'


@pytest.mark.skipif(is_interpreted(), reason='nothing is compiled')
def test_edit_after_import_keeps_text_of_running_process(tmp_path: Path) -> None:
    """A process must not save the code of what it has imported under the text of a later edit."""
    path = tmp_path / 'edited.py'
    text = 'from masmc_ros.jit.compiled import formula\n@formula\ndef f(x):\n    return x\n'
    path.write_text(text, encoding='utf-8')
    exec(compile(text, str(path), 'exec'), {})
    path.write_text(text.replace('return x', 'return 2.0 * x'), encoding='utf-8')
    sources.closure([str(path)])
    assert sources._contents[str(path)] == text


COMPILED = """
import json, sys
from helpers.small_tree import parameters
from masmc_ros.law.registry import LAWS
from masmc_ros.loop.law_code import code_of_law
from masmc_ros.jit import sources
from masmc_ros.jit.sized_records import type_of
from masmc_ros.robot.tree.tree_mechanism import tree_mechanism
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
from numba.core import event

class Files(event.Listener):
    def __init__(self):
        self.files = set()
    def on_start(self, event):
        self.files.add(event.data['dispatcher'].py_func.__code__.co_filename)
    def on_end(self, event):
        pass

mechanism = TWO_LINK if sys.argv[1] == 'two_link' else tree_mechanism(parameters())
listener = Files()
with event.install_listener('numba:compile', listener):
    (kernel, arguments), *_ = code_of_law(mechanism, LAWS[sys.argv[2]], 'implicit').calls
    kinds = tuple(map(type_of, arguments))
    kernel.compile(kinds)
files = {kernel.__code__.co_filename, *sources.files_of_types(kinds)}
print(json.dumps([sorted(listener.files), sorted(sources.closure(files))]))
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ('mechanism', 'law'), [('two_link', 'rasmc'), ('two_link', 'fuzzy_model'), ('tree', 'rasmc')]
)
def test_sources_contain_all_compiled_functions(
    mechanism: str, law: str, tmp_path: Path
) -> None:
    environment = {
        **child_environment(), 'XDG_CACHE_HOME': str(tmp_path), 'NUMBA_DISABLE_JIT': '0'
    }
    done = subprocess.run(
        [sys.executable, '-c', COMPILED, mechanism, law],
        env=environment, capture_output=True, text=True, timeout=600,
    )
    assert done.returncode == 0, done.stderr
    compiled, closure = map(set, json.loads(done.stdout))
    compiled = {file for file in compiled if '/numba/' not in file}
    assert len(compiled) > 10
    assert compiled <= closure


@pytest.mark.skipif(is_interpreted(), reason='nothing is compiled')
def test_library_with_formulas_is_a_source(monkeypatch: pytest.MonkeyPatch) -> None:
    """Formulas that a user's law imports from another installed package are in its code."""
    library = Path(sysconfig.get_path('purelib'))
    modules = {name: ModuleType(name) for name in ('with_formula', 'without')}
    for name, module in modules.items():
        module.__file__ = str(library / name / '__init__.py')
        monkeypatch.setitem(sys.modules, name, module)
    vars(modules['with_formula'])['force'] = minus
    law = str(library / 'law.py')
    assert sources._file_of('with_formula', law) == modules['with_formula'].__file__
    assert sources._file_of('without', law) == ''
