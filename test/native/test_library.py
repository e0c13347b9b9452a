# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Libraries of controllers: compiled by a C compiler, they compute the bits of this process."""

from __future__ import annotations

import json
from pathlib import Path
import shutil
import subprocess

from helpers.processes import PAPER
from masmc_ros.errors import InputError
from masmc_ros.law.registry import LAWS
from masmc_ros.loop.simulation import Simulation
from masmc_ros.native.library import write_library
from masmc_ros.native.targets import TARGETS
from masmc_ros.scenario.scenario import load_scenario
import pytest

HOST = 'x86_64-linux-gnu'
EFFECTS = (
    'plant.velocity_noise=0.002', 'plant.encoder_resolution=0.0001',
    'plant.measurement_delay=0.002', 'plant.command_delay=0.002', 'plant.delay_jitter=0.5',
    'plant.measurement_loss=0.05', 'plant.command_loss=0.05', 'plant.seed=3',
    'plant.motor_lag=0.001', 'controller.motor_lag=0.001', 'controller.latency=0.004',
    'controller.torque_limit=40.0', 'controller.leakage=0.1',
)  # fmt: skip
needs_compiler = pytest.mark.skipif(shutil.which('cc') is None, reason='needs a C compiler')


def bits_in_c(folder: Path, target: str, compiler: str, *runner: str) -> bytes:
    """Return the signals of all ticks that the example of a library computes."""
    make = ['make', '-s', '-C', str(folder), f'TARGET={target}', f'CC={compiler}']
    subprocess.run([*make, 'CFLAGS=-O2 -Wall -Werror -Wno-unused-const-variable'], check=True)
    subprocess.run([*runner, './example', 'signals.bin'], cwd=folder, check=True)
    (folder / 'example').unlink()
    return (folder / 'signals.bin').read_bytes()


def bits_here(*settings: str) -> bytes:
    (block,) = Simulation(load_scenario(str(PAPER), settings)).run()
    return block.signals.tobytes()


def library(folder: Path, *settings: str, targets: tuple[str, ...] = (HOST,)) -> list[Path]:
    values = load_scenario(str(PAPER), settings)
    chosen = {name: TARGETS[name] for name in targets}
    return write_library(folder, 'paper', values, chosen, overwrite=False)


@needs_compiler
def test_library_in_c_has_the_bits_of_simulate(tmp_path: Path) -> None:
    settings = 'duration=1.0', 'controller.switching=implicit', 'controller.observer_gain=0.5'
    library(tmp_path, *settings)
    assert bits_in_c(tmp_path, HOST, 'cc') == bits_here(*settings)
    header = tmp_path / 'paper.h'
    subprocess.run(['cc', '-x', 'c++', '-std=c++17', '-fsyntax-only', str(header)], check=True)
    described = json.loads((tmp_path / 'paper.json').read_text('utf-8'))
    assert described['records']['settings']['fields']['k_s1']['shape'] == [4]
    assert described['parameters']['k_s1']['minimum'] == 0.0


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize('target', [HOST, 'aarch64-linux-gnu'])
def test_library_with_all_effects_has_the_bits_of_simulate(tmp_path: Path, target: str) -> None:
    compiler, runner = ('cc', ()) if target == HOST else (f'{target}-gcc -static',
                                                          ('qemu-aarch64-static',))
    for program in (compiler.split()[0], *runner):
        if shutil.which(program) is None:
            pytest.skip(f'needs {program}')
    settings = 'duration=2.0', *EFFECTS
    first = library(tmp_path / 'a', *settings, targets=(target,))
    second = library(tmp_path / 'b', *settings, targets=(target,))
    for a, b in zip(first, second, strict=True):
        assert a.read_bytes() == b.read_bytes()
    assert bits_in_c(tmp_path / 'a', target, compiler, *runner) == bits_here(*settings)


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize('law', LAWS)
def test_library_of_every_law_has_the_bits_of_simulate(tmp_path: Path, law: str) -> None:
    settings = 'duration=0.5', f'controller.law={law}', 'controller.switching=tanh'
    library(tmp_path, *settings)
    assert bits_in_c(tmp_path, HOST, 'cc') == bits_here(*settings)


@pytest.mark.parametrize(
    ('setting', 'line'),
    [
        ('plant.physics=mujoco', 'plant.physics = mujoco: expected rigid for a library'),
        ('controller.approach_on_start=true', 'approach_on_start or active_on_start'),
        ('duration=0.0', 'duration = 0.0'),
    ],
)
def test_library_of_run_without_kernel_is_one_line(
    tmp_path: Path, setting: str, line: str
) -> None:
    with pytest.raises(InputError, match=line):
        library(tmp_path / 'library', setting)
    assert not (tmp_path / 'library').exists()
