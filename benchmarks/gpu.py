# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Campaigns and episodes on a GPU: code of all laws, bits of all laws, and rates.

usage: python -m benchmarks.gpu code | cuda | stand-in [--quick]

`code` needs `ptxas` and no card: local memory, spills and operations of each law. `cuda` measures
rates of campaigns and of episodes. It compares the rows of 1000 runs of each law, with noise,
delays and losses, and episodes with those of the processor; the status is 1 if a bit differs.
`stand-in` does the same without a card; --quick: few runs and laws.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
import ctypes
from hashlib import sha256
from itertools import chain
import multiprocessing
from pathlib import Path
import re
import subprocess
import sys
import tempfile
import time
from typing import Any

from benchmarks.campaign import campaign_of_robots
import llvmlite.binding as llvm
from masmc_ros.api.episodes import Episodes
from masmc_ros.campaign.campaign import Campaign
from masmc_ros.campaign.engine import carry_out
from masmc_ros.campaign.runs import Rows, rows
from masmc_ros.child_process import processors
from masmc_ros.errors import InputError
from masmc_ros.law.registry import LAWS
from masmc_ros.native.accelerator import Accelerator, Cuda, named, StandIn
from masmc_ros.native.device import Device, DeviceBatch
from masmc_ros.native.gpu_code import ptx
import numpy as np

EFFECTS = (
    'plant.velocity_noise=0.002', 'plant.encoder_resolution=0.0001',
    'plant.measurement_delay=0.001', 'plant.command_delay=0.001', 'plant.delay_jitter=0.5',
    'plant.measurement_loss=0.05', 'plant.command_loss=0.05', 'controller.observer_gain=0.0',
    'duration=1.0',
)  # fmt: skip
"""Settings of the comparison of bits."""

CAPABILITIES = (8, 0), (9, 0)

FP64: dict[tuple[int, ...], int] = {(8, 0): 32, (9, 0): 64, (10, 0): 64}
"""Double-precision operations per cycle of a multiprocessor, fused ones as one; others: 2."""

_OPERATION = re.compile(r' = (?:fadd|fsub|fmul|fdiv|call .*@llvm\.sqrt\S*\() ?(?:<(\d+) x)?')
_END = re.compile(r'  (?:br|ret|switch|unreachable)\b')
_COUNTER = 'masmc_operations'


class Kept(StandIn):
    """Stand-in that keeps the codes that it loads, and does not run them."""

    def __init__(self) -> None:
        """Initialise the stand-in."""
        super().__init__()
        self.code = ''

    def load(self, code: str) -> Callable[..., None]:
        """Keep the code."""
        self.code = code
        return lambda lanes, *arguments: None


class Counting(StandIn):
    """Stand-in that counts additions, products, divisions and square roots."""

    def module_of(self, code: str, triple: str) -> Any:
        """Return the module with a counter at the end of each block of instructions."""
        lines, count = [f'@{_COUNTER} = global i64 0'], 0
        header = 0
        for number, line in enumerate(str(super().module_of(code, triple)).splitlines()):
            if match := _OPERATION.search(line):
                count += int(match[1] or 1)
            if _END.match(line) and count:
                lines += [
                    f'  %count.{number} = load i64, ptr @{_COUNTER}',
                    f'  %more.{number} = add i64 %count.{number}, {count}',
                    f'  store i64 %more.{number}, ptr @{_COUNTER}',
                ]
                count = 0
            if line.startswith('target triple'):
                header = len(lines) + 1
            lines.append(line)
        # The header of a module precedes its variables.
        return llvm.parse_assembly('\n'.join([*lines[1:header], lines[0], *lines[header:]]))

    def operations(self) -> int:
        """Return the number of operations until now."""
        (engine,) = self._engines
        address = engine.get_global_value_address(_COUNTER)
        return ctypes.c_int64.from_address(address).value


def of_law(law: str, runs: int) -> Campaign:
    """Return the campaign that compares bits; every run has another robot and other noise."""
    return campaign_of_robots(runs, *EFFECTS, f'controller.law={law}')


