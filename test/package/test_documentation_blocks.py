# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Blocks and file names of README.md, CONTRIBUTING.md and docs/, without running a command.

`test_documentation_examples.py` runs them. Here is what cannot be run on every machine as well:
names of nodes, parameters, topics, services, launch arguments, packages, make targets and files.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
import re
import shlex
import shutil
import subprocess
from typing import Any

from helpers import small_tree
from helpers.launch_file import launched
from helpers.pages import all_commands, blocks, page_name, PAGES, ROOT
from helpers.typed_messages import typed_message
from masmc_ros.cli.commands.run import NODES
from masmc_ros.cli.main import parser_for
from masmc_ros.control.supervisor import TRANSITIONS
from masmc_ros.errors import InputError
from masmc_ros.messages.topics import JOINTS, TOPICS
from masmc_ros.nodes.trajectory.follow_action import ACTION
from masmc_ros.nodes.trajectory.path_messages import PathMessages
from masmc_ros.robot.mechanisms import DEFAULT, mechanism_from
from masmc_ros.scenario.node_parameters import declared
from masmc_ros.scenario.scenario import load_scenario
import pytest
from rclpy.serialization import serialize_message
import yaml

each_page = pytest.mark.parametrize('page', PAGES, ids=page_name)
COMPOSED = ('plant', 'trajectory', 'controller', 'recorder')
UNCHECKED = {
    'git', 'eval', 'cd', './example', '.', 'dask', 'rosdep', 'colcon', 'ssh', 'rviz2', 'sudo',
    '.venv/bin/python',
}  # fmt: skip
"""Commands of other programs, which use nothing of this repository."""


@cache
def known(*nodes: str) -> frozenset[str]:
    """Return the parameters of nodes, for the paper's robot and for robots from a URDF."""
    tree = mechanism_from({'robot.urdf': small_tree.URDF, 'robot.tip_frame': 'hand'})
    return frozenset(p.name for n in nodes for m in (DEFAULT, tree) for p in declared(n, m))


def _masmc(words: Sequence[str], folder: Path) -> None:
    if words[1] == 'run':
        if not {'-h', '--help'} & set(words):
            check_node(words[2], words[3:])
        return
    try:
        parser_for(words[1:]).parse_args(words[1:])
    except SystemExit as ended:  # --list and --help end with status 0
        assert not ended.code, shlex.join(words)


def check_node(node: str, arguments: Sequence[str]) -> None:
    """Check the arguments of a node: declared parameters, topics of this package."""
    assert node in NODES
    names = COMPOSED if node == 'composed' else (node,)
    topics = {topic.name for topic in TOPICS} | {'__ns', '__node'}
    words = iter(arguments)
    for word in words:
        if word == '-p':
            target, _, name = next(words).partition(':=')[0].rpartition(':')
            assert name in known(*(n for n in names if target in ('', n))), name
        elif word == '-r':
            topic = next(words).partition(':=')[0]
            assert topic in topics, f'{topic} is no topic of this package'
        elif word == '--params-file':
            assert next(words).endswith('.yaml')
        else:
            assert word in ('--ros-args', '--record'), word


def read_path(topic: str, message: Any) -> None:
    """Check a message with a path as the trajectory node does, for the paper's robot."""
    read = PathMessages(DEFAULT, JOINTS, '').topics[topic][1]
    read(topic, serialize_message(message))


@cache
def services() -> frozenset[tuple[str, str]]:
    """Return type and name of the services of all nodes."""
    names = set()
    for file in (ROOT / 'masmc_ros' / 'nodes').glob('*/node.py'):
        for kind, name in re.findall(r"create_service\((\w+), '~/(\w+)'", file.read_text()):
            names.add((f'std_srvs/srv/{kind}', f'/{file.parent.name}/{name}'))
    return frozenset(names)


