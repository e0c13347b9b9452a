# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Libraries of controllers: compiled by a C compiler, they compute the bits of this process."""

from __future__ import annotations

from collections.abc import Mapping
import json
import os
from pathlib import Path
import shutil
import subprocess

from helpers.processes import PAPER
from helpers.small_tree import hand_at_start, write_scenario
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import interpreted
from masmc_ros.jit.sized_records import LAYOUT
from masmc_ros.law.registry import LAWS
from masmc_ros.loop.closed_loop import control_tick, NOT_FINITE, plant_start, plant_tick
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.supervision import (
    ENABLE,
    STOP,
    supervision_end,
    supervision_record,
    supervision_start,
)
from masmc_ros.native.entries import OTHER_RECORDS
from masmc_ros.native.library import write_library
from masmc_ros.native.targets import TARGETS
from masmc_ros.params.declaration import Values
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

SETTINGS = 'duration=1.0', 'controller.switching=implicit', 'controller.observer_gain=0.5'
HOST = 'x86_64-linux-gnu'
COMMANDS = {
    HOST: ('cc',), 'aarch64-linux-gnu': ('aarch64-linux-gnu-gcc -static', 'qemu-aarch64-static')
}  # fmt: skip
"""Compiler and emulator of each target."""

EFFECTS = (
    'plant.velocity_noise=0.002', 'plant.encoder_resolution=0.0001',
    'plant.measurement_delay=0.002', 'plant.command_delay=0.002', 'plant.delay_jitter=0.5',
    'plant.measurement_loss=0.05', 'plant.command_loss=0.05', 'plant.seed=3',
    'plant.motor_lag=0.001', 'controller.motor_lag=0.001', 'controller.latency=0.004',
    'controller.torque_limit=40.0', 'controller.leakage=0.1',
)  # fmt: skip
MICROCONTROLLER = 'thumbv7em-none-eabihf'
MICROCONTROLLER_TOOLS = 'arm-none-eabi'
MICROCONTROLLER_FLAGS = (
    '-mcpu=cortex-m7', '-mthumb', '-mfpu=fpv5-d16', '-mfloat-abi=hard', '-O2', '-Wall', '-Werror',
    '--specs=rdimon.specs', '-nostartfiles', '-Wno-unused-const-variable',
)  # fmt: skip
EMULATOR = (
    'qemu-system-arm', '-M', 'mps2-an500', '-nographic', '-icount', 'shift=0',
    '-semihosting-config', 'enable=on,target=native', '-kernel',
)  # fmt: skip
SOURCES = Path(__file__).with_name('cortex_m7')
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


def bits_of_ticks(values: Mapping[str, Values]) -> bytes:
    """Return the signals by single ticks, whose kernels the library has compiled already."""
    simulation = Simulation(values)
    controller, plant = simulation.controller, simulation.plant
    controller.reset()
    assert simulation.timing.last is not None
    ticks, signals, bits = simulation.timing.last + 1, plant.signals, b''
    robot = plant.settings, plant.memory, plant.delayed
    plant_start(*robot, signals)
    for k, reference in enumerate(simulation.trajectory.sample(0, ticks)):
        state = signals['position'].ravel(), signals['velocity'].ravel()
        control_tick(controller.settings, controller.memory, signals, *state, reference)
        bits += signals.tobytes()
        if k < ticks - 1:
            plant_tick(*robot, k, signals)
    return bits


def library(
    folder: Path, *settings: str, targets: tuple[str, ...] = (HOST,), supervised: bool = False
) -> list[Path]:
    values = load_scenario(str(PAPER), settings)
    chosen = {name: TARGETS[name] for name in targets}
    return write_library(
        folder, 'paper', values, chosen, overwrite=False, supervised=supervised
    )


PROBE = """#include "paper.h"
#include <stdio.h>
int main(void) {
    static struct {
        paper_settings settings; paper_memory memory; paper_signals signals;
        double position[PAPER_POSITION], velocity[PAPER_VELOCITY], reference[PAPER_REFERENCE];
    } at;
    while (fread(&at, sizeof at, 1, stdin) == 1) {
        int64_t status = paper_control_tick(&at.settings, &at.memory, &at.signals, at.position,
                                            at.velocity, at.reference);
        fwrite(&status, sizeof status, 1, stdout);
    }
    return 0;
}
"""
SUPERVISED = """#include "paper.h"
#include <stdio.h>
int main(void) {
    paper_settings settings = paper_settings_initial;
    paper_memory memory = paper_memory_initial;
    paper_signals signals = paper_signals_initial;
    paper_supervision supervision = paper_supervision_initial;
    supervision.state_timeout = supervision.reference_timeout = 5000000;
    static struct {
        int64_t stamp, now, has_reference, request;
        double position[PAPER_POSITION], velocity[PAPER_VELOCITY], reference[PAPER_REFERENCE];
    } at;
    while (fread(&at, sizeof at, 1, stdin) == 1) {
        supervision.request = at.request;
        int64_t status[2] = {paper_supervised_tick(
            &supervision, &paper_memory_initial, &settings, &memory, &signals, at.stamp, at.now,
            at.position, at.velocity, at.reference, at.has_reference)};
        status[1] = supervision.mode;
        fwrite(status, sizeof status, 1, stdout);
        fwrite(signals.torque, sizeof signals.torque, 1, stdout);
    }
    return 0;
}
"""
SANITIZERS = '-g -O1 -Wall -Werror -Wno-unused-const-variable -fsanitize=address,undefined'


