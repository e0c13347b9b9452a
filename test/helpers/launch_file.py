# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Processes that the files of launch/ start, determined without the package `launch`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
import runpy
import sys
from types import ModuleType
from typing import Any, NamedTuple
from unittest.mock import patch

ROOT = Path(__file__).resolve().parents[2]
PAPER = 'paper.launch.py'


class Started(NamedTuple):
    """Arguments of `masmc run` for one process."""

    executable: str
    arguments: list[str]


class _Argument(NamedTuple):
    name: str
    default_value: str
    description: str
    choices: tuple[str, ...] = ()


class _Configuration(NamedTuple):
    name: str

    def perform(self, context: Mapping[str, str]) -> str:
        return context[self.name]


class _Function(NamedTuple):
    function: Callable[[Mapping[str, str]], list[Any]]


class _Node(dict[str, Any]):
    """Arguments of a launch_ros Node."""


def _anything(*_: object, **__: object) -> None:
    return None


_MODULES: dict[str, dict[str, Any]] = {
    'ament_index_python': {},
    'ament_index_python.packages': {'get_package_share_directory': lambda _: str(ROOT)},
    'launch': {'LaunchContext': dict, 'LaunchDescription': list},
    'launch.actions': {
        'DeclareLaunchArgument': _Argument,
        'EmitEvent': _anything,
        'OpaqueFunction': _Function,
        'RegisterEventHandler': _anything,
    },
    'launch.event_handlers': {'OnProcessExit': _anything},
    'launch.events': {'Shutdown': _anything},
    'launch.substitutions': {'LaunchConfiguration': _Configuration},
    'launch_ros': {},
    'launch_ros.actions': {'Node': _Node},
}


@contextmanager
def stand_ins() -> Iterator[None]:
    """Provide the modules that launch files import."""
    modules = {name: ModuleType(name) for name in _MODULES}
    for name, module in modules.items():
        vars(module).update(_MODULES[name])
    with patch.dict(sys.modules, modules):
        yield
        # Other imports remain: an extension module such as NumPy's cannot be imported twice.
        imported = {name: m for name, m in sys.modules.items() if name not in modules}
    sys.modules.update(imported)


def launched(file: str = PAPER, **arguments: str) -> list[Started]:
    """Return the processes of a launch file for launch arguments NAME=text."""
    with stand_ins():
        description = runpy.run_path(str(ROOT / 'launch' / file))['generate_launch_description']()
        declared = [action for action in description if isinstance(action, _Argument)]
        unknown = arguments.keys() - {argument.name for argument in declared}
        assert not unknown, unknown
        context = {argument.name: argument.default_value for argument in declared} | arguments
        for argument in declared:
            assert not argument.choices or context[argument.name] in argument.choices
        (function,) = (a.function for a in description if isinstance(a, _Function))
        nodes = [action for action in function(context) if isinstance(action, _Node)]
    return [_started(node) for node in nodes]


def _started(node: _Node) -> Started:
    command = [*node.get('arguments', ()), '--ros-args']
    if name := node.get('name'):
        command += ['-r', f'__node:={name}']
    if namespace := node.get('namespace'):
        command += ['-r', f'__ns:=/{namespace.strip("/")}']
    # launch_ros would write such values into a file, some texts without their quotes.
    assert 'parameters' not in node
    for source, target in node['remappings']:
        command += ['-r', f'{source}:={target}']
    return Started(node['executable'], command)
