# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Generated controllers of ros2_control: bits, faults, and neither memory nor locks in update."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import shutil
import subprocess
from typing import NamedTuple
from xml.etree import ElementTree

from benchmarks.ros2_control_jitter import built, DURATION, PAPER
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import interpreted
from masmc_ros.loop.simulation import Simulation
from masmc_ros.native.library import write_library
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest
import yaml

EVENTS = """\
active
start: torque
valid: set
negative: k_s1 = -1.000000: expected >= 0
gain: torque
lost for 50 ms: torque
fault: no states
lost for 150 ms: void
lost for 350 ms: void
active
states again: torque
fault: emergency stop
stop: torque
inactive
clear: torque
active
enable: torque
~/reference: 2 numbers; expected 4 or 12 finite ones
deactivated: 0
0 allocations, 0 locks
"""
"""Report of the harness; the gravity torque of a robot in a plane is zero."""

needs_compiler = pytest.mark.skipif(shutil.which('c++') is None, reason='needs a C compiler')


class Harness(NamedTuple):
    """Generated package, and the program that runs its controller."""

    package: Path
    program: Path

    def run(self, *arguments: str) -> subprocess.CompletedProcess[bytes]:
        mode, *more = arguments
        path = self.package / 'path' / 'reference.bin'
        return subprocess.run(
            [self.program, mode, path, *more], check=True, capture_output=True, timeout=60
        )


@pytest.fixture(scope='module')
def harness(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Harness]:
    folder = tmp_path_factory.mktemp('library')
    yield Harness(folder / 'paper_controller', built(folder))
    shutil.rmtree(folder)


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize(('speed', 'approaches'), [('0.0', 'false'), ('0.25', 'true')])
def test_controller_torques_are_those_of_simulate(
    harness: Harness, speed: str, approaches: str
) -> None:
    run = harness.run('run', speed)
    settings = DURATION, f'controller.approach_on_start={approaches}'
    (block,) = Simulation(load_scenario(PAPER, settings)).run()
    assert run.stdout == block.torque.tobytes()
    assert run.stderr.splitlines()[-1] == b'0 allocations, 0 locks'


@needs_compiler
@pytest.mark.slow
def test_controller_knows_its_pose_by_wheels(harness: Harness) -> None:
    run, by_wheels = harness.run('run', '0.0'), harness.run('run', '0.0', 'wheels')
    assert by_wheels.stderr.splitlines()[-1] == b'0 allocations, 0 locks'
    torques = [np.frombuffer(output.stdout) for output in (run, by_wheels)]
    assert np.abs(torques[1] - torques[0]).max() < 1e-5


@needs_compiler
@pytest.mark.slow
def test_controller_holds_after_faults_and_recovers(harness: Harness) -> None:
    assert harness.run('events').stderr.decode() == EVENTS


@needs_compiler
@pytest.mark.slow
def test_package_files_agree_in_names_and_parameters(harness: Harness) -> None:
    package = harness.package
    plugin = ElementTree.parse(package / 'plugin.xml').getroot()
    manifest = ElementTree.parse(package / 'package.xml').getroot()
    text = (package / 'config' / 'controller.yaml').read_text('utf-8')
    parameters = yaml.safe_load(text)
    kind = parameters['controller_manager']['ros__parameters']['paper_controller']['type']
    assert plugin[0].get('name') == kind
    assert plugin.get('path') == manifest.findtext('name') == package.name
    values = load_scenario(PAPER)['controller']
    given = parameters['paper_controller']['ros__parameters']
    gains = given.keys() & values.keys()
    assert {'k_s1', 'gamma', 'projection.lower', 'torque_limit', 'fault_action'} <= gains
    for name in gains:
        value = given[name]
        assert (tuple(value) if isinstance(value, list) else value) == values[name]
    depends = {element.text for element in manifest.iter('depend')}
    assert depends <= set((package / 'CMakeLists.txt').read_text('utf-8').split())


def test_controller_of_velocities_is_one_line(tmp_path: Path) -> None:
    values = load_scenario(
        PAPER, ('controller.command_interface=velocity', 'plant.command_interface=velocity')
    )
    with pytest.raises(InputError, match='velocity: expected effort'):
        write_library(
            tmp_path / 'new', 'paper', values, {}, overwrite=False, ros2_control=True
        )
    assert not (tmp_path / 'new').exists()


@needs_compiler
@pytest.mark.slow
def test_controller_of_ur5_has_the_torques_of_python(tmp_path: Path) -> None:
    scenario = Path(PAPER).with_name('ur5.yaml')
    harness = Harness(tmp_path / 'paper_controller', built(tmp_path, str(scenario)))
    run = harness.run('run', '0.0')
    with interpreted(), np.errstate(all='ignore'):
        (block,) = Simulation(load_scenario(str(scenario), ('duration=0.05',))).run()
    expected = block.torque.tobytes()
    assert run.stdout[:len(expected)] == expected
    assert run.stderr.splitlines()[-1] == b'0 allocations, 0 locks'
    # The pose of a fixed base has no interface.
    text = (harness.package / 'config' / 'controller.yaml').read_text('utf-8')
    parameters = yaml.safe_load(text)['paper_controller']['ros__parameters']
    assert len(parameters['position_interfaces']) == len(parameters['effort_interfaces']) == 6
