# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Process that compiles laws for a node: `python -m masmc_ros.loop.compiling_process`.

It reads one request from its standard input, and ends with the process that holds the other end.
"""

from __future__ import annotations

from contextlib import redirect_stdout, suppress
import json
import os
import subprocess
import sys
from threading import Thread

from masmc_ros.child_process import module_command
from masmc_ros.errors import UserError
from masmc_ros.law import registry
from masmc_ros.law.command_interface import takes_rates
from masmc_ros.law.law import Law
from masmc_ros.law.registry import LAW, SWITCHING_TERM
from masmc_ros.loop.law_code import code_for, fitting, load, mark
from masmc_ros.loop.law_dry_run import check
from masmc_ros.params.declaration import Values
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.mechanisms import mechanism_from

_NICENESS = 5
"""Nice value of compiling processes; nodes have 0, because they must not be late."""

_LONGEST_REASON = 200
"""Largest number of logged characters of the cause of an error."""


def reason(error: BaseException) -> str:
    """Return an error in one line."""
    if isinstance(error, UserError):
        return str(error)
    text = f'{type(error).__name__}: {" ".join(str(error).split())}'
    return text if len(text) <= _LONGEST_REASON else f'{text[:_LONGEST_REASON]} ...'


def started(
    mechanism: Mechanism, values: Values | None, *, is_awaited: bool = False
) -> subprocess.Popen[bytes]:
    """
    Start a process that compiles the code for parameter values, or all code for None.

    `is_awaited` is True if no tick is computed meanwhile; otherwise only idle processors compile.
    """
    process = subprocess.Popen(
        module_command(__name__),
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL if values is None else subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    _lower_priority(process, is_awaited=is_awaited)
    assert process.stdin is not None
    with suppress(BrokenPipeError):
        request = {'robot': mechanism.choice, 'values': values}
        process.stdin.write(json.dumps(request).encode() + b'\n')
        process.stdin.flush()
    return process


def _lower_priority(process: subprocess.Popen[bytes], *, is_awaited: bool) -> None:
    """
    Lower the priority of a started process.

    The process has that of its node, perhaps a real-time one, while it imports modules. Linux
    interrupts processes of `SCHED_IDLE` at once if a node has to run, others after up to 3 ms.
    """
    if hasattr(os, 'sched_setscheduler'):
        policy = os.SCHED_OTHER if is_awaited else os.SCHED_IDLE
        os.sched_setscheduler(process.pid, policy, os.sched_param(0))
    if hasattr(os, 'setpriority'):
        os.setpriority(os.PRIO_PROCESS, process.pid, _NICENESS)


def main() -> None:
    """
    Compile the code requested by the first line of the input; print one line if that fails.

    A request without values compiles all laws, unless another process does so already.
    """
    request = json.loads(sys.stdin.readline())
    # Standard input comes from the requesting node and is closed when the node ends.
    Thread(target=_end_with_parent, daemon=True).start()
    values = request['values']
    try:
        # A user law may print while it is imported.
        with redirect_stdout(sys.stderr):
            mechanism = mechanism_from(request['robot'])
            if values is None:
                _prepare_all(mechanism)
            else:
                code = code_for(mechanism, values)
                law = registry.load_for(LAW.of(values), mechanism)
                if isinstance(law, Law) and not takes_rates(values):
                    check(law, mechanism, SWITCHING_TERM.of(values))
                code.load()
    except Exception as error:
        print(reason(error))
        sys.exit(1)


def _prepare_all(mechanism: Mechanism) -> None:
    done = mark(mechanism)
    at_work = done.with_suffix('.lock')
    with at_work.open('w') as file:
        if _is_first(file.fileno()):
            failed = False
            for law in fitting(mechanism):
                try:
                    load(mechanism, [law])
                except Exception:  # of a user law; the node reports it when it is selected
                    failed = True
            if not failed:
                done.touch()


def _is_first(file: int) -> bool:
    """Lock a file until this process ends; return True if no other process has locked it."""
    try:
        import fcntl
    except ImportError:  # not on Windows
        return True
    with suppress(OSError):
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return True
    return False


def _end_with_parent() -> None:
    # Not by sys.stdin: Python aborts if it ends while a thread reads from a buffered stream.
    while os.read(sys.stdin.fileno(), 1024):
        pass
    os._exit(0)


if __name__ == '__main__':
    main()
