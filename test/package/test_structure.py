# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""How the package hangs together: imports run one way, and no folder is a heap."""

from __future__ import annotations

import ast
from pathlib import Path
import re
import tokenize

PACKAGE = Path(__file__).parents[2] / 'masmc_ros'

PARAMETERS_OF_NODES = ('params.node_parameters', 'params.scenario')
"""Modules of `params/` with the declarations of all nodes, which stand in all folders above."""

ORDER = (
    '',  # errors and the like
    'params',
    'numerics',
    'robot',
    'law',
    'reference',
    'loop',
    'physics',
    'messages',
    'control',
    'plant',
    'log',
    *PARAMETERS_OF_NODES,
    'report',
    'compare',
    'nodes',
    'cli',
)
"""Folders and modules, each of which imports only those before it: how data flows."""

NODES = ('middleware', 'parameters', 'process')
"""Folders of `nodes/` that all nodes share; the others are a node each."""

REPORT = ('measure', 'draw', 'page')
"""Folders of `report/`: what was measured knows neither of the others, and they not each other."""

def files() -> list[Path]:
    return sorted(PACKAGE.rglob('*.py'))


def imported(path: Path) -> set[tuple[str, ...]]:
    """Return the modules of the package that a file imports, as parts of their names."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.ImportFrom) and node.module:
            parts = node.module.split('.')
            if parts[0] == 'masmc_ros':
                for name in (each.name for each in node.names):
                    inner = PACKAGE.joinpath(*parts[1:], name)
                    is_module = inner.is_dir() or inner.with_suffix('.py').exists()
                    found.add((*parts[1:], *((name,) if is_module else ())))
        elif isinstance(node, ast.Import):
            assert not any(each.name.startswith('masmc_ros') for each in node.names), path
    return found


def place_of(parts: tuple[str, ...]) -> str:
    """Return the entry of ORDER for a module."""
    if '.'.join(parts[:2]) in PARAMETERS_OF_NODES:
        return '.'.join(parts[:2])
    return parts[0] if parts and (PACKAGE / parts[0]).is_dir() else ''


def test_imports_run_one_way() -> None:
    for path in files():
        own = place_of(path.relative_to(PACKAGE).with_suffix('').parts)
        for parts in imported(path):
            other = place_of(parts)
            assert ORDER.index(other) <= ORDER.index(own), f'{path} imports {".".join(parts)}'


def test_nodes_know_what_they_share_and_not_each_other() -> None:
    for path in files():
        own = path.relative_to(PACKAGE).parts
        if own[0] != 'nodes' or len(own) < 3 or own[1] == 'composed':
            continue
        for parts in imported(path):
            if parts[:1] == ('nodes',) and parts[1] != own[1]:
                assert parts[1] in NODES, f'{path} imports {".".join(parts)}'


def test_what_a_report_measures_and_its_two_forms_are_apart() -> None:
    for name in REPORT:
        for path in (PACKAGE / 'report' / name).glob('*.py'):
            for parts in imported(path):
                if parts[:1] == ('report',) and parts[1] in REPORT:
                    assert parts[1] in ('measure', name), f'{path} imports {".".join(parts)}'


def test_no_module_imports_itself_by_way_of_others() -> None:
    graph = {
        path.relative_to(PACKAGE).with_suffix('').parts: imported(path) for path in files()
    }
    done: set[tuple[str, ...]] = set()

    def visit(module: tuple[str, ...], way: tuple[tuple[str, ...], ...]) -> None:
        assert module not in way, ' -> '.join('.'.join(each) for each in (*way, module))
        if module in graph and module not in done:
            for other in graph[module]:
                visit(other, (*way, module))
            done.add(module)

    for module in graph:
        visit(module, ())


def test_only_nodes_know_ros() -> None:
    for path in files():
        if path.relative_to(PACKAGE).parts[0] in ('nodes', 'cli'):
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            names = (
                [node.module or '']
                if isinstance(node, ast.ImportFrom)
                else [each.name for each in node.names]
                if isinstance(node, ast.Import)
                else []
            )
            assert not any(each.split('.')[0].startswith('rcl') for each in names), path


OF_ONE_ROBOT = re.compile(
    r'wheel|yaw|elbow|(^|_)axle|two_link|(^|_)arm($|_)|(^|_)[xy]_[EF]$', re.IGNORECASE
)
"""What names of one kind of robot are made of."""

OF_THE_TOPIC = re.compile(r'_?(every_)?arm_(velocity|rate)', re.IGNORECASE)
"""What is about the topic `arm_velocity_commands`, whose name is public whatever the robot."""

ARRAYS = ('zeros', 'empty', 'ones', 'full', 'range', 'reshape')

SIZES = (4, 7, 12, 21)
"""Of the paper's robot: axes and joints, positions and parameters, samples, states."""


