# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Python looks for garbage less often while something compiles, and as before afterwards."""

from __future__ import annotations

from collections.abc import Iterator
import gc
from typing import Any

import masmc_ros.numerics.compiled  # noqa: F401  (it listens)
import numba
from numba.core import event
import pytest


class Thresholds(event.Listener):
    """Notes those in force whenever something begins to compile."""

    def __init__(self) -> None:
        self.found: list[tuple[int, int, int]] = []

    def on_start(self, event: event.Event) -> None:
        self.found.append(gc.get_threshold())

    def on_end(self, event: event.Event) -> None:
        pass


@pytest.fixture
def thresholds() -> Iterator[list[tuple[int, int, int]]]:
    """Yield those while something compiles; before and after they are 700, 10 and 5."""
    listener, usual = Thresholds(), gc.get_threshold()
    gc.set_threshold(700, 10, 5)
    try:
        with event.install_listener('numba:compile', listener):
            yield listener.found
    finally:
        gc.set_threshold(*usual)


def test_it_is_looked_less_often_and_then_as_before(
    thresholds: list[tuple[int, int, int]],
) -> None:
    assert numba.njit(lambda x: x + 1.0)(1.0) == 2.0
    assert thresholds == [(20_000, 10, 5)]
    assert gc.get_threshold() == (700, 10, 5)


def test_what_does_not_compile_leaves_it_as_before(thresholds: list[Any]) -> None:
    inner = numba.njit(lambda x: x.nothing)
    with pytest.raises(numba.TypingError):
        numba.njit(lambda x: inner(x))(1.0)
    assert len(thresholds) > 1
    assert gc.get_threshold() == (700, 10, 5)


def test_who_looks_never_goes_on_so(thresholds: list[tuple[int, int, int]]) -> None:
    gc.set_threshold(0, 10, 5)
    assert numba.njit(lambda x: x - 1.0)(1.0) == 0.0
    assert thresholds == [(0, 10, 5)]
