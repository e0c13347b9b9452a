# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""One compiled code for robots of all URDFs."""

from __future__ import annotations

from pathlib import Path
import subprocess
import sys

from helpers.child_environment import child_environment
from helpers.small_tree import hand_at_start, URDF, write_scenario
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import Formula, is_interpreted, kernel, subroutine
from masmc_ros.jit.field import Field
from masmc_ros.jit.lanes import lane_of
from masmc_ros.jit.record import AT_RUN_TIME, new_record
from masmc_ros.jit.sized_records import has_sizes_at_run_time
from masmc_ros.jit.tuples import elementwise
from masmc_ros.jit.vectors import check_workspace, free, mark
from masmc_ros.loop.closed_loop import _plant_step, closed_loop
from masmc_ros.loop.dense import tick_input
from masmc_ros.loop.layer_bound import least_task_inertia
from masmc_ros.loop.simulation import Simulation
from masmc_ros.numerics.scalars import plus
from masmc_ros.scenario.scenario import load_scenario
from numba.core import event
from numba.core.runtime import _nrt_python, rtsys
import numpy as np
import pytest

_ARM = """/**:
  ros__parameters:
    robot:
      urdf: {urdf}
      joints: [{joints}]
      task: joints
    control_period: 0.001
    duration: 0.02
trajectory:
  ros__parameters:
    line_sine:
      offset: {zeros}
      amplitude: {zeros}
      frequency: {zeros}
      phase: {zeros}
"""


def _arm(folder: Path, urdf: str, *joints: str) -> Path:
    """Write an arm with a fixed base, whose task are its joints, and return its file."""
    description = folder / f'arm_{len(joints)}.urdf'
    description.write_text(urdf, encoding='utf-8')
    path = description.with_suffix('.yaml')
    zeros = [0.0] * len(joints)
    text = _ARM.format(urdf=description, joints=', '.join(joints), zeros=zeros)
    path.write_text(text, encoding='utf-8')
    return path


def _signals(path: Path, *settings: str) -> np.ndarray:
    parts = list(Simulation(load_scenario(str(path), settings)).run())
    torque = np.concatenate([part.signals['torque'] for part in parts])
    assert np.isfinite(torque).all()
    return torque


@pytest.mark.slow
def test_second_and_third_urdf_compile_nothing(tmp_path: Path) -> None:
    """Robots with other numbers of joints, axes, bodies and wheels run the same compiled code."""
    first = write_scenario(tmp_path, hand_at_start(), 0.02)
    second = _arm(tmp_path, URDF, 'turret_joint', 'upper_joint')
    other = URDF.replace('small', 'other').replace('0.3 0 0', '0.35 0.02 0')
    third = _arm(tmp_path, other, 'turret_joint', 'lift_joint', 'upper_joint', 'hand_joint')
    # Functions for the URDF do not depend on sizes, but some robots do not call them.
    for path in (second, third):
        load_scenario(str(path))
    assert _signals(first).shape[1] == 7
    with event.install_recorder('numba:compile') as compilations:
        assert _signals(second).shape[1] == 2
        assert _signals(third).shape[1] == 4
    compiled = {built.data['dispatcher'].py_func.__qualname__ for _, built in compilations.buffer}
    assert compiled == set()


@pytest.mark.slow
def test_plant_of_all_laws_has_one_compiled_code(tmp_path: Path) -> None:
    path = write_scenario(tmp_path, hand_at_start(), 0.02)
    for law in ('rasmc', 'smc'):
        assert _signals(path, f'controller.law={law}').shape[1] == 7
    if isinstance(_plant_step, Formula):
        overloads = _plant_step._called.overloads
        assert len([kinds for kinds in overloads if has_sizes_at_run_time(kinds[0])]) == 1


@pytest.mark.slow
def test_robot_of_another_size_in_one_process_has_same_bits(tmp_path: Path) -> None:
    """A run is bitwise identical before and after a run of a robot of another size."""
    first = write_scenario(tmp_path, hand_at_start(), 0.02)
    before = _signals(first)
    _signals(_arm(tmp_path, URDF, 'turret_joint', 'upper_joint'))
    assert np.array_equal(_signals(first), before)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(closed_loop, 'overloads'), reason='interpreted code uses the heap')
@pytest.mark.parametrize('settings', [(), ('controller.latency=0.01',)])
def test_ticks_of_a_tree_use_no_memory_from_the_heap(
    tmp_path: Path, settings: tuple[str, ...]
) -> None:
    """Otherwise each use of such an array would count its references."""

    def allocations(duration: float) -> int:
        path = write_scenario(tmp_path, hand_at_start(), duration)
        simulation = Simulation(load_scenario(str(path), settings))
        for _ in simulation.run():
            pass
        before = rtsys.get_allocation_stats().alloc
        for _ in simulation.run():
            pass
        return int(rtsys.get_allocation_stats().alloc - before)

    was_counting = _nrt_python.memsys_stats_enabled()
    _nrt_python.memsys_enable_stats()
    try:
        assert allocations(0.02) == allocations(0.2)
    finally:
        if not was_counting:
            _nrt_python.memsys_disable_stats()


