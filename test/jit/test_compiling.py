# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Compilation: bound and called functions, garbage collection, copies of records."""

from __future__ import annotations

from collections.abc import Iterator
import gc
import time
from typing import Any, cast

from masmc_ros.aliases import Records
from masmc_ros.jit.compiled import (
    bound,
    code_file,
    formula,
    is_interpreted,
    is_loaded,
    kernel,
    large_part,
    subroutine,
)
from masmc_ros.jit.field import Field
from masmc_ros.jit.inlined_code import CalledCompiler
from masmc_ros.jit.lanes import lane_of, shared
from masmc_ros.jit.record import copied, copy_to, lane_count, new_record
from masmc_ros.jit.shared_records import shared_record
from masmc_ros.jit.sized_records import SHARED
from masmc_ros.jit.vectors import VectorType
import numba
from numba.core import event
import pytest


class Thresholds(event.Listener):
    """Records the thresholds at the start of every compilation."""

    def __init__(self) -> None:
        self.recorded: list[tuple[int, int, int]] = []

    def on_start(self, event: event.Event) -> None:
        self.recorded.append(gc.get_threshold())

    def on_end(self, event: event.Event) -> None:
        pass


@pytest.fixture
def thresholds() -> Iterator[list[tuple[int, int, int]]]:
    """Yield the thresholds during compilation; before and after they are 700, 10 and 5."""
    listener, usual = Thresholds(), gc.get_threshold()
    gc.set_threshold(700, 10, 5)
    try:
        with event.install_listener('numba:compile', listener):
            yield listener.recorded
    finally:
        gc.set_threshold(*usual)


@pytest.mark.skipif(is_interpreted(), reason='nothing is compiled')
def test_garbage_collection_compiling_is_rarer_then_restored(
    thresholds: list[tuple[int, int, int]],
) -> None:
    assert numba.njit(lambda x: x + 1.0)(1.0) == 2.0
    assert thresholds == [(20_000, 10, 5)]
    assert gc.get_threshold() == (700, 10, 5)


def test_bound_plain_function_of_mechanism_is_unmodified() -> None:
    def transforms(origins: object, position: object) -> None:
        """Return frames, as the method of a tree does."""

    assert bound(transforms, 1.0, 2.0) is transforms
    assert is_loaded(transforms, 1.0, 2.0)


@pytest.mark.skipif(is_interpreted(), reason='nothing is compiled')
def test_garbage_collection_compilation_fails_is_restored(thresholds: list[Any]) -> None:
    inner = numba.njit(lambda x: x.nothing)
    with pytest.raises(numba.TypingError):
        numba.njit(lambda x: inner(x))(1.0)
    assert len(thresholds) > 1
    assert gc.get_threshold() == (700, 10, 5)


@pytest.mark.skipif(is_interpreted(), reason='nothing is compiled')
def test_garbage_collection_disabled_stays_disabled(
    thresholds: list[tuple[int, int, int]]
) -> None:
    gc.set_threshold(0, 10, 5)
    assert numba.njit(lambda x: x - 1.0)(1.0) == 0.0
    assert thresholds == [(0, 10, 5)]


def test_copied_record_large_compiles_as_fast_as_small() -> None:
    """With a store for each byte, 64 components of 16 lanes take 9 s, and 512 take minutes."""

    @kernel
    def increased(records: Records) -> None:
        record = copied(records[0])
        for lane in range(lane_count(record)):
            row = lane_of(record, lane)
            row.value += 1.0
        copy_to(record, records[0])

    record = new_record((Field('value'), Field('history', 64)), {}, 16)
    start = time.process_time()
    increased(record)
    assert time.process_time() - start < 3.0
    assert (record['value'] == 1.0).all()


@formula
def _tripled(value: float) -> float:
    return 3.0 * value


@kernel
def _tripled_twice(value: float) -> float:
    return _tripled(_tripled(value))


