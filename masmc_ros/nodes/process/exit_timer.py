# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Timer of the system that bounds the time in which the middleware releases its resources.

Fast DDS can deadlock when readers, writers and participants are destroyed
(eProsima/Fast-DDS issues 6193 and 6502), and rclpy holds the interpreter meanwhile. This file can
be removed when both issues are fixed in the Fast DDS of the supported ROS 2 distributions.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import ctypes
import sys

_PATIENCE = 5.0
"""Longest time in s in which the middleware may release its resources."""

_CLOCK_MONOTONIC = 1
_SIGEV_THREAD = 2
"""The C library calls a function in a separate thread (sigevent(3))."""


class _Event(ctypes.Structure):
    """struct sigevent of glibc and Linux with 64 bits: 64 bytes."""

    _fields_ = (
        ('value', ctypes.c_long),
        ('signal_number', ctypes.c_int),
        ('notify', ctypes.c_int),
        ('function', ctypes.c_void_p),
        ('attributes', ctypes.c_void_p),
        ('padding', ctypes.c_char * 32),
    )


class _Times(ctypes.Structure):
    """struct itimerspec: interval and time left, both in s and ns."""

    _fields_ = tuple(
        (name, ctypes.c_long)
        for name in ('interval_s', 'interval_ns', 'left_s', 'left_ns')
    )


@contextmanager
def exit_after(seconds: float, status: int) -> Iterator[None]:
    """
    End the process with a status after a time in s, unless the body ends before.

    No Python runs for it: a library that holds the interpreter does not stop the timer.
    `faulthandler.dump_traceback_later` has no choice of the status (always 1) and writes a
    traceback.
    """
    library = ctypes.CDLL(None)
    leave = ctypes.cast(library._exit, ctypes.c_void_p).value
    event = _Event(status, 0, _SIGEV_THREAD, leave, None)
    timer = ctypes.c_void_p()
    if library.timer_create(_CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)):
        # Without a timer the body has no time limit.
        yield
        return
    whole = int(seconds)
    times = _Times(0, 0, whole, round((seconds - whole) * 1e9))
    library.timer_settime(timer, 0, ctypes.byref(times), None)
    try:
        yield
    finally:
        library.timer_delete(timer)


@contextmanager
def bounded_ending(status: int) -> Iterator[None]:
    """
    End the process with a status if the body takes longer than 5 s.

    Call this when all messages are delivered and all files are closed.
    """
    # The timer ends the process without Python, which would otherwise flush the buffers.
    sys.stdout.flush()
    sys.stderr.flush()
    with exit_after(_PATIENCE, status):
        yield
