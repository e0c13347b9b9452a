# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Campaigns and environments by the code of a GPU: bits, batches, resume and errors on a stand-in.

The stand-in executes the same code. `ptxas` of NVIDIA assembles it for cards.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import pickle
import re
import shutil
import subprocess
import sys
from typing import Any

from helpers.campaigns import assert_equal, campaign_with, PAPER, SETTINGS
from helpers.small_tree import hand_at_start, write_scenario
from masmc_ros.api.learning import MobileManipulators
from masmc_ros.campaign.campaign import campaign_of
from masmc_ros.campaign.dataset import arrays, Dataset
from masmc_ros.campaign.engine import carry_out
from masmc_ros.campaign.runs import evaluated, rows, StoppedError
from masmc_ros.campaign.variable import draw
from masmc_ros.cli.main import main
from masmc_ros.errors import InputError
from masmc_ros.loop.driven_robots import DrivenRobots
from masmc_ros.native.accelerator import named, StandIn
from masmc_ros.native.device import Device, device_option, DeviceRobots
from masmc_ros.native.gpu_code import check_ptx, ptx
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest

EFFECTS = (
    'plant.encoder_resolution=0.0001', 'plant.measurement_delay=0.002',
    'plant.command_delay=0.001', 'plant.delay_jitter=0.5', 'plant.measurement_loss=0.05',
    'plant.command_loss=0.05',
)  # fmt: skip
CAPABILITIES = (8, 0), (9, 0)


class Recorded(StandIn):
    """Stand-in that keeps the code it loads, and the numbers of runs of its launches."""

    def __init__(self, memory: int = 2**30) -> None:
        super().__init__(memory)
        self.codes: list[str] = []
        self.launches: list[int] = []

    def load(self, code: str) -> Callable[..., None]:
        self.codes.append(code)
        function = super().load(code)

        def launch(lanes: int, *arguments: int) -> None:
            self.launches.append(lanes)
            function(lanes, *arguments)

        return launch


@pytest.fixture(scope='module')
def stand_in() -> Recorded:
    """Return a stand-in that has computed the runs of `campaign_with`."""
    stand_in = Recorded()
    rows(campaign_with(), 0, 1, device=Device(stand_in))
    return stand_in


def with_memory(stand_in: Recorded, memory: int) -> Recorded:
    """Return a stand-in with less memory and the same functions."""
    other = Recorded(memory)
    other.functions = stand_in.functions
    return other


@pytest.mark.slow
def test_rows_of_device_equal_rows_of_processor(stand_in: Recorded) -> None:
    """Also with diverging runs: a gain is drawn up to a value that is not stable."""
    for settings in ((), EFFECTS):
        campaign = campaign_with(12, *settings)
        result = rows(campaign, 0, 12, device=Device(stand_in))
        assert_equal(result, rows(campaign, 0, 12))
    assert 0 < result['lost'].sum() < 12
    assert len(stand_in.codes) == 1


@pytest.mark.slow
def test_batch_beyond_memory_is_divided(stand_in: Recorded) -> None:
    campaign = campaign_with(10)
    whole = rows(campaign, 0, 10, device=Device(stand_in))
    stand_in.launches.clear()
    small = with_memory(stand_in, 40_000)
    assert_equal(rows(campaign, 0, 10, device=Device(small)), whole)
    assert max(stand_in.launches) < 10
    assert sum(stand_in.launches) == 10
    assert small.free_memory() == 40_000
    with pytest.raises(InputError, match='device stand-in: its memory does not suffice for one'):
        rows(campaign, 0, 10, device=Device(with_memory(stand_in, 1000)))


@pytest.mark.slow
def test_device_stops_and_continues_a_campaign(stand_in: Recorded, tmp_path: Path) -> None:
    campaign, device = campaign_with(10), Device(stand_in)
    with pytest.raises(StoppedError):
        evaluated(list(campaign.runs(0, 10)), 1, lambda: True, device)
    expected = rows(campaign, 0, 10)
    Dataset(tmp_path, campaign).write(rows(campaign, 2, 3))
    stand_in.launches.clear()
    dataset = carry_out(campaign, tmp_path, device=lambda: device)
    assert sorted(stand_in.launches) == [2, 5]
    assert_equal(arrays(dataset.table()), expected)


