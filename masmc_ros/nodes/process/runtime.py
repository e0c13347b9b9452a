# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Start, spinning and end of a process of this package.

A process ends with status 0 at the end of its run and on SIGINT, SIGTERM and SIGHUP. On bad
input it prints one line and ends with status 2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, ExitStack
import ctypes
from functools import partial
import gc
import sys
from types import FrameType
from typing import Protocol

from masmc_ros.errors import InputError, UserError
from masmc_ros.nodes.middleware.rcl_setup import prepare_logging, prepare_rcl
from masmc_ros.nodes.process.command_line import parse
from masmc_ros.nodes.process.ending import ending_at_once, on_end
import rclpy
from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.logging import get_logger_level, LoggingSeverity, set_logger_level
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

_POLL = 0.1
"""Longest time in s between a signal and its effect."""


class RunningNode(Protocol):
    """Interface between the runtime and a node, whose attributes are those of `SuiteNode`."""

    node: Node
    finished: bool
    follows: bool

    def connect(self) -> None:
        """Create publishers, subscriptions, services and timers; all kernels are compiled."""

    def close(self, spin: Callable[[], None]) -> None:
        """Deliver or process the last messages; `spin` handles those that have arrived."""


Factory = Callable[..., RunningNode]


def run(factories: Sequence[Factory], arguments: Sequence[str] | None = None) -> int:
    """Run nodes in this process until all have finished; return the exit status."""
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    try:
        return _run(factories, arguments)
    except UserError as error:
        return _print_error(error)


def _print_error(error: UserError) -> int:
    """Print an error of the user's input; return the exit status for it."""
    print(error, file=sys.stderr)
    return 2


def _run(factories: Sequence[Factory], arguments: list[str]) -> int:
    command_line = parse(arguments)
    stop = StopSignals()
    context = Context()
    prepare_rcl()
    # rcl would log errors of the arguments in addition to the line below.
    set_logger_level('rcl', LoggingSeverity.FATAL)
    try:
        rclpy.init(
            args=arguments, context=context, signal_handler_options=SignalHandlerOptions.NO
        )
    except Exception as error:
        raise InputError(f'--ros-args: {without_source(error)}') from error
    if get_logger_level('rcl') == LoggingSeverity.FATAL:
        set_logger_level('rcl', LoggingSeverity.UNSET)
    executor = EventsExecutor(context=context)

    def spin() -> None:
        """Handle messages, services and timers for 0.1 s, or until a signal arrives."""
        # A return to Python after each callback would take one fifth of the callback's time.
        executor.spin_until_future_complete(stop.future(executor), _POLL)

    nodes: list[RunningNode] = []
    status = 1

    def close(node: RunningNode) -> None:
        nonlocal status
        try:
            node.close(spin)
        except UserError as error:
            status = _print_error(error)

    try:
        with ending_at_once():
            for factory in factories:
                nodes.append(factory(context=context, command_line=command_line))
        for node in nodes:
            node.connect()
            executor.add_node(node.node)
        prepare_logging()
        # The objects created so far stay. Without this, every full garbage collection traverses
        # all of them, which stops the ticks for a third of a second.
        gc.collect()
        gc.freeze()
        leading = [node for node in nodes if not node.follows] or nodes
        for node in leading:
            while not (node.finished or stop.requested):
                spin()
        status = 0
    except UserError as error:
        status = _print_error(error)
    finally:
        # After an exception of one node the others still deliver their messages.
        with ExitStack() as closing:
            for node in reversed(nodes):
                closing.callback(close, node)
        with bounded_ending(status):
            for node in nodes:
                executor.remove_node(node.node)
                node.node.destroy_node()
            executor.shutdown()
            context.try_shutdown()
    return status


class StopSignals:
    """
    Signals that request the end of the process.

    A handler must not wait for a lock: the thread that it interrupts may hold it. A future has
    one (https://github.com/ros2/rclpy/blob/jazzy/rclpy/rclpy/task.py). Therefore the executor,
    and not the handler, completes the future.

    Attributes
    ----------
    requested
        True after the first signal.

    """

    def __init__(self) -> None:
        """Install the handler."""
        self.requested = False
        self._complete: Callable[[], object] | None = None
        on_end(self._request)

    def future(self, executor: Executor) -> Future:
        """Return a future that the executor completes after a signal."""
        future = Future()
        self._complete = partial(executor.create_task, future.cancel)
        return future

    def _request(self, number: int, frame: FrameType | None) -> None:
        if self.requested:
            return
        self.requested = True
        if self._complete is not None:
            self._complete()


def without_source(error: BaseException) -> str:
    """Return an error as one line, without the position in rcl's sources."""
    text = ' '.join(str(error).split())
    return text.split(', at ./src')[0].split(', at /')[0]


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

    Fast DDS can deadlock when readers, writers and participants are destroyed
    (eProsima/Fast-DDS issues 6193 and 6502), and rclpy holds the interpreter meanwhile. This
    function can be removed when both issues are fixed in the Fast DDS of the supported ROS 2
    distributions. Call this when all messages are delivered and all files are closed.
    """
    # The timer ends the process without Python, which would otherwise flush the buffers.
    sys.stdout.flush()
    sys.stderr.flush()
    with exit_after(_PATIENCE, status):
        yield