def digest(columns: Rows) -> str:
    """Return a digest of rows."""
    return sha256(b''.join(columns[name].tobytes() for name in sorted(columns))).hexdigest()[:16]


def rows_here(law: str, runs: int) -> Rows:
    """Return the rows of a law by this processor, and store its code for a card on the disk."""
    campaign = of_law(law, runs)
    rows(campaign, 0, 1, device=Device(Kept()))
    # One by one: compiling the law for lanes takes longer than these runs.
    parts = [rows(campaign, first, 1) for first in range(runs)]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def code() -> Iterator[str]:
    """Yield a row of the table of local memory and spills for each law."""
    yield '| law | ' + ' | '.join(
        f'sm_{a}{b}: stack, spills (bytes)' for a, b in CAPABILITIES
    ) + ' | products, sums, divisions, roots |'
    for law in LAWS:
        kept = Kept()
        try:
            rows(of_law(law, 1), 0, 1, device=Device(kept))
            texts = [ptx(kept.code, capability) for capability in CAPABILITIES]
        except InputError as error:
            yield f'| `{law}` | {error} |'
            continue
        cells = [
            _assembled(text, 'sm_{}{}'.format(*capability))
            for text, capability in zip(texts, CAPABILITIES, strict=True)
        ]
        counts = [
            len(re.findall(rf'\b(?:{names})\.rn\.f64', texts[-1]))
            for names in ('mul', 'add|sub', 'div', 'sqrt')
        ]
        yield f'| `{law}` | {" | ".join(cells)} | {", ".join(map(str, counts))} |'


def _assembled(text: str, architecture: str) -> str:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / 'run.ptx'
        file.write_text(text, encoding='utf-8')
        command = ['ptxas', '-v', f'-arch={architecture}', str(file), '-o', f'{file}.cubin']
        report = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    stack = max(int(n) for n in re.findall(r'(\d+) bytes cumulative stack', report))
    spills = sum(int(n) for n in re.findall(r'(\d+) bytes spill stores', report))
    return f'{stack}, {spills}'


def bits(accelerator: Accelerator, laws: list[str], runs: int) -> Iterator[str]:
    """Yield a line for each law: whether the rows of the device are those of the processor."""
    context = multiprocessing.get_context('spawn')
    with ProcessPoolExecutor(max(1, processors() - 1), mp_context=context) as pool:
        expected = {law: pool.submit(rows_here, law, runs) for law in laws}
        for law in laws:
            try:
                other = digest(expected[law].result())
                start = time.perf_counter()
                found = rows(of_law(law, runs), 0, runs, device=Device(accelerator))
            except InputError as error:
                yield f'{law}: {error}'
                continue
            took, one = time.perf_counter() - start, digest(found)
            lost = int(found['lost'].sum())
            result = 'equal' if one == other else 'DIFFERENT'
            yield f'{law}: {result}, {one} and {other}; {runs} runs, {lost} lost, {took:.1f} s'


