# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Ticks per second of a lock-step run, compared with the ping-pong of the same messages."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from importlib.util import find_spec
import os
from pathlib import Path
import re
from statistics import median
import subprocess
import sys
import tempfile

from benchmarks.measure import compared, Measure
from benchmarks.ping_pong import round_trips_per_second, Sizes
from masmc_ros.cli.node_processes import private_domain
from masmc_ros.files import shared_file
from masmc_ros.nodes.process.ending import child_environment
from masmc_ros.robot.mechanisms import driven_joint_names, joint_names
from masmc_ros.scenario.scenario import load_scenario

NODES = ('trajectory', 'controller', 'plant')
CLAIMS = {False: (1.5, 0.76), True: (1.6, 0.4)}
"""Ratios in docs/development/benchmarks.md: without and with all options, in both forms."""

_PACE = re.compile(r'(\d+) ticks/s')


def sizes_of(config: str) -> Sizes:
    """Return the message sizes of a scenario's robot."""
    values = load_scenario(str(shared_file('config', config)))['plant']
    return Sizes(joint_names(values), len(driven_joint_names(values)))


def ticks_per_second(
    *, composed: bool, everything: bool, duration: float = 10.0, config: str = 'paper.yaml'
) -> float:
    """
    Run a scenario on real nodes and return the plant's ticks per second.

    `everything` enables telemetry and frames at every tick, and the recorder.
    """
    nodes = (*NODES, 'recorder') if everything else NODES
    wait_for = ', '.join(node for node in nodes if node != 'plant')
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        domain = stack.enter_context(private_domain())
        arguments = ['--ros-args', '--params-file', str(shared_file('config', config))]
        arguments += ['-p', 'pacing:=lockstep']
        for node in nodes:
            arguments += ['-p', f'{node}:duration:={duration}']
        arguments += [
            '-p',
            f'plant:wait_for:=[{wait_for}]',
            '-p',
            f'controller:telemetry_decimation:={int(everything)}',
            '-p',
            f'plant:tf_decimation:={int(everything)}',
            '-p',
            f'recorder:output:={folder / "run.mcap"}',
        ]
        record = ['--record'] if everything else []
        commands = dict.fromkeys(nodes, arguments)
        if composed:
            commands = {'composed': record + arguments}
        processes = [
            subprocess.Popen(
                [sys.executable, '-m', 'masmc_ros.cli.main', 'run', node, *node_arguments],
                env={**os.environ, **domain, **child_environment()},
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
            )
            for node, node_arguments in commands.items()
        ]
        try:
            output = ''.join(process.communicate(timeout=300.0)[0] for process in processes)
        finally:
            for process in processes:
                process.kill()
                process.wait()
    match = _PACE.search(output)
    if match is None:
        raise RuntimeError(f'the plant printed no rate:\n{output}')
    return float(match[1])


def measures(rounds: int = 3) -> Iterator[Measure]:
    """Yield medians over rounds that alternate ping-pong and lock-step."""
    yield from _compared_with_ping_pong('paper.yaml', '', (False, True), CLAIMS, rounds)
    if find_spec('pinocchio') is not None:
        # The first run compiles.
        ticks_per_second(composed=True, everything=False, duration=0.1, config='tiago.yaml')
        yield from _compared_with_ping_pong('tiago.yaml', ' of TIAGo', (False,), {}, rounds)


def _compared_with_ping_pong(
    config: str,
    robot: str,
    loads: tuple[bool, ...],
    claims: Mapping[bool, tuple[float, float]],
    rounds: int,
) -> Iterator[Measure]:
    """Yield the figures of a scenario and of messages of its sizes."""
    sizes = sizes_of(config)
    for composed in (False, True):
        bare: list[float] = []
        ticks: dict[bool, list[float]] = {everything: [] for everything in loads}
        for _ in range(rounds):
            with private_domain() as domain:
                os.environ.update(domain)
                rate = round_trips_per_second(raw=False, composed=composed, sizes=sizes)
            bare.append(rate)
            for everything, rates in ticks.items():
                pace = ticks_per_second(composed=composed, everything=everything, config=config)
                rates.append(pace)
        place = 'one process' if composed else 'separate processes'
        reference = Measure(f'typed ping-pong{robot}, {place}', median(bare), '/s')
        yield reference
        for everything, rates in ticks.items():
            name = f'lock-step{robot}, {place}' + ', telemetry and recorder' * everything
            claim = claims[composed][everything] if claims else None
            yield compared(name, median(rates), '/s', reference, claim)
