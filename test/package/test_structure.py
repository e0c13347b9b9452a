# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Structure of the package: directions of imports, and forbidden constructs."""

from __future__ import annotations

import ast
from pathlib import Path
import re
import tokenize

from masmc_ros.law.registry import LAWS

PACKAGE = Path(__file__).parents[2] / 'masmc_ros'

PAGE = PACKAGE.parent / 'docs' / 'development' / 'architecture.md'
ORDER = (
    '',  # modules such as errors
    *re.findall(r'^\| `masmc_ros/(\w+)/` \|', PAGE.read_text(encoding='utf-8'), re.MULTILINE),
)
"""Folders in the order of data flow; a folder imports only itself and earlier ones."""

NODES = ('middleware', 'parameters', 'process')
"""Folders of `nodes/` that all nodes share; each other folder is one node."""

REPORT = ('measure', 'draw', 'page')
"""Folders of `report/`: `measure` imports neither `draw` nor `page`, which are independent."""


def files() -> list[Path]:
    return sorted(PACKAGE.rglob('*.py'))


def imported(path: Path) -> set[tuple[str, ...]]:
    """Return the modules of the package that a file imports, as parts of their names."""
    modules = set()
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.ImportFrom) and node.module:
            parts = node.module.split('.')
            if parts[0] == 'masmc_ros':
                for name in (alias.name for alias in node.names):
                    inner = PACKAGE.joinpath(*parts[1:], name)
                    is_module = inner.is_dir() or inner.with_suffix('.py').exists()
                    modules.add((*parts[1:], *((name,) if is_module else ())))
        elif isinstance(node, ast.Import):
            assert not any(alias.name.startswith('masmc_ros') for alias in node.names), path
    return modules


def place_of(parts: tuple[str, ...]) -> str:
    """Return the entry of ORDER for a module."""
    return parts[0] if parts and (PACKAGE / parts[0]).is_dir() else ''


def test_page_of_architecture_has_every_folder() -> None:
    assert sorted(ORDER[1:]) == sorted(path.parent.name for path in PACKAGE.glob('*/__init__.py'))


def test_imports_follow_order_of_folders() -> None:
    for path in files():
        own = place_of(path.relative_to(PACKAGE).with_suffix('').parts)
        for parts in imported(path):
            other = place_of(parts)
            assert ORDER.index(other) <= ORDER.index(own), f'{path} imports {".".join(parts)}'


def test_nodes_import_only_shared_folders() -> None:
    for path in files():
        own = path.relative_to(PACKAGE).parts
        if own[0] != 'nodes' or len(own) < 3 or own[1] == 'composed':
            continue
        for parts in imported(path):
            if parts[:1] == ('nodes',) and parts[1] != own[1]:
                assert parts[1] in NODES, f'{path} imports {".".join(parts)}'


def test_report_folders_import_only_measure() -> None:
    for name in REPORT:
        for path in (PACKAGE / 'report' / name).glob('*.py'):
            for parts in imported(path):
                if parts[:1] == ('report',) and parts[1] in REPORT:
                    assert parts[1] in ('measure', name), f'{path} imports {".".join(parts)}'


def test_imports_without_cycles() -> None:
    graph = {
        path.relative_to(PACKAGE).with_suffix('').parts: imported(path) for path in files()
    }
    done: set[tuple[str, ...]] = set()

    def visit(module: tuple[str, ...], chain: tuple[tuple[str, ...], ...]) -> None:
        assert module not in chain, ' -> '.join('.'.join(name) for name in (*chain, module))
        if module in graph and module not in done:
            for other in graph[module]:
                visit(other, (*chain, module))
            done.add(module)

    for module in graph:
        visit(module, ())


def test_imports_of_rclpy_only_in_nodes_and_cli() -> None:
    for path in files():
        if path.relative_to(PACKAGE).parts[0] in ('nodes', 'cli'):
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            names = (
                [node.module or '']
                if isinstance(node, ast.ImportFrom)
                else [alias.name for alias in node.names]
                if isinstance(node, ast.Import)
                else []
            )
            assert not any(name.split('.')[0].startswith('rcl') for name in names), path


