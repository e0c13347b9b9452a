# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Code of runs on a GPU, one run in each thread: closed loops, and robots driven from outside.

The functions of a tick are those of all other runs. They are not inlined, so registers of one
function are free in the next one. The records of a run are copied into local memory before the
first tick of a launch, and back after its last one. In the memory of the card, words of equal
place in all records are neighbours, so threads read and write neighbouring words.

The same code for this processor computes a run of each call, for machines without a GPU.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
import re
from typing import Any

import llvmlite.binding as llvm
from masmc_ros.aliases import Records
from masmc_ros.errors import InputError
from masmc_ros.jit.compiled import exported_code
from masmc_ros.jit.record import places_of
from masmc_ros.loop import closed_loop
from masmc_ros.loop.control import control
from masmc_ros.loop.reduction import reduce_tick
from masmc_ros.native.entries import Entry
from masmc_ros.native.object_code import merged, optimised
from masmc_ros.native.targets import KERNEL, Target, THREAD
from masmc_ros.native.template import filled
from masmc_ros.plant_model.plant_tick import advance, observe, write_velocity
from numba import carray, from_dtype, types

Pointer = Any
"""Address of numbers or of a record in compiled code."""

CONSTANT = 2
"""Number of records, the first ones, that ticks only read."""

_REJECTED = re.compile(
    r'\bfma\.|\bmad\.rn|\b(?:add|sub|mul|div|sqrt)\.(?:f64|approx|full)|\.extern .*'
)


def thread_code(records: Mapping[str, Records], desired: int) -> str:
    """
    Return the intermediate code of a thread.

    Parameters
    ----------
    records
        Records of one lane by name: `settings`, `plant_settings`, `memory`, `plant_memory`,
        `signals` and `reduced` of a closed loop. For a robot whose torques are in `signals`:
        `nominal`, `plant_settings`, `tracked`, and the last three.
    desired
        Number of values of the reference of a tick.

    Raises
    ------
    InputError
        If the law needs memory of the system or Python, see `object_code.check`.

    """
    functions = _functions(records, desired)
    module = llvm.parse_assembly(merged(functions))
    for name in functions:
        function = module.get_function(name)
        function.linkage = 'internal'
        function.add_function_attribute('noinline')
    places, total = places_of(records)
    fields = records['reduced'].dtype.fields
    assert fields is not None
    thread = {
        'thread': THREAD, 'total': total, 'desired': desired, 'places': places,
        'constant': [*places.values()][CONSTANT], 'is_controlled': 'settings' in records,
        'lost': places['reduced'] + fields['lost_tick'][1] // 8,
    }  # fmt: skip
    return str(module) + filled('gpu_thread.ll.jinja', thread)


def ptx(code: str, capability: tuple[int, ...]) -> str:
    """
    Return the code of a thread for a card, as text that its driver assembles.

    Parameters
    ----------
    code
        Intermediate code by `thread_code`.
    capability
        Compute capability of the card, such as (9, 0).

    Raises
    ------
    InputError
        If the code contains a fused or inexact operation, or needs a further function.

    """
    target = Target('nvptx64-nvidia-cuda', 'sm_{}{}'.format(*capability))
    text = code.replace(f'define void @{THREAD}', f'define internal void @{THREAD}')
    text += filled('gpu_kernel.ll.jinja', {'kernel': KERNEL, 'thread': THREAD})
    machine = llvm.Target.from_triple(target.triple).create_target_machine(
        cpu=target.processor, opt=3
    )
    module = optimised(text, target)
    for number, function in enumerate(module.functions):
        if function.linkage == llvm.Linkage.internal:
            function.name = f'part{number}'  # Numba's names have kilobytes
    assembly: str = machine.emit_assembly(module)
    check_ptx(assembly)
    return assembly


def check_ptx(text: str) -> None:
    """Raise InputError for a fused or inexact operation, or a symbol of another file."""
    if found := _REJECTED.search(text):
        raise InputError(
            f"code for the GPU contains '{found.group()}'; expected operations with the rounding "
            'of IEEE 754, and no further symbols'
        )


def _functions(records: Mapping[str, Records], desired: int) -> dict[str, Entry]:
    """Compile the functions of a tick for records of one lane."""
    joints = len(records['signals']['torque'][0])
    width = 2 * (len(records['signals']['position'][0]) + joints)
    points = len(records['reduced']['square'][0])

    def control_of_tick(
        settings: Pointer, memory: Pointer, signals: Pointer, reference: Pointer, tick: int
    ) -> int:
        if tick == 0:
            closed_loop.post_update(carray(settings, 1), carray(memory, 1))
        row = carray(signals, 1)[0]
        closed_loop.write_reference(row, carray(reference, desired))
        control(carray(settings, 1)[0], carray(memory, 1)[0], row)
        return 0

    def reduction_of_tick(
        reduced: Pointer, signals: Pointer, axes: Pointer, settling: Pointer, tick: int,
        start: int, end: int,
    ) -> int:  # fmt: skip
        reduce_tick(
            carray(reduced, 1)[0], carray(signals, 1)[0], carray(axes, (points, 2)),
            carray(settling, 2), tick, start, end,
        )  # fmt: skip
        return 0

    def plant_of_tick(
        plant: Pointer, state: Pointer, delayed: Pointer, rows: int, lanes: int, lane: int,
        tick: int, signals: Pointer,
    ) -> int:  # fmt: skip
        own = carray(delayed, (rows, width, lanes))[:, :, lane:lane + 1]
        robot, memory, row = carray(plant, 1)[0], carray(state, 1)[0], carray(signals, 1)[0]
        # The state before tick 0 is the initial one.
        if tick < 0:
            write_velocity(robot, memory)
        else:
            advance(robot, memory, own, tick, row, False)
        observe(robot, memory, own, tick + 1, row)
        return 0

    def tracking_of_tick(
        plant: Pointer, nominal: Pointer, signals: Pointer, reference: Pointer, tracked: Pointer
    ) -> int:
        closed_loop.track_reference(
            carray(plant, 1), carray(nominal, 1), carray(signals, 1), carray(reference, desired),
            carray(tracked, 1),
        )  # fmt: skip
        return 0

    record = {name: types.CPointer(from_dtype(one.dtype)) for name, one in records.items()}
    plant, signals, reduced = (record[name] for name in ('plant_settings', 'signals', 'reduced'))
    number, vector = types.int64, types.CPointer(types.float64)
    kinds: dict[Callable[..., int], tuple[Any, ...]] = {
        reduction_of_tick: (reduced, signals, types.CPointer(number), vector, *[number] * 3),
        plant_of_tick: (plant, record['plant_memory'], vector, *[number] * 4, signals),
    }
    if 'settings' in record:
        kinds[control_of_tick] = record['settings'], record['memory'], signals, vector, number
    else:
        kinds[tracking_of_tick] = plant, record['nominal'], signals, vector, record['tracked']
    codes = {
        function.__name__: exported_code(function, number(*arguments), points, desired, width)
        for function, arguments in kinds.items()
    }
    return {name: Entry(code, (), '', 0, ()) for name, code in codes.items()}