def _ros2(words: Sequence[str], folder: Path) -> None:
    match words[1:]:
        case ['run', 'masmc_ros', node, *arguments]:
            check_node(node, arguments)
        case ['launch', 'masmc_ros', file, *arguments]:
            launched(file, **dict(argument.split(':=') for argument in arguments))
        case ['param', 'get' | 'set', node, name, *_]:
            assert name in known(node.rpartition('/')[2])
        case ['service', 'call', name, kind, *_]:
            assert (kind, name) in services()
        case ['lifecycle', 'get', '/controller']:
            pass
        case ['lifecycle', 'set', '/controller', label]:
            assert label in {transition.label for transition in TRANSITIONS}
        case ['topic', 'echo', topic]:
            assert topic in {t.name for t in TOPICS} | {f'/{t.name}' for t in TOPICS}
        case ['topic', 'pub', '--once', topic, kind, text]:
            read_path(topic.lstrip('/'), typed_message(kind, text))
        case ['action', 'send_goal', name, _, text, '--feedback']:
            assert name == f'/{ACTION}'
            plan = yaml.safe_dump(yaml.safe_load(text)['trajectory'])
            message = typed_message('trajectory_msgs/msg/JointTrajectory', plan)
            read_path('trajectory/joint_trajectory', message)
        case ['run', 'teleop_twist_keyboard', *_, '--remap', names]:
            assert names.partition(':=/')[2] in PathMessages(DEFAULT, JOINTS, '').topics
        case ['bag', *_] | ['run', 'foxglove_bridge', *_]:
            pass  # another package
        case _:
            pytest.fail(f'unchecked: {shlex.join(words)}')


def _make(words: Sequence[str], folder: Path) -> None:
    if '-C' in words:  # the Makefile of a written folder
        return
    targets = re.findall(r'^([a-z-]+):', (ROOT / 'Makefile').read_text(), re.MULTILINE)
    for word in words[1:]:
        assert word in targets or re.fullmatch(r'[A-Z]+=.*', word), word


def _pip(words: Sequence[str], folder: Path) -> None:
    metadata = (ROOT / 'setup.py').read_text(encoding='utf-8')
    for word in words[2:]:
        if not word.startswith(('-', '.')):
            assert re.search(rf"'{word}[^\w-]", metadata), f'{word} is no dependency of setup.py'


def _python(words: Sequence[str], folder: Path) -> None:
    module, *arguments = words[2:] if words[1] == '-m' else ('', *words[1:])
    assert not module or find_spec(module), module
    for word in arguments:
        assert not word.endswith('.py') or (ROOT / word).is_file(), word


CHECKS: dict[str, Callable[[Sequence[str], Path], None]] = {
    'masmc': _masmc,
    'ros2': _ros2,
    'make': _make,
    'pip': _pip,
    'python': _python,
}


@each_page
def test_commands_have_valid_arguments(page: Path, tmp_path: Path) -> None:
    for words in all_commands(page):
        if words[0] not in UNCHECKED:
            CHECKS[words[0]](words, tmp_path)


@each_page
def test_commands_in_text_have_valid_arguments(page: Path, tmp_path: Path) -> None:
    text = re.sub(r'```.*?```', '', page.read_text(encoding='utf-8'), flags=re.DOTALL)
    for code in re.findall(r'`((?:ros2|masmc|pip|python|make) [^`]*)`', text):
        words = shlex.split(code)
        # `ros2 param set` and `masmc report` name a command, others have places for arguments.
        is_name = len(words) < (4 if words[0] == 'ros2' else 3) or words[-1].startswith('--')
        if not is_name and not re.search(r'\b[A-Z]{3,}\b|\.\.\.', code):
            CHECKS[words[0]](words, tmp_path)