def test_page_of_tick_has_parts_of_laws() -> None:
    table = (PAGE.parent / 'tick.md').read_text(encoding='utf-8').partition('\n| law or term |')[2]
    rows = re.findall(r'^\| `(\w+)` \|(.*)\|$', table, re.MULTILINE)
    named = {law: set(re.findall(r'\w+', parts)) for law, parts in rows}
    names = {*LAWS, 'rates', 'implicit'}
    laws = {path.stem: path for path in (PACKAGE / 'law').rglob('*.py') if path.stem in names}
    known = {path.stem for path in (PACKAGE / 'law' / 'parts').glob('*.py')} | laws.keys()
    assert named == {
        law: {name[-1] for name in imported(path) if name[:1] == ('law',)} & known
        for law, path in laws.items()
    }


OF_ONE_ROBOT = re.compile(
    r'wheel|yaw|elbow|(^|_)axle|two_link|(^|_)arm($|_)|(^|_)[xy]_[EF]$', re.IGNORECASE
)
"""Parts of names that belong to one kind of robot."""

OF_THE_TOPIC = re.compile(r'_?(every_)?arm_(velocity|rate)', re.IGNORECASE)
"""Names about the topic `arm_velocity_commands`, which is the same for all robots."""


def outside_robot() -> list[Path]:
    """Return the files for any robot; `physics` is about wheels in contact with the ground."""
    own = ('robot', 'physics')
    return [path for path in files() if path.relative_to(PACKAGE).parts[0] not in own]


def test_names_of_robot_parts_only_in_robot_and_physics() -> None:
    violations = []
    for path in outside_robot():
        with path.open('rb') as stream:
            names = {
                token.string
                for token in tokenize.tokenize(stream.readline)
                if token.type == tokenize.NAME
            }
        violations += [
            f'{path}: {name}'
            for name in sorted(names)
            if OF_ONE_ROBOT.search(name) and not OF_THE_TOPIC.match(name)
        ]
    assert not violations


ON_THE_STACK = ('scratch', 'array_of')
"""Functions whose arrays are valid only until the calling function returns."""


def _leaves(node: ast.expr) -> list[str]:
    """Return the names that an expression returns, directly or in tuples and records."""
    if isinstance(node, ast.Name):
        return [node.id]
    if isinstance(node, ast.Tuple):
        return [name for element in node.elts for name in _leaves(element)]
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        if node.func.id in ON_THE_STACK:
            return [node.func.id]
        if node.func.id[:1].isupper():
            return [name for argument in node.args for name in _leaves(argument)]
    return []


def _stack_arrays(function: ast.FunctionDef) -> set[str]:
    """Return the names of a function's arrays on the stack."""
    names = set(ON_THE_STACK)
    for node in ast.walk(function):
        if isinstance(node, ast.Assign):
            target, value = node.targets[0], node.value
            pairs = (
                zip(target.elts, value.elts, strict=False)
                if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple)
                else [(target, value)]
            )
            for name, assigned in pairs:
                is_call = isinstance(assigned, ast.Call) and isinstance(assigned.func, ast.Name)
                if is_call and assigned.func.id in ON_THE_STACK and isinstance(name, ast.Name):
                    names.add(name.id)
    return names


def _escaping(source: str) -> list[str]:
    """Return functions and lines that return an array on the stack."""
    return [
        f'{function.name}:{node.lineno}'
        for function in ast.walk(ast.parse(source))
        if isinstance(function, ast.FunctionDef)
        for node in ast.walk(function)
        if isinstance(node, ast.Return) and node.value is not None
        if _stack_arrays(function) & set(_leaves(node.value))
    ]


def test_functions_return_no_array_on_the_stack() -> None:
    assert _escaping('def f(n):\n    a, b = scratch(n), 1\n    return b, Pair(a, b)') == ['f:3']
    assert _escaping('def f(n):\n    a = array_of(n)\n    return to_vector(a, n)') == []
    escaping = {path: _escaping(path.read_text(encoding='utf-8')) for path in files()}
    assert {path: names for path, names in escaping.items() if names} == {}


def test_computations_of_a_run_do_not_use_sum() -> None:
    """From Python 3.12 `sum` compensates rounding errors; results would depend on the version."""
    package = Path(__file__).parents[2] / 'masmc_ros'
    calls = [
        f'{path.relative_to(package)}:{node.lineno}'
        for folder in ('jit', 'numerics', 'robot', 'law', 'reference', 'loop')
        for path in sorted((package / folder).rglob('*.py'))
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8')))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == 'sum'
    ]
    assert calls == []
