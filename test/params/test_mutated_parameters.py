# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Mutated parameter files: agreement of nodes and simulation, and bounded run times."""

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
from masmc_ros.scenario.node_parameters import declared, NODES
from masmc_ros.scenario.scenario import activation, load_scenario
import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = [ROOT / 'config' / name for name in ('paper.yaml', 'robust.yaml')]
FILES, LIMIT = 150, 900.0
"""Number of mutated files, and the time limit in s for all of them."""

TICKS, LONGEST = 20, 20.0
"""Number of computed ticks of accepted files, and the time limit in s for each."""

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
    """Return a value that a user might write."""
    kind = draw.random()
    if kind < 0.6:
        return draw.choice(NUMBERS)
    if kind < 0.75:
        count = draw.choice([1, 2, 3, 4, 4, 7, 7, 200])
        return f'[{", ".join(draw.choice(NUMBERS) for _ in range(count))}]'
    return draw.choice(OTHERS if kind < 0.9 else WORDS)


def mutated(number: int) -> str:
    """Return a mutated parameter file, the same for equal numbers."""
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
    """Return True if the simulation accepts a file, and its message; compute the first ticks."""
    try:
        values = load_scenario(str(path))
    except InputError as error:
        assert '\n' not in str(error)
        return False, str(error)
    start = time.process_time()
    try:
        simulation = Simulation(values, activation(values))
        next(simulation.run(TICKS), None)
    except InputError as error:
        assert '\n' not in str(error)
        return True, str(error)
    finally:
        assert time.process_time() - start < LONGEST
    return True, ''


@pytest.fixture(scope='module', autouse=True)
def compiled() -> None:
    """Compile the measured code."""
    values = load_scenario(str(SOURCES[0]))
    next(Simulation(values).run(TICKS))


REJECTED = {
    'control_period: 1e-9': '1e+09 ticks in a second; expected at most 100000',
    'control_period: 1e-300': '1e+300 ticks in a second',
    'duration: 1e300': '1.0e+303 ticks; expected less than 2147483648 s',
    'duration: 1.7e308': '1.7e+311 ticks',
    'duration: 2147483648.0': 'ticks; expected less than',
    'control_period: 1e-9\n    measurement_delay: 1.0': 'ticks in a second',
    'integrator_step: 1e-12': '1e+09 steps in a control period; expected at most 100000',
    'integrator_step: 1e-300': '1e+297 steps in a control period',
}
"""Settings in the block of a plant, and their error messages."""


@pytest.mark.parametrize('wrong', REJECTED)
def test_simulate_excessive_number_of_steps_prints_one_line(
    wrong: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / 'run.yaml'
    shared = '/**:\n  ros__parameters:\n    control_period: 0.001\n'
    path.write_text(f'{shared}/**/plant:\n  ros__parameters:\n    {wrong}\n')
    assert main(['simulate', str(path)]) == 2
    _, err = capsys.readouterr()
    assert len(err.splitlines()) == 1
    assert REJECTED[wrong] in err


def test_simulate_mutated_files_are_accepted_or_rejected(tmp_path: Path) -> None:
    path = tmp_path / 'run.yaml'
    results = Counter()
    for number in range(60):
        path.write_text(mutated(number), encoding='utf-8')
        results[offline(path)[0]] += 1
    assert results[True] > 5
    assert results[False] > 5


@pytest.mark.slow
def test_mutated_files_nodes_and_simulation_agree(tmp_path: Path) -> None:
    pytest.importorskip('rclpy')
    path = tmp_path / 'run.yaml'
    results: Counter[str] = Counter()
    limit = time.monotonic() + LIMIT
    for number in range(FILES):
        if time.monotonic() > limit:
            break
        path.write_text(mutated(number), encoding='utf-8')
        is_accepted, message = offline(path)
        if 'a simulated path starts with the robot' in message:
            continue  # permitted for a node, impossible in a simulation
        rejection = rejection_by_nodes(path)
        assert is_accepted == (rejection is None), (number, message, rejection)
        results['accepted' if is_accepted else 'rejected'] += 1
    assert min(results['accepted'], results['rejected']) > 0.1 * sum(results.values())


def rejection_by_nodes(path: Path) -> str | None:
    """Return the message of the first node that rejects a file; None if all accept it."""
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