def rates(accelerator: Accelerator, scale: float) -> Iterator[str]:
    """Yield the rates of a card; `scale` reduces the numbers of runs."""
    device = Device(accelerator)
    campaign = campaign_of_robots(round(scale * 20_000))
    start = time.perf_counter()
    rows(campaign, 0, 1, device=device)
    yield f'first row, compilation included: {time.perf_counter() - start:.1f} s'
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        carry_out(campaign, Path(folder), device=lambda: device)
        rate = campaign.total / (time.perf_counter() - start)
    yield f'{campaign.total} runs of 20 s, one process: {rate:.0f} runs/s'
    counting = Counting()
    runs = [run.scenario for run in campaign.runs(0, 1)]
    DeviceBatch(runs).metrics(counting)
    operations = counting.operations()
    yield f'operations of a run of 20 s: {operations / 1e6:.1f} million'
    spent: list[float] = []
    functions = dict(accelerator.functions)

    def timed(function: Callable[..., None]) -> Callable[..., None]:
        def launch(lanes: int, *arguments: int) -> None:
            start = time.perf_counter()
            function(lanes, *arguments)
            spent.append(time.perf_counter() - start)

        return launch

    accelerator.functions = {key: timed(function) for key, function in functions.items()}
    size = max(1, min(accelerator.most_runs, round(scale * 1e5)))
    for count, seconds in ((1e5, 20.0), (1e6, 20.0), (1e7, 1.0)):
        chosen = campaign_of_robots(size, f'duration={seconds}')
        start = time.perf_counter()
        batch = DeviceBatch([run.scenario for run in chosen.runs(0, size)])
        prepared = (time.perf_counter() - start) / size
        spent.clear()
        batches = max(1, round(scale * count / size))
        for _ in range(batches):
            # The same robots again: other ones take as long.
            batch.metrics(accelerator)
        rate = batches * size / sum(spent)
        share = ''
        if isinstance(accelerator, Cuda):
            part = rate * operations * seconds / 20.0 / double_precision_rate(accelerator)
            share = f', {100.0 * part:.1f} % of the double-precision rate'
        yield (
            f'{batches * size} runs of {seconds:g} s: {rate:.0f} runs/s on the device{share}; '
            f'preparation {1e6 * prepared:.0f} us of a processor a run'
        )
    accelerator.functions = functions


def episodes(name: str, scale: float) -> Iterator[str]:
    """Yield whether episodes on a device are those of the processor, and their rates."""
    options: dict[str, Any] = {
        'draw': {'plant.robot.link_2_mass': 'uniform:0.642:1.498'}, 'duration': 0.5,
        'settings': {'plant.velocity_noise': 0.002, 'plant.measurement_delay': 0.002},
    }  # fmt: skip
    digests = []
    for place in ('cpu', name):
        robots = Episodes(64, 'paper', device=place, **options)
        robots.seed(0)
        bits = sha256(robots.reset()[0].tobytes())
        for torques in np.random.default_rng(0).uniform(-5.0, 5.0, (600, 64, 4)):
            done = robots.step(torques)
            for part in done[:4]:
                bits.update(part.tobytes())
        digests.append(bits.hexdigest()[:16])
    result = 'equal' if digests[0] == digests[1] else 'DIFFERENT'
    yield f'episodes: {result}, {digests[1]} and {digests[0]}; 64 robots, 600 steps'
    for count in (1e3, 1e4, 1e5):
        robots = Episodes(max(1, round(scale * count)), 'paper', device=name, **options)
        robots.seed(0)
        start = time.perf_counter()
        robots.reset()
        started, torques = time.perf_counter(), np.zeros((robots.count, 4))
        for _ in range(100):
            robots.step(torques)
        rate = 100.0 * robots.count / (time.perf_counter() - started)
        yield f'{robots.count} robots: {rate:.0f} steps/s, reset {started - start:.1f} s'


def double_precision_rate(card: Cuda) -> float:
    """Return the double-precision operations per second of a card."""
    cycles = 1e3 * card.attribute('CLOCK_RATE') * card.attribute('MULTIPROCESSOR_COUNT')
    return cycles * FP64.get(card.capability, 2)


def main(arguments: list[str]) -> int:
    """Run the benchmark and return the exit status."""
    names = [name for name in arguments if name != '--quick']
    if len(names) != 1 or names[0] not in ('code', 'cuda', 'stand-in'):
        print(__doc__, file=sys.stderr)
        return 2
    start, is_quick = time.perf_counter(), '--quick' in arguments
    is_equal = True
    if names == ['code']:
        lines = code()
    else:
        accelerator = named(names[0])
        print(accelerator.name, flush=True)
        laws, runs, scale = (['rasmc', 'pid'], 20, 1e-4) if is_quick else ([*LAWS], 1000, 1.0)
        lines = chain(
            rates(accelerator, scale), episodes(names[0], scale), bits(accelerator, laws, runs)
        )
    for line in lines:
        print(line, flush=True)
        is_equal &= 'DIFFERENT' not in line
    print(f'{time.perf_counter() - start:.0f} s in all', flush=True)
    return 0 if is_equal else 1


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
