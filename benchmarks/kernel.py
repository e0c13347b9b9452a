# SPDX-License-Identifier: Apache-2.0
"""Speed of the compiled kernel: a whole run, and single ticks called from Python."""

from __future__ import annotations

from pathlib import Path
import shutil
import subprocess
import tempfile
import time

from masmc_ros.loop.simulation import Simulation
from masmc_ros.scenario.scenario import load_scenario
from masmc_ros.share import shared_file

CASES = {
    'smc, sign': ('controller.law=smc', 'controller.switching=sign'),
    'rasmc, tanh': (),
    'smc, implicit, observer 0.5': (
        'controller.law=smc',
        'controller.switching=implicit',
        'controller.observer_gain=0.5',
    ),
}


def run_seconds(settings: tuple[str, ...], repeats: int = 10) -> float:
    """Return the best time of a 20 s run at 1 kHz, all signals kept, in s."""
    simulation = Simulation(load_scenario(str(shared_file('config', 'paper.yaml')), settings))
    best = float('inf')
    for _ in range(repeats + 1):
        begin = time.perf_counter()
        for _ in simulation.run(block=30_000):
            pass
        best = min(best, time.perf_counter() - begin)
    return best


def tick_seconds(repeats: int = 100_000) -> tuple[float, float]:
    """Return the time of one control tick and of one plant tick from Python, in s."""
    simulation = Simulation(load_scenario(str(shared_file('config', 'paper.yaml'))))
    plant, controller = simulation.plant, simulation.controller
    reference = simulation.trajectory.sample(0, 1)[0]
    controller.tick(plant.position, plant.velocity, reference)
    plant.advance(controller.torque)
    plant.reset()
    begin = time.perf_counter()
    for _ in range(repeats):
        controller.tick(plant.position, plant.velocity, reference)
    middle = time.perf_counter()
    controller.torque[:] = 0.0
    for _ in range(repeats):
        plant.advance(controller.torque)
    end = time.perf_counter()
    return (middle - begin) / repeats, (end - middle) / repeats


def c_seconds() -> float | None:
    """Return the best time of the same run in C, -O3, in s; None without a compiler."""
    compiler = shutil.which('cc')
    if compiler is None:
        return None
    source = Path(__file__).with_name('closed_loop.c')
    with tempfile.TemporaryDirectory() as folder:
        program = str(Path(folder) / 'closed_loop')
        subprocess.run([compiler, '-O3', '-o', program, str(source), '-lm'], check=True)
        output = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    return 1e-3 * float(output.split()[0])


def main() -> None:
    """Print the times."""
    in_c = c_seconds()
    for name, settings in CASES.items():
        taken = run_seconds(settings)
        ratio = '' if in_c is None else f', {taken / in_c:.2f} of rasmc, tanh in C'
        print(f'20 s at 1 kHz, {name}: {1e3 * taken:.1f} ms (best of 10){ratio}')
    if in_c is not None:
        print(f'rasmc, tanh in C, -O3: {1e3 * in_c:.1f} ms (best of 11)')
    control, plant = tick_seconds()
    print(f'from Python: control tick {1e6 * control:.2f} us, plant tick {1e6 * plant:.2f} us')


if __name__ == '__main__':
    main()