@pytest.mark.parametrize(
    'line',
    [
        'masmc simulate config/paper.yaml --outptu run.mcap',
        'masmc run controler',
        'ros2 run masmc_ros plant --ros-args -p k_s1:=1.0',
        'ros2 run masmc_ros controller --ros-args -r effort:=/arm/commands',
        'ros2 launch masmc_ros paper.launch.py robot:=tiago',
        'ros2 param set /controller ks_1 1',
        'ros2 service call /controller/enable std_srvs/srv/Trigger',
        'ros2 lifecycle set /controller start',
        'ros2 topic pub --once /trajectory/joint_trajectory trajectory_msgs/msg/JointTrajectory '
        '"{joint_names: [arm_joint_3], points: [{positions: [1.0]}]}"',
        'make everything',
        'pip install visor',
        'python -m benchmarks.none',
        'python tools/none.py',
    ],
)
def test_wrong_commands_are_rejected(line: str, tmp_path: Path) -> None:
    words = shlex.split(line)
    with pytest.raises((AssertionError, InputError, ModuleNotFoundError)):
        CHECKS[words[0]](words, tmp_path)


@each_page
def test_files_in_text_exist(page: Path) -> None:
    text = page.read_text(encoding='utf-8')
    for name in re.findall(r'`((?:[a-z]\w*/)*\w+\.(?:py|yaml|json|rviz|sh|toml|cfg|c))`', text):
        if 'NAME' not in name and name not in WRITTEN:
            is_file = (ROOT / name).is_file() or any(
                next((ROOT / folder).rglob(name), None) for folder in FOLDERS
            )
            assert is_file, f'{name} does not exist'


FOLDERS = ('masmc_ros', 'test', 'config', 'benchmarks', 'examples')
"""Folders whose files the documentation names without the folder."""

WRITTEN = {
    'bench.json',
    'example.c',
    'layout.json',
    'metadata.yaml',
    'tuned.yaml',
    'first_torque.yaml',
    'my_path.yaml',
    'my_robot.yaml',
    'results.json',
}
"""Files that commands or users write."""


@each_page
def test_names_of_tests_in_text_exist(page: Path) -> None:
    for name in re.findall(r'`(test_\w+)`', page.read_text(encoding='utf-8')):
        assert name in names_of_tests()


@cache
def names_of_tests() -> frozenset[str]:
    texts = (file.read_text(encoding='utf-8') for file in (ROOT / 'test').rglob('test_*.py'))
    return frozenset(name for text in texts for name in re.findall(r'^def (test_\w+)', text, re.M))


@each_page
def test_parameters_in_text_exist(page: Path) -> None:
    text = page.read_text(encoding='utf-8')
    for node, name in re.findall(rf'`({"|".join(COMPOSED)})\.(\w[\w.]*)(?:=[^`]*)?`', text):
        assert name == 'py' or name in known(node), f'{node}.{name}'


@each_page
def test_yaml_blocks_set_declared_parameters(page: Path, tmp_path: Path) -> None:
    for block in blocks(page, 'yaml'):
        content = yaml.safe_load(block)
        assert content is not None
        if block.startswith(('/**:', '/**/controller:')):  # complete, and of the default robot
            file = tmp_path / 'block.yaml'
            file.write_text(block, encoding='utf-8')
            load_scenario(str(file))
        for pattern, body in content.items():
            node = pattern.rpartition('/')[2]
            if not pattern.startswith('/**'):
                continue  # a node of another package
            names = known(*(COMPOSED if node == '**' else (node,)))
            for name in _names(body['ros__parameters']):
                assert name in names, name


def _names(values: dict[str, object], prefix: str = '') -> list[str]:
    names = []
    for name, value in values.items():
        full = f'{prefix}{name}'
        names += _names(value, f'{full}.') if isinstance(value, dict) else [full]
    return names


@pytest.mark.skipif(shutil.which('bash') is None, reason='no bash here')
@each_page
def test_shell_blocks_parse(page: Path) -> None:
    for block in blocks(page, 'sh'):
        result = subprocess.run(['bash', '-n'], input=block, capture_output=True, text=True)
        assert result.returncode == 0, f'{block}\n{result.stderr}'