@pytest.mark.slow
def test_invalid_run_on_device_is_named(stand_in: Recorded) -> None:
    draws = [draw('robot.link_2_length=uniform:0.01:0.9')]
    campaign = campaign_of(PAPER, SETTINGS, draws=draws, repeats=8)
    with pytest.raises(InputError, match=r'^run [0-7]: .* outside its reach'):
        rows(campaign, 0, 8, device=Device(stand_in))


@pytest.mark.slow
def test_code_of_laws_assembles_without_fused_operations(
    stand_in: Recorded, tmp_path: Path
) -> None:
    if shutil.which('ptxas') is None:
        pytest.skip('needs ptxas')
    rows(campaign_with(1, 'controller.law=pid'), 0, 1, device=Device(stand_in))
    for code, capabilities in zip(stand_in.codes, (CAPABILITIES, CAPABILITIES[:1]), strict=True):
        for capability in capabilities:
            file, version = tmp_path / 'run.ptx', 'sm_{}{}'.format(*capability)
            file.write_text(ptx(code, capability), encoding='utf-8')
            out = tmp_path / f'{version}.cubin'
            command = ['ptxas', '-v', '-Werror', f'-arch={version}', str(file), '-o', str(out)]
            result = subprocess.run(command, capture_output=True, text=True, check=False)
            assert result.returncode == 0, result.stderr
            assert re.search(r"Compiling entry function 'masmc_kernel'", result.stderr)
            assert out.stat().st_size > 0


EPISODES: dict[str, Any] = {
    'scenario': PAPER,
    'draw': {
        'plant.robot.link_2_mass': 'uniform:0.6:1.4', 'robot.link_2_length': 'uniform:0.84:0.9',
        'plant.measurement_delay': 'uniform:0.001:0.006',
    },
    'settings': {
        'plant.velocity_noise': 0.02, 'plant.encoder_resolution': 1e-4,
        'plant.command_delay': 0.003, 'plant.delay_jitter': 0.5, 'plant.measurement_loss': 0.05,
    },
    'duration': 0.04, 'error_limit': 0.7,
}  # fmt: skip


def assert_same(one: object, other: object) -> None:
    """Raise AssertionError for results of environments that differ in a bit."""
    if isinstance(one, dict):
        assert isinstance(other, dict)
        one, other = tuple(one.items()), tuple(other.items())
    if isinstance(one, tuple):
        assert isinstance(other, tuple)
        for parts in zip(one, other, strict=True):
            assert_same(*parts)
    else:
        np.testing.assert_array_equal(one, other)


@pytest.mark.slow
def test_episodes_on_device_equal_those_of_processor() -> None:
    """Robot 1 diverges and starts again; then delays and effects differ, and robot 0 is reset."""
    here, device = (MobileManipulators(3, device=name, **EPISODES) for name in ('cpu', 'stand-in'))
    torques = np.random.default_rng(1).uniform(-5.0, 5.0, (60, 3, 4))
    torques[:15, 1, 3] = 50.0
    assert_same(here.reset(seed=7), device.reset(seed=7))
    lost = truncated = 0
    for tick, torque in enumerate(torques):
        if tick == 12:
            mask = {'reset_mask': np.array([True, False, False])}
            assert_same(here.reset(options=mask), device.reset(options=mask))
        if tick == 30:
            device = pickle.loads(pickle.dumps(device))
        result = here.step(torque)
        assert_same(result, device.step(torque))
        lost, truncated = lost + result[2].sum(), truncated + result[3].sum()
    assert lost >= 1
    assert truncated >= 2


