# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Functions of a library: the kernels of a tick behind plain pointers."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any, NamedTuple

from masmc_ros.aliases import Records
from masmc_ros.jit.compiled import exported_code, ExportedCode
from masmc_ros.jit.generated import Compiler, generated, IrValue, IrValues, Type, Types
from masmc_ros.jit.scratch import array_over
from masmc_ros.jit.sized_records import (
    has_layout,
    LAYOUT,
    SizedRecordsType,
    SizedRecordType,
    type_of,
)
from masmc_ros.loop import closed_loop
from masmc_ros.loop.closed_loop import NOT_FINITE
from masmc_ros.loop.signals import inputs
from masmc_ros.loop.simulation import Simulation
from masmc_ros.loop.supervision import (
    is_supervised,
    supervision_end,
    supervision_record,
    supervision_start,
)
from masmc_ros.messages.stamps import state_timeout
from masmc_ros.plant_model.plant_tick import advance, observe
from masmc_ros.reference.line_sine import line_sine
from masmc_ros.robot.dead_reckoning import odometry
from numba import from_dtype, types
from numba.core import cgutils
from numba.np.arrayobj import get_cfarray_intrinsic

Pointer = Any
"""Address of numbers or of a record in compiled code."""

array_at: Callable[..., Any] = get_cfarray_intrinsic('C', None)
"""Array at an address with a shape, as `numba.carray`, without a function to be compiled."""


class Entry(NamedTuple):
    """A function of a library."""

    code: ExportedCode
    arguments: tuple[str, ...]
    """Types of its arguments in C; the name of a record stands for a pointer to it."""
    description: str
    failure: int
    """Result if the kernel raises an exception, as a full memory does."""
    layouts: tuple[bytes, ...]
    """First bytes that the record of each argument must have; b'' for any."""
    further: tuple[int, ...] = ()
    """Constants that follow the arguments, so several functions share their code."""


FAILED, OTHER_RECORDS = 4, 8
"""
Status flags of functions of a library, always with `NOT_FINITE`.

FAILED: the kernel raised an exception, because its memory was full; OTHER_RECORDS: sizes and
places in a record are not those of the library.
"""

SUPERVISION = ('supervision_start', 'supervision_end')
"""Functions of a library with commanded torques."""

LIBRARY = (
    'control_tick', 'settings_changed', *SUPERVISION, 'odometry', 'plant_start', 'plant_tick',
    'plant_hold',
)  # fmt: skip
"""Functions of a library."""

PLANT = ('plant_start', 'plant_tick', 'sample_line_sine')
"""Functions of a page that all laws share."""


def records_of(simulation: Simulation) -> dict[str, Records]:
    """Return the records of a simulation by their names in C."""
    controller, plant = simulation.controller, simulation.plant
    records = {
        'settings': controller.settings, 'memory': controller.memory, 'signals': plant.signals,
        'plant_settings': plant.settings, 'plant_memory': plant.memory,
    }  # fmt: skip
    if is_supervised(controller.values):
        records['supervision'] = supervision_record(
            controller, state_timeout(controller.values)
        )
    return records