@pytest.mark.skipif(is_interpreted(), reason='nothing is compiled')
def test_formula_in_kernel_has_no_machine_code() -> None:
    assert _tripled_twice(2.0) == 18.0
    # Its attributes are those of a Formula, not of the function that it decorates.
    assert address(cast(Any, _tripled)._compiled) == 0
    assert _tripled(2.0) == 6.0


def address(compiled: Any) -> int:
    """Return the address of the machine code for a number; 0: it has none."""
    # The kernel that calls it may be that on the disk, and is then the only one to be loaded.
    compiled.compile((numba.float64,))
    code = next(iter(compiled.overloads.values()))
    return cast(int, code.library.get_pointer_to_function(code.fndesc.llvm_func_name))


def _first(values: Any) -> Any:
    return 2.0 * values[0]


@pytest.mark.skipif(is_interpreted(), reason='nothing is compiled')
@pytest.mark.parametrize(
    ('kind', 'is_inlined'),
    [(numba.types.UniTuple(numba.float64, 3), True), (VectorType(numba.float64), False)],
)
def test_subroutine_is_inlined_if_sizes_are_constant(kind: Any, is_inlined: bool) -> None:
    # Options of a formula but for the cache: stored code cannot be inspected.
    first = numba.njit(
        forceinline=True,
        no_cpython_wrapper=True,
        no_cfunc_wrapper=True,
        pipeline_class=CalledCompiler,
    )(_first)
    first.compile((kind,))
    code, = first.overloads.values()
    assert ('alwaysinline' in code.library.get_llvm_str()) == is_inlined


@subroutine
def _scaled(values: tuple[float, ...]) -> float:
    return 3.0 * values[1]


@kernel
def _scaled_twice(values: tuple[float, ...]) -> float:
    return 2.0 * _scaled(values)


def test_subroutine_compiled_equals_python() -> None:
    assert _scaled_twice((1.0, 2.0)) == 12.0
    assert _scaled((1.0, 2.0)) == 6.0


@pytest.mark.skipif(is_interpreted(), reason='nothing is compiled')
def test_kernel_called_by_kernel_has_no_machine_code_of_its_own() -> None:
    assert _total_of_kernels(2.0) == 8.0
    assert address(cast(Any, _doubled_alone)._called) == 0
    assert _doubled_alone(2.0) == 4.0
    assert code_file(_doubled_alone, 2.0).exists()


@kernel
def _doubled_alone(value: float) -> float:
    return 2.0 * value


@kernel
def _total_of_kernels(value: float) -> float:
    return _doubled_alone(_doubled_alone(value))


@large_part
def _increase(memory: Any) -> None:
    memory.value += 1.0


@kernel
def _increased(records: Records) -> None:
    for lane in range(lane_count(records[0])):
        _increase(shared(lane_of(records[0], lane)))


def record_of(law: str, own: int, lanes: int) -> Records:
    """Return a record of a law with components of its own field after the shared one."""
    fields = Field('value'), Field('own', own)
    return new_record(fields, {}, lanes, {'mechanism': 'm', SHARED: '1', 'law': law})


def test_large_part_of_one_lane_is_compiled_once_for_all_laws() -> None:
    records = [record_of('a', 1, 1), record_of('b', 3, 1), record_of('c', 3, 2)]
    for record in records:
        _increased(record)
        assert (record['value'] == 1.0).all()
        assert (record['own'] == 0.0).all()
    if not is_interpreted():
        # The kernel of two lanes contains the statements.
        assert len(cast(Any, _increase)._called.overloads) == 1


@pytest.mark.skipif(is_interpreted(), reason='nothing is compiled')
def test_shared_record_with_empty_field_is_whole_record() -> None:
    """Numba sorts fields at the same place by name, so the first ones are not known."""
    fields = Field('value'), Field('last', 'none'), Field('first', 2)
    record = new_record(fields, {'none': 0}, 1, {SHARED: '2', 'law': 'a'})
    kind = shared_record(numba.typeof(record).dtype)
    assert [*kind.names] == ['value', 'first', 'last', 'shared:2', 'law:a']
