# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Exceptions and arrays of exported functions; arrays are on the stack of a call."""

from __future__ import annotations

from pathlib import Path
import shutil
import subprocess
from typing import Any

from masmc_ros.jit.compiled import exported_code
from masmc_ros.jit.scratch import scratch
from masmc_ros.native.entries import Entry, FAILED, OTHER_RECORDS
from masmc_ros.native.object_code import _with_single_constants, archive, merged, object_of
from masmc_ros.native.targets import TARGETS
from numba import carray, types
import numpy as np
import pytest

pytestmark = pytest.mark.skipif(shutil.which('cc') is None, reason='needs a C compiler')

PROGRAM = """#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
int64_t sums(int64_t size, int64_t rounds);
int64_t first(const int64_t *record);
static void *many(void *out) {
    *(int64_t *)out = sums(300, 100000);
    return NULL;
}
int main(void) {
    int64_t own[] = {1, 2, 3}, other[] = {1, 9, 3}, results[2];
    pthread_t threads[2];
    for (int i = 0; i < 2; i++) pthread_create(&threads[i], NULL, many, &results[i]);
    for (int i = 0; i < 2; i++) pthread_join(threads[i], NULL);
    int64_t values[] = {results[0], results[1], sums(1000, 1), sums(1100, 1), sums(-1, 1),
                        sums(10, 1), first(own), first(other)};
    for (int i = 0; i < 8; i++) printf("%d ", (int)values[i]);
    return 0;
}
"""


def _sums(size: int, rounds: int) -> int:
    if size < 0:
        raise ValueError
    total = 0.0
    for _ in range(rounds):
        a, b = scratch(size), scratch(size)
        for i in range(size):
            a[i], b[i] = 1.0, 2.0
        total = 0.0
        for i in range(size):
            total += a[size - 1 - i] + b[i]
    return int(total)


def _first(record: Any) -> int:
    return int(carray(record, 3)[2])


def _code(compilation: int) -> bytes:
    """Return the library; code on the disk of another compilation is not used."""
    number = types.int64
    kinds = {'sums': number(number, number), 'first': number(types.CPointer(number))}
    layouts = {'sums': (b'', b''), 'first': (np.array([1, 2]).tobytes(),)}
    entries = {
        name: Entry(
            exported_code(function, kinds[name], compilation), (), '', FAILED, layouts[name]
        )
        for name, function in (('sums', _sums), ('first', _first))
    }  # fmt: skip
    code = object_of(merged(entries), TARGETS['x86_64-linux-gnu'])
    return archive('sums.o', code, list(entries))


def test_exported_exceptions_are_statuses_and_arrays_reuse_stack(tmp_path: Path) -> None:
    code = _code(0)
    assert code == _code(1)
    (tmp_path / 'sums.a').write_bytes(code)
    (tmp_path / 'main.c').write_text(PROGRAM, encoding='utf-8')
    command = 'cc -g -fsanitize=address,undefined -o main main.c sums.a -lpthread'
    subprocess.run(command.split(), cwd=tmp_path, check=True)
    run = subprocess.run(['./main'], cwd=tmp_path, capture_output=True, check=True)
    expected = [900, 900, 3000, 3300, FAILED, 30, 3, 2 | OTHER_RECORDS]
    assert run.stdout.decode().split() == [str(value) for value in expected]


def test_equal_constants_are_one_also_those_that_point_to_them() -> None:
    text = (
        '@a.1 = internal constant [1 x i8] c"x"\n'
        '@a = internal constant [1 x i8] c"x"\n'
        '@b = internal constant [1 x i8] c"y"\n'
        '@p = internal constant ptr @a\n'
        '@p.1 = internal constant ptr @a.1\n'
        'store ptr @p, ptr @p.1\n'
        'store ptr @b, ptr @outside\n'
    )
    assert _with_single_constants(text) == (
        '@a.1 = internal constant [1 x i8] c"x"\n'
        '@b = internal constant [1 x i8] c"y"\n'
        '@p = internal constant ptr @a.1\n'
        'store ptr @p, ptr @p\n'
        'store ptr @b, ptr @outside\n'
    )
