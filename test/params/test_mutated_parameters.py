# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Mutated parameter files: nodes and simulation agree, and nothing runs longer than a life."""

from __future__ import annotations

from collections import Counter
from functools import partial
from pathlib import Path
import random
import re
import time

from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.loop.simulation import Simulation
from masmc_ros.params.node_parameters import declared, NODES
from masmc_ros.params.scenario import activation, load_scenario
import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = [ROOT / 'config' / name for name in ('paper.yaml', 'robust.yaml')]
FILES, LIMIT = 500, 900.0
"""Mutated files, and the time in s for them."""

TICKS, LONGEST = 20, 20.0
"""So many ticks of what is accepted are computed, in so many s at most."""

NUMBERS = (
    *('1e-9', '1e-12', '1e-300', '5e-324', '1e9', '1e10', '1e300', '1.7e308', '-1.0', '0.0'),
    *('-0.0', '.nan', '.inf', '-.inf', '1', '0', '-1', '1e999', '2147483647.0', '1.0e-5'),
    *('9223372036854775807', '9223372036854775808', '0.5', '1.0', '3.0', '100', '4294967296'),
)
OTHERS = (
    *('true', 'off', '~', '""', "''", 'x', '[]', '{}', '[[1.0]]', '[1.0, x]', '[1, 2.0]'),
    *('{a: 1}', '&x 1.0', '*x', '!!str 1.0', '"1.0"', '|', '[1.0', 'a: b', '\t', '"\\0"', '# 1'),
)
WORDS = ('smc', 'rasmc', 'tanh', 'sign', 'implicit', 'lockstep', 'realtime', 'velocity', 'odom')
PAIR = re.compile(r'^(\s+)([\w./*]+): (.+)$')


def value(draw: random.Random) -> str:
    """Return a value as somebody may write it."""
    kind = draw.random()
    if kind < 0.6:
        return draw.choice(NUMBERS)
    if kind < 0.75:
        count = draw.choice([1, 2, 3, 4, 4, 7, 7, 200])
        return f'[{", ".join(draw.choice(NUMBERS) for _ in range(count))}]'
    return draw.choice(OTHERS if kind < 0.9 else WORDS)


def mutated(number: int) -> str:
    """Return a parameter file with something else in it, the same for a number."""
    draw = random.Random(number)
    lines = draw.choice(SOURCES).read_text(encoding='utf-8').splitlines()
    for _ in range(draw.choice([1, 1, 1, 2, 4])):
        pairs = [index for index, line in enumerate(lines) if PAIR.match(line)]
        index = draw.choice(pairs)
        indent, name, _ = PAIR.match(lines[index]).groups()  # type: ignore[union-attr]
        kind = draw.randrange(10)
        if kind < 4:
            lines[index] = f'{indent}{name}: {value(draw)}'
        elif kind < 7:
            node = draw.choice(NODES)
            other = draw.choice(declared(node)).name
            lines += [f'/**/{node}:', '  ros__parameters:', f'    {other}: {value(draw)}']
        elif kind == 7:
            place = draw.randrange(len(lines))
            lines[place] = draw.choice(['', '  ', '\t', '- ']) + lines[place].lstrip()
        elif kind == 8:
            del lines[draw.randrange(len(lines))]
        else:
            place = draw.randrange(len(lines))
            text = list(lines[place] or ' ')
            text[draw.randrange(len(text))] = draw.choice('019.,:[]{}"\'-ex #&*!|>%@`\t\x07é')
            lines[place] = ''.join(text)
    return '\n'.join(lines) + '\n'


def offline(path: Path) -> tuple[bool, str]:
    """Tell whether the simulation takes a file, and what it says; compute its beginning."""
    try:
        values = load_scenario(str(path))
    except InputError as error:
        assert '\n' not in str(error)
        return False, str(error)
    begun = time.process_time()
    try:
        simulation = Simulation(values, activation(values))
        next(simulation.run(TICKS), None)
    except InputError as error:
        assert '\n' not in str(error)
        return True, str(error)
    finally:
        assert time.process_time() - begun < LONGEST
    return True, ''


@pytest.fixture(scope='module', autouse=True)
def compiled() -> None:
    """Compile what is measured below."""
    values = load_scenario(str(SOURCES[0]))
    next(Simulation(values).run(TICKS))


REFUSED = {
    'control_period: 1e-9': '1e+09 ticks in a second; expected at most 100000',
    'control_period: 1e-300': '1e+300 ticks in a second',
    'duration: 1e300': '1.0e+303 ticks; expected less than 2147483648 s',
    'duration: 1.7e308': '1.7e+311 ticks',
    'duration: 2147483648.0': 'ticks; expected less than',
    'control_period: 1e-9\n    measurement_delay: 1.0': 'ticks in a second',
    'integrator_step: 1e-12': '1e+09 steps in a control period; expected at most 100000',
    'integrator_step: 1e-300': '1e+297 steps in a control period',
}
"""What stands in a plant's block, and what is said of it."""


@pytest.mark.parametrize('wrong', REFUSED)
def test_what_cannot_be_meant_is_refused_with_its_number_of_steps(
    wrong: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / 'run.yaml'
    shared = '/**:\n  ros__parameters:\n    control_period: 0.001\n'
    path.write_text(f'{shared}/**/plant:\n  ros__parameters:\n    {wrong}\n')
    assert main(['simulate', str(path)]) == 2
    _, err = capsys.readouterr()
    assert len(err.splitlines()) == 1
    assert REFUSED[wrong] in err


def test_some_mutated_files(tmp_path: Path) -> None:
    path = tmp_path / 'run.yaml'
    results = Counter()
    for number in range(60):
        path.write_text(mutated(number), encoding='utf-8')
        results[offline(path)[0]] += 1
    assert min(results.values()) > 5


@pytest.mark.slow
def test_nodes_and_simulation_agree(tmp_path: Path) -> None:
    pytest.importorskip('rclpy')
    path = tmp_path / 'run.yaml'
    results: Counter[str] = Counter()
    limit = time.monotonic() + LIMIT
    for number in range(FILES):
        if time.monotonic() > limit:
            break
        path.write_text(mutated(number), encoding='utf-8')
        taken, said = offline(path)
        if 'a simulated path starts with the robot' in said:
            continue  # what a node may do and a simulation cannot
        refused = refusal_of_nodes(path)
        assert taken == (refused is None), (number, said, refused)
        results['taken' if taken else 'refused'] += 1
    assert min(results['taken'], results['refused']) > 0.1 * sum(results.values())


def refusal_of_nodes(path: Path) -> str | None:
    """Return what the first node says that refuses a file; None where all take it."""
    from masmc_ros.loop.timing import Timing
    from masmc_ros.nodes.parameters.ros_parameters import RosParameters
    from masmc_ros.nodes.process.command_line import parse
    import rclpy
    from rclpy.context import Context
    from rclpy.node import Node

    arguments = ['--ros-args', '--params-file', str(path)]
    context = Context()
    try:
        command_line = parse(arguments)
        with pytest.MonkeyPatch.context() as environment:
            environment.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
            rclpy.init(args=arguments, context=context, domain_id=86)
        for name in NODES:
            node = Node(name, context=context, enable_rosout=False)
            try:
                declare = partial(declared, name)
                values = RosParameters(node, declare, command_line=command_line).values
                if 'control_period' in values:
                    Timing.from_values(values)
            finally:
                node.destroy_node()
    except InputError as error:
        assert '\n' not in str(error)
        return str(error)
    finally:
        context.try_shutdown()
    return None
