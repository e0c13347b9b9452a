# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Garbage collection thresholds during and after compilation."""

from __future__ import annotations

from collections.abc import Iterator
import gc
from typing import Any

import masmc_ros.numerics.compiled  # noqa: F401  (it listens)
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


def test_garbage_collection_compiling_is_rarer_then_restored(
    thresholds: list[tuple[int, int, int]],
) -> None:
    assert numba.njit(lambda x: x + 1.0)(1.0) == 2.0
    assert thresholds == [(20_000, 10, 5)]
    assert gc.get_threshold() == (700, 10, 5)


def test_garbage_collection_compilation_fails_is_restored(thresholds: list[Any]) -> None:
    inner = numba.njit(lambda x: x.nothing)
    with pytest.raises(numba.TypingError):
        numba.njit(lambda x: inner(x))(1.0)
    assert len(thresholds) > 1
    assert gc.get_threshold() == (700, 10, 5)


def test_garbage_collection_disabled_stays_disabled(
    thresholds: list[tuple[int, int, int]]
) -> None:
    gc.set_threshold(0, 10, 5)
    assert numba.njit(lambda x: x - 1.0)(1.0) == 0.0
    assert thresholds == [(0, 10, 5)]