@pytest.mark.slow
def test_driven_robots_on_device_are_those_here() -> None:
    """Robot 1 starts later, with motors that lag, a longer delay and other code."""
    base, lagging = (
        load_scenario(PAPER, effects)
        for effects in ((), ('plant.motor_lag=0.005', 'plant.measurement_delay=0.005'))
    )
    options: dict[str, Any] = {
        'path': np.zeros((90, 12)), 'window': (0, 90), 'settling': np.array([0.1, 0.01])
    }
    device = Device(StandIn(2_000_000))
    with pytest.raises(InputError, match=r'^900 robots: .* has free memory for 284; expected'):
        DeviceRobots(lambda: device, base, 900, **options)
    DeviceRobots(lambda: device, base, 284, **options)
    robots = DrivenRobots(base, 2, **options), DeviceRobots(lambda: device, base, 2, **options)
    for run, moves in ((base, [True, False]), (lagging, [True, True])):
        for one in robots:
            one.start({int(moves[1]): run})
            for torque in np.random.default_rng(2).uniform(-1.0, 1.0, (20, 2, 4)):
                one.step(torque, np.array(moves))
    for record, field in (('signals', 'velocity'), ('tracked', 'true_error')):
        np.testing.assert_array_equal(*(one.values(record, field) for one in robots))
    for name, values in robots[1].reduction().items():
        np.testing.assert_array_equal(values, robots[0].reduction()[name], name)
    assert device.accelerator.free_memory() < 2_000_000
    del one, robots
    assert device.accelerator.free_memory() == 2_000_000


@pytest.mark.parametrize(
    'line',
    [
        'fma.rn.f64 %fd1, %fd2, %fd3, %fd4;',
        'mul.f64 %fd1, %fd2, %fd3;',
        'div.approx.f64 %fd1, %fd2, %fd3;',
        'sqrt.approx.ftz.f32 %f1, %f2;',
        '.extern .func sin',
    ],
)
def test_inexact_operation_of_gpu_code_is_rejected(line: str) -> None:
    check_ptx('mul.rn.f64 %fd1, %fd2, %fd3;\nsqrt.rn.f64 %fd1, %fd2;\nmad.lo.s64 %rd1, %rd2;')
    with pytest.raises(InputError, match='code for the GPU contains'):
        check_ptx(f'add.rn.f64 %fd1, %fd2, %fd3;\n{line}')


def test_missing_device_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, 'cuda.bindings', None)
    options = '--runs', '2', '--draw', 'plant.robot.link_2_mass=uniform:0.6:1.4'
    command = ['monte-carlo', PAPER, *options, '--output', str(tmp_path / 'out')]
    assert main([*command, '--device', 'cuda:1']) == 2
    assert capsys.readouterr().err.splitlines()[-1].endswith(
        "device cuda:1: the package cuda-bindings is missing; pip install 'masmc_ros[gpu]'"
    )
    with pytest.raises(InputError, match=r'^device cuda:0: .* cuda-bindings is missing'):
        MobileManipulators(2, PAPER, device='cuda')
    with pytest.raises(InputError, match="device 'rocm': expected cpu, cuda, cuda:NUMBER"):
        named('rocm')
    assert device_option('cpu') is None


def test_robot_of_urdf_on_device_is_one_line(tmp_path: Path) -> None:
    file = str(write_scenario(tmp_path, hand_at_start(), 1.0))
    draws = [draw('controller.k_s1=uniform:80:120')]
    campaign = campaign_of(file, ['duration=0.1'], draws=draws, repeats=2)
    with pytest.raises(InputError, match=r'robot\.urdf: a GPU has no records of robots'):
        rows(campaign, 0, 2, device=Device(StandIn()))


def test_varying_period_on_device_is_one_line(tmp_path: Path) -> None:
    draws = [draw('control_period=uniform:0.001:0.002')]
    campaign = campaign_of(PAPER, draws=draws, repeats=100)
    with pytest.raises(InputError, match=r'^control_period: .*; or device cpu$'):
        carry_out(campaign, tmp_path, device=device_option('stand-in'))