def outside_robot() -> list[Path]:
    """Return the files that serve any robot; a contact with the ground is one of wheels."""
    own = ('robot', 'physics')
    return [path for path in files() if path.relative_to(PACKAGE).parts[0] not in own]


def test_only_its_own_folder_names_parts_of_a_robot() -> None:
    found = []
    for path in outside_robot():
        with path.open('rb') as stream:
            names = {
                token.string
                for token in tokenize.tokenize(stream.readline)
                if token.type == tokenize.NAME
            }
        found += [
            f'{path}: {name}'
            for name in sorted(names)
            if OF_ONE_ROBOT.search(name) and not OF_THE_TOPIC.match(name)
        ]
    assert not found


def test_only_its_own_folder_spells_the_sizes_of_a_robot() -> None:
    found = []
    for path in outside_robot():
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if not isinstance(node, ast.Call):
                continue
            called = getattr(node.func, 'attr', getattr(node.func, 'id', ''))
            spelt: list[ast.expr] = list(node.args) if called in ARRAYS else []
            spelt += [each.value for each in node.keywords if each.arg == 'length']
            found += [
                f'{path}:{node.lineno}'
                for argument in spelt
                for part in (argument, *getattr(argument, 'elts', ()))
                if isinstance(part, ast.Constant) and part.value in SIZES
            ]
    assert not found


ON_THE_STACK = ('scratch', 'array_of')
"""Functions whose arrays end with the function that asks for them."""


def _leaves(node: ast.expr) -> list[str]:
    """Return the names that an expression hands out as they are, in tuples or by records."""
    if isinstance(node, ast.Name):
        return [node.id]
    if isinstance(node, ast.Tuple):
        return [name for each in node.elts for name in _leaves(each)]
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        if node.func.id in ON_THE_STACK:
            return [node.func.id]
        if node.func.id[:1].isupper():
            return [name for each in node.args for name in _leaves(each)]
    return []


def _asked_for(function: ast.FunctionDef) -> set[str]:
    """Return the names of a function's arrays on the stack."""
    found = set(ON_THE_STACK)
    for node in ast.walk(function):
        if isinstance(node, ast.Assign):
            target, value = node.targets[0], node.value
            pairs = (
                zip(target.elts, value.elts, strict=False)
                if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple)
                else [(target, value)]
            )
            for name, given in pairs:
                is_call = isinstance(given, ast.Call) and isinstance(given.func, ast.Name)
                if is_call and given.func.id in ON_THE_STACK and isinstance(name, ast.Name):
                    found.add(name.id)
    return found


def _escaping(source: str) -> list[str]:
    """Return where functions return arrays that end with them."""
    return [
        f'{function.name}:{node.lineno}'
        for function in ast.walk(ast.parse(source))
        if isinstance(function, ast.FunctionDef)
        for node in ast.walk(function)
        if isinstance(node, ast.Return) and node.value is not None
        if _asked_for(function) & set(_leaves(node.value))
    ]


def test_no_function_returns_an_array_that_ends_with_it() -> None:
    assert _escaping('def f(n):\n    a, b = scratch(n), 1\n    return b, Pair(a, b)') == ['f:3']
    assert _escaping('def f(n):\n    a = array_of(n)\n    return taken(a, n)') == []
    found = {path: _escaping(path.read_text(encoding='utf-8')) for path in files()}
    assert {path: names for path, names in found.items() if names} == {}


def test_no_number_of_a_run_is_added_up_by_sum() -> None:
    """Python 3.12 adds floats with compensation, 3.11 does not: their bits would differ."""
    package = Path(__file__).parents[2] / 'masmc_ros'
    found = [
        f'{path.relative_to(package)}:{node.lineno}'
        for folder in ('numerics', 'robot', 'law', 'reference', 'loop')
        for path in sorted((package / folder).rglob('*.py'))
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8')))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == 'sum'
    ]
    assert found == []