@pytest.mark.slow
def test_law_in_plain_python_on_a_tree_has_dense_matrices(tmp_path: Path) -> None:
    """Kernels write matrices of sizes at run time into arrays of the caller."""
    path = write_scenario(tmp_path, hand_at_start(), 0.02)
    simulation = Simulation(load_scenario(str(path)))
    for _ in simulation.run():
        pass
    controller = simulation.controller
    inputs = tick_input(
        controller.settings,
        controller.signals,
        controller.values,
        controller.estimate,
        controller.torque,
    )
    np.testing.assert_allclose(inputs.jacobian @ inputs.inverse_jacobian, np.eye(6), atol=1e-9)
    np.testing.assert_allclose(inputs.inertia, inputs.inertia.T, atol=1e-9)
    assert np.linalg.eigvalsh(inputs.inertia)[0] > 0.0
    assert inputs.regressor.shape == (7, len(controller.nominal))
    position = controller.signals['position'][0, :, 0]
    geometry = controller.settings['geometry'][0, :, 0]
    nominal = controller.settings['nominal'][0, :, 0]
    least = least_task_inertia(controller.mechanism, nominal, geometry, position)
    assert least == pytest.approx(np.linalg.eigvalsh(inputs.task_inertia)[0], rel=1e-6)


@kernel
def _sum(records: np.ndarray, repetitions: int, keeps: bool) -> float:
    row, total = lane_of(records[0], 0), 0.0
    place = mark(row)
    for _ in range(repetitions):
        if not keeps:
            free(row, place)
        for value in elementwise(plus, row.values, row.values):
            total += value
    check_workspace(row)
    return total


def _records(count: int) -> np.ndarray:
    records = new_record((Field('values', 'count'),), {'count': count, AT_RUN_TIME: 1})
    records['values'][0, :, 0] = np.arange(count)
    return records


@pytest.mark.parametrize('count', [1, 2, 7, 48, 49, 300])
def test_vector_of_any_length_is_summed_by_one_code(count: int) -> None:
    assert _sum(_records(count), 2, True) == 2.0 * count * (count - 1)
    if hasattr(_sum, 'overloads'):
        assert len(_sum.overloads) == 1


@pytest.mark.skipif(not hasattr(_sum, 'overloads'), reason='interpreted code has no workspace')
def test_full_workspace_raises_one_line() -> None:
    records = _records(300)
    _sum(records, 100_000, False)
    with pytest.raises(InputError, match=r'^workspace of \d+ bytes is full: ') as error:
        _sum(records, 100_000, True)
    assert '\n' not in str(error.value)
    # The next call is not affected.
    assert _sum(records, 1, True) == 300.0 * 299.0


@subroutine
def _fill_workspace(record: np.void, repetitions: int) -> None:
    row = lane_of(record, 0)
    for _ in range(repetitions):
        elementwise(plus, row.values, row.values)


@kernel
def _fill(records: np.ndarray, repetitions: int) -> int:
    row = records[0]
    _fill_workspace(row, repetitions)
    check_workspace(row)
    return repetitions


@kernel
def _fill_twice(records: np.ndarray, repetitions: int) -> int:
    return _fill(records, repetitions) + _fill(records, repetitions)


@pytest.mark.skipif(not hasattr(_sum, 'overloads'), reason='interpreted code has no workspace')
def test_full_workspace_in_subroutine_raises() -> None:
    """A subroutine has the workspace of the kernel that calls it."""
    records = _records(300)
    assert _fill(records, 1) == 1
    with pytest.raises(InputError, match=r'^workspace of \d+ bytes is full: '):
        _fill(records, 100_000)


@pytest.mark.skipif(not hasattr(_sum, 'overloads'), reason='nothing is compiled')
def test_missing_subroutine_is_compiled_for_stored_caller(tmp_path: Path) -> None:
    """The stored caller contains a symbol of the first process; the second one has another."""
    code = (
        'from masmc_ros.jit.compiled import is_on_disk, is_whole_on_disk\n'
        'from loop.test_tree_sizes import _fill, _fill_twice, _fill_workspace, _records\n'
        'records = _records(3)\n'
        'print(is_on_disk(_fill, records, 1), is_whole_on_disk(_fill, records, 1))\n'
        'assert _fill(records, 1) == 1 and _fill_twice(records, 2) == 4\n'
        'for code in _fill_workspace._called.overloads.values():\n'
        '    print(code.fndesc.llvm_func_name)\n'
    )

    def printed() -> list[str]:
        result = subprocess.run(
            [sys.executable, '-c', code], env={**child_environment(), 'XDG_CACHE_HOME': folder},
            capture_output=True, text=True, check=True, timeout=300.0,
            cwd=Path(__file__).parents[1],
        )  # fmt: skip
        return result.stdout.splitlines()

    folder = str(tmp_path)
    known, symbol = printed()
    assert known == 'False False'
    for file in tmp_path.rglob('*._fill_workspace-*.nbc'):
        file.unlink()
    known, other = printed()
    assert known == 'True False'
    assert other != symbol
    assert printed() == ['True True', other]


@pytest.mark.skipif(is_interpreted(), reason='nothing is compiled')
def test_record_of_another_type_raises() -> None:
    """Compiled code is not used for a record with other fields."""
    code = (
        'from masmc_ros.jit.compiled import bound\n'
        'from masmc_ros.jit.field import Field\n'
        'from masmc_ros.jit.record import AT_RUN_TIME, new_record\n'
        'from loop.test_tree_sizes import _records, _sum\n'
        'run = bound(_sum, _records(3), 1, True)\n'
        "other = new_record((Field('others', 'n'),), {'n': 3, AT_RUN_TIME: 1})\n"
        'try:\n'
        '    run(other, 1, True)\n'
        'except TypeError as error:\n'
        '    print(error)\n'
    )
    result = subprocess.run(
        [sys.executable, '-c', code], env=child_environment(), capture_output=True, text=True,
        check=True, timeout=300.0, cwd=Path(__file__).parents[1],
    )  # fmt: skip
    assert 'record of another type' in result.stdout