def entries(
    simulation: Simulation,
    names: Collection[str] = LIBRARY,
    on_compilation: Callable[[], None] = lambda: None,
) -> dict[str, Entry]:
    """
    Compile the named functions for the records of a simulation, and return them by name.

    `on_compilation` is called before each one whose code is not on the disk.
    Each returns a whole number: the controller the flags of `closed_loop.control_tick`, `FAILED`
    and `OTHER_RECORDS`; the plant 1 if its state is finite, else 0.
    """
    signals_here = simulation.controller.signals
    # Sizes are arguments, so one code serves robots from URDF files of all sizes.
    sizes = tuple(len(values) for values in inputs(signals_here))
    desired = sizes[2:]
    line = simulation.plant.delayed.shape
    # Flags are whole numbers: other bits of a register with a bool of Numba are not defined.
    number, vector = types.int64, types.CPointer(types.float64)
    records = records_of(simulation)
    kinds = {
        'int64_t': number, 'double': types.float64, 'const double *': vector, 'double *': vector,
        **dict.fromkeys(('int64_t stamp', 'int64_t now', 'int64_t has_reference'), number),
        'int64_t status': number,
        **dict.fromkeys(('const double *before', 'double *position', 'double *velocity'), vector),
        **{name: _pointer(record) for name, record in records.items()},
        'const memory': _pointer(records['memory']),
    }  # fmt: skip
    layouts = {
        name: record[LAYOUT][0].tobytes()
        for name, record in records.items() if has_layout(record.dtype)
    }  # fmt: skip
    tick, changed, start = (
        closed_loop.control_tick, closed_loop.post_update, closed_loop.plant_start
    )  # fmt: skip
    found: dict[str, Entry] = {}

    def exported(
        name: str, text: str, *arguments: str, further: tuple[int, ...] = ()
    ) -> Callable[[Callable[..., int]], None]:
        def decorate(function: Callable[..., int]) -> None:
            if name not in names or not set(arguments) <= kinds.keys():
                return
            signature = number(
                *(kinds[argument] for argument in arguments), *(number for _ in further)
            )
            code = exported_code(function, signature, on_compilation=on_compilation)
            failure = 0 if name.startswith('plant') else NOT_FINITE | FAILED
            found[name] = Entry(
                code, arguments, text, failure,
                tuple(layouts.get(argument.removeprefix('const '), b'') for argument in arguments),
                further,
            )  # fmt: skip

        return decorate

    @exported(
        'control_tick', 'Compute a tick; the torque is in the signals.',
        'settings', 'memory', 'signals', *('const double *',) * 3, further=sizes,
    )  # fmt: skip
    def control(
        settings: Pointer,
        memory: Pointer,
        signals: Pointer,
        position: Pointer,
        velocity: Pointer,
        reference: Pointer,
        positions: int,
        velocities: int,
        desired: int,
    ) -> int:
        return tick(
            records_at(settings), records_at(memory), records_at(signals),
            array_at(position, positions), array_at(velocity, velocities),
            array_at(reference, desired),
        )  # fmt: skip

    @exported(
        'settings_changed',
        'Restrict the estimates to their range; to be called after writing settings.',
        'settings', 'memory',
    )  # fmt: skip
    def after_change(settings: Pointer, memory: Pointer) -> int:
        changed(records_at(settings), records_at(memory))
        return 0

    @exported(
        'supervision_start',
        'First part of a supervised tick; 1 if the law is to be computed, see supervised_tick.',
        'supervision', 'const memory', 'settings', 'memory', 'int64_t stamp', 'int64_t now',
        *('const double *',) * 3, 'int64_t has_reference', further=sizes,
    )  # fmt: skip
    def before_control(
        supervision: Pointer,
        initial: Pointer,
        settings: Pointer,
        memory: Pointer,
        stamp: int,
        now: int,
        position: Pointer,
        velocity: Pointer,
        reference: Pointer,
        has_reference: int,
        positions: int,
        velocities: int,
        desired: int,
    ) -> int:
        return supervision_start(
            records_at(supervision), records_at(initial), records_at(settings), records_at(memory),
            stamp, now, array_at(position, positions), array_at(velocity, velocities),
            array_at(reference, desired), has_reference,
        )  # fmt: skip

    @exported(
        'supervision_end', 'Last part of a supervised tick, with the status of control_tick.',
        'supervision', 'settings', 'memory', 'signals', 'int64_t status',
    )  # fmt: skip
    def after_control(
        supervision: Pointer, settings: Pointer, memory: Pointer, signals: Pointer, status: int
    ) -> int:
        return supervision_end(
            records_at(supervision), records_at(settings), records_at(memory), records_at(signals),
            status,
        )  # fmt: skip

    @exported(
        'odometry',
        'Write the pose of the base and its derivative before the measured joints, by the wheels.',
        'settings', 'signals', 'const double *before', 'double *position', 'double *velocity',
        further=sizes[:1],
    )  # fmt: skip
    def base_pose(
        settings: Pointer,
        signals: Pointer,
        before: Pointer,
        position: Pointer,
        velocity: Pointer,
        positions: int,
    ) -> int:
        return odometry(
            records_at(settings), records_at(signals), array_at(before, positions),
            array_at(position, positions), array_at(velocity, positions),
        )  # fmt: skip

    @exported(
        'plant_start', 'Write the state of tick 0 into the signals.',
        'plant_settings', 'plant_memory', 'double *', 'signals', further=line,
    )  # fmt: skip
    def initial_plant(
        settings: Pointer,
        memory: Pointer,
        delay_line: Pointer,
        signals: Pointer,
        rows: int,
        width: int,
        lanes: int,
    ) -> int:
        return int(start(
            records_at(settings), records_at(memory), array_at(delay_line, (rows, width, lanes)),
            records_at(signals),
        ))

    @exported(
        'sample_line_sine', 'Write the reference of a tick on a path line_sine.',
        'const double *', 'double', 'int64_t', 'double *', further=desired,
    )  # fmt: skip
    def on_line(
        table: Pointer, period: float, tick: int, reference: Pointer, desired: int
    ) -> int:
        axes = desired // 3
        rows, out = array_at(table, (5, axes)), array_at(reference, desired)
        for i in range(axes):
            out[i], out[axes + i], out[2 * axes + i] = line_sine(
                float(tick) * period, rows[0, i], rows[1, i], rows[2, i], rows[3, i], rows[4, i]
            )
        return 0

    def plant(
        settings: Pointer,
        memory: Pointer,
        delay_line: Pointer,
        tick: int,
        signals: Pointer,
        rows: int,
        width: int,
        lanes: int,
        hold: int,
    ) -> int:
        robot, state, row = (
            records_at(settings)[0], records_at(memory)[0], records_at(signals)[0]
        )  # fmt: skip
        delayed = array_at(delay_line, (rows, width, lanes))
        advance(robot, state, delayed, tick, row, hold != 0)
        observe(robot, state, delayed, tick + 1, row)
        return int(closed_loop.is_finite(row))

    for name, hold, text in (
        ('plant_tick', 0,
         'Advance the simulated robot from a tick to the next under the command in the signals.'),
        ('plant_hold', 1,
         'Advance the simulated robot by a tick without a command: its drives hold the joints.'),
    ):  # fmt: skip
        exported(
            name, text, 'plant_settings', 'plant_memory', 'double *', 'int64_t', 'signals',
            further=(*line, hold),
        )(plant)  # fmt: skip
    return found


def _pointer(record: Records) -> types.Type:
    kind = type_of(record)
    if isinstance(kind, SizedRecordsType):
        return types.CPointer(SizedRecordType(kind.schema))
    return types.CPointer(from_dtype(record.dtype))


def records_at(place: Pointer) -> Records:
    """Return the array of the one record at an address, in compiled code."""
    raise NotImplementedError  # only compiled code has addresses


def _type_of_records(context: Type, place: Type) -> types.Type:
    kind = place.dtype
    if isinstance(kind, SizedRecordType):
        return SizedRecordsType(kind.schema)
    return types.Array(kind, 1, 'C')


@generated(records_at, _type_of_records)
def _records_at(compiler: Compiler, kinds: Types, values: IrValues) -> IrValue:
    one, step = (compiler.context.get_constant(types.intp, number) for number in (1, 0))
    if isinstance(compiler.result, SizedRecordsType):
        data = compiler.builder.bitcast(values[0], cgutils.voidptr_t)
        return cgutils.pack_struct(compiler.builder, [data, one, step])
    return array_over(compiler, compiler.result, values[0], [one])