def program_in_c(folder: Path, source: str, given: bytes) -> bytes:
    """Return the output of a program with a library, under sanitizers."""
    (folder / 'probe.c').write_text(source, encoding='utf-8')
    subprocess.run(
        ['cc', *SANITIZERS.split(), '-fno-sanitize-recover=all', '-o', 'probe', 'probe.c',
         f'{HOST}/libpaper.a', '-lm'], cwd=folder, check=True,
    )  # fmt: skip
    run = subprocess.run(['./probe'], cwd=folder, input=given, capture_output=True, check=False)
    assert run.returncode == 0, run.stderr.decode()
    return run.stdout


def statuses_in_c(folder: Path, cases: list[tuple[np.ndarray, ...]]) -> list[int]:
    """Return the status of a tick with each tuple of records and inputs."""
    given = b''.join(array.tobytes() for case in cases for array in case)
    return np.frombuffer(program_in_c(folder, PROBE, given), np.int64).tolist()


def supervised_here(values: Mapping[str, Values], ticks: int) -> tuple[bytes, bytes]:
    """
    Return inputs of supervised ticks, and their statuses, modes and torques in plain Python.

    States and references are missing for a while, and requests stop and enable the controller.
    """
    requests = {ticks // 2: STOP, ticks * 5 // 8: ENABLE}
    simulation = Simulation(values)
    controller, plant = simulation.controller, simulation.plant
    controller.reset()
    initial, record = controller.memory.copy(), supervision_record(controller, 0.005)
    record['reference_timeout'] = record['state_timeout']
    robot, signals = (plant.settings, plant.memory, plant.delayed), plant.signals
    records = controller.settings, controller.memory
    plant_start(*robot, signals)
    inputs = outputs = b''
    for k, reference in enumerate(simulation.trajectory.sample(0, ticks)):
        is_lost, has_reference = ticks // 8 <= k < ticks // 4, not ticks // 4 <= k < ticks * 3 // 8
        stamp = 10**6 * (ticks // 8 if is_lost else k)
        state = signals['position'].ravel().copy(), signals['velocity'].ravel().copy()
        record['request'] = request = requests.get(k, 0)
        numbers = np.array([stamp, 10**6 * k, has_reference, request])
        inputs += b''.join(array.tobytes() for array in (numbers, *state, reference))
        status = supervision_start(
            record, initial, *records, stamp, 10**6 * k, *state, reference, int(has_reference)
        )
        if status == 1:
            followed = record['followed'].ravel().copy()
            status = control_tick(*records, signals, *state, followed)
        status = supervision_end(record, *records, signals, status)
        outputs += np.array([status, record['mode'][0, 0]]).tobytes() + signals['torque'].tobytes()
        plant_tick(*robot, k, signals)
    return inputs, outputs


def damaged_cases(simulation: Simulation, count: int) -> list[tuple[np.ndarray, ...]]:
    """Return records and inputs of a tick; numbers are NaN, infinite, huge, tiny or 0."""
    random, controller = np.random.default_rng(5), simulation.controller
    plant, signals = simulation.plant, simulation.plant.signals
    plant_start(plant.settings, plant.memory, plant.delayed, signals)
    reference = simulation.trajectory.sample(0, 1)[0]
    start = (
        controller.settings, controller.memory, signals,
        signals['position'].ravel(), signals['velocity'].ravel(), reference,
    )  # fmt: skip
    cases = []
    for k in range(count):
        case = tuple(array.copy() for array in start)
        for _ in range(k % 4):
            array = case[random.integers(len(case))]
            names = [name for name in array.dtype.names or () if array.dtype[name].base == 'f8']
            numbers = array[str(random.choice(names))] if names else array
            place = random.integers(numbers.size)
            numbers.reshape(-1)[place] = random.choice([np.nan, np.inf, -1e308, 1e-310, 0.0])
        cases.append(case)
    return cases


@pytest.fixture(scope='module')
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a library of the paper's robot."""
    folder = tmp_path_factory.mktemp('exported')
    library(folder, *SETTINGS)
    return folder


@needs_compiler
def test_library_in_c_has_the_bits_of_simulate(exported: Path) -> None:
    assert bits_in_c(exported, HOST, 'cc') == bits_here(*SETTINGS)
    header = exported / 'paper.h'
    subprocess.run(['cc', '-x', 'c++', '-std=c++17', '-fsyntax-only', str(header)], check=True)
    described = json.loads((exported / 'paper.json').read_text('utf-8'))
    assert described['records']['settings']['fields']['k_s1']['shape'] == [4]
    assert described['parameters']['k_s1']['minimum'] == 0.0


@needs_compiler
def test_damaged_records_have_the_status_of_python(exported: Path) -> None:
    simulation = Simulation(load_scenario(str(PAPER), SETTINGS))
    simulation.controller.reset()
    cases = damaged_cases(simulation, 400)
    in_c = statuses_in_c(exported, cases)
    assert in_c == [control_tick(*case) for case in cases]
    assert {0, NOT_FINITE} <= set(in_c)


@needs_compiler
@pytest.mark.slow
def test_library_of_urdf_robot_has_the_bits_of_python(tmp_path: Path) -> None:
    scenario = write_scenario(tmp_path, hand_at_start(), 0.2)
    values = load_scenario(str(scenario))
    targets = {HOST: TARGETS[HOST]}
    write_library(tmp_path, 'paper', values, targets, overwrite=False)
    # Entries share the functions that they call; with a copy for each, it has 750 kB.
    assert next(tmp_path.rglob('libpaper.a')).stat().st_size < 500_000
    in_c = bits_in_c(tmp_path, HOST, 'cc')
    with interpreted(), np.errstate(all='ignore'):
        assert in_c == bits_of_ticks(values)
        simulation = Simulation(values)
        simulation.controller.reset()
        cases = damaged_cases(simulation, 100)
        copies = [tuple(array.copy() for array in case) for case in cases]
        in_python = [control_tick(*case) for case in copies]
        given, expected = supervised_here(values, 160)
    assert statuses_in_c(tmp_path, cases) == in_python
    assert program_in_c(tmp_path, SUPERVISED, given) == expected
    for k, case in enumerate(cases):
        case[k % 3][LAYOUT][0, 5] += 8
    assert set(statuses_in_c(tmp_path, cases)) == {NOT_FINITE | OTHER_RECORDS}


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize('target', COMMANDS)
def test_library_with_all_effects_has_the_bits_of_simulate(tmp_path: Path, target: str) -> None:
    compiler, *runner = COMMANDS[target]
    for program in (compiler.split()[0], *runner):
        if shutil.which(program) is None:
            pytest.skip(f'needs {program}')
    settings = 'duration=2.0', *EFFECTS
    library(tmp_path, *settings, targets=(target,), supervised=True)
    assert bits_in_c(tmp_path, target, compiler, *runner) == bits_here(*settings)


@pytest.mark.slow
def test_library_on_microcontroller_has_the_bits_of_simulate(tmp_path: Path) -> None:
    for program in (f'{MICROCONTROLLER_TOOLS}-gcc', EMULATOR[0]):
        if shutil.which(program) is None:
            pytest.skip(f'needs {program}')
    settings = 'duration=0.5', 'controller.switching=tanh'
    library(tmp_path, *settings, targets=(MICROCONTROLLER,))
    subprocess.run(
        [f'{MICROCONTROLLER_TOOLS}-gcc', *MICROCONTROLLER_FLAGS, '-Wl,--gc-sections',
         f'-I{tmp_path}', '-T', SOURCES / 'memory.ld', '-o', 'run.elf', SOURCES / 'run.c',
         f'{MICROCONTROLLER}/libpaper.a', '-lm'], cwd=tmp_path, check=True,
    )  # fmt: skip
    run = subprocess.run(
        [*EMULATOR, 'run.elf'], cwd=tmp_path, check=True, capture_output=True, timeout=60,
        text=True,
    )  # fmt: skip
    assert (tmp_path / 'signals.bin').read_bytes() == bits_here(*settings)
    assert 500 < int(run.stdout.split()[0]) < 2000, run.stdout  # as docs/guides/native.md states


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize('law', LAWS if 'MASMC_LAWS' in os.environ else list(LAWS)[::3])
def test_library_of_every_law_has_the_bits_of_simulate(tmp_path: Path, law: str) -> None:
    """Every third law; all with the variable MASMC_LAWS, as each compiles for 15 s."""
    settings = 'duration=0.5', f'controller.law={law}', 'controller.switching=tanh'
    library(tmp_path, *settings, targets=tuple(COMMANDS))
    expected = bits_here(*settings)
    for target, commands in COMMANDS.items():
        if all(shutil.which(command.split()[0]) for command in commands):
            assert bits_in_c(tmp_path, target, *commands) == expected, target


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
