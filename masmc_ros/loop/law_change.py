# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Code of control laws in a node: preparation while the node starts, and live changes of the law.

Compiling a law takes seconds, on a tree robot up to a minute. Loading its code from disk takes up
to a fifth of a second. A controller must do neither between two ticks. While the node starts, it
loads the code of the paper's laws and of user laws. A process compiles missing code on idle
processors, once per machine.

A later change of `law` or `switching` may need code that the node has not loaded: a process
compiles, a thread loads, and the change takes effect between two ticks.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
import subprocess
from threading import Lock, Thread
import time
from typing import NamedTuple

from masmc_ros.jit.compiled import is_interpreted
from masmc_ros.law.command_interface import COMMAND_INTERFACE
from masmc_ros.law.parts.joint_limits import CHOICE as JOINT_LIMITS
from masmc_ros.law.registry import LAW, SWITCHING_TERM
from masmc_ros.loop import records
from masmc_ros.loop.compiling_process import reason, started
from masmc_ros.loop.controller import Controller
from masmc_ros.loop.law_code import CHOOSES_CODE, Code, code_for, laws_loaded_at_start, load, mark
from masmc_ros.params.declaration import MutableValues, Values
from masmc_ros.params.text import yaml_text
from masmc_ros.robot.declaration import Mechanism


def prepare(mechanism: Mechanism) -> subprocess.Popen[bytes] | None:
    """Load the kernels, or return a process that compiles them and ends with this process."""
    if is_interpreted():
        return None
    if mark(mechanism).exists():
        load(mechanism, (law for law in laws_loaded_at_start() if law.fits(mechanism)))
        return None
    return started(mechanism, None)


class Preparation:
    """
    Process that compiles all laws, and pauses while another process compiles a requested law.

    A node and two compiling processes need more than two processors.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        """Load the kernels, or start a process that compiles them."""
        self._mechanism = mechanism
        self._lock = Lock()
        self._pauses = 0
        self._process = prepare(mechanism)

    @contextmanager
    def paused(self) -> Iterator[None]:
        """End the process, and start it again afterwards unless it has finished; for threads."""
        with self._lock:
            self._pauses += 1
            if self._process is not None and self._process.poll() is None:
                _end(self._process)
        try:
            yield
        finally:
            with self._lock:
                self._pauses -= 1
                was_ended = self._process is not None and self._process.returncode != 0
                if was_ended and self._pauses == 0:
                    self._process = started(self._mechanism, None)

    def close(self) -> None:
        """End the process; it does not start again."""
        with self._lock:
            if self._process is not None:
                _end(self._process)
            self._process = None


def _end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    process.wait()
    if process.stdin is not None:
        process.stdin.close()


_STARVED = 5.0
"""Longest time in s for which a requested compilation may wait for an idle processor."""


class Effect(NamedTuple):
    """Effect of requested parameter values."""

    values: MutableValues
    """Values used by the next tick."""
    withdrawn: tuple[str, ...] = ()
    """Names of parameters that keep their values because the change has failed."""
    text: str = ''
    """Text for the log and for the response; empty if all values apply as requested."""


class LawChange:
    """
    Live changes of a controller's parameters; those of CHOOSES_CODE may need other code.

    A change takes effect at once if its code is loaded or it needs no other code. Otherwise it is
    pending: a process compiles the code and a thread loads it, while the controller continues
    with the active law. A later change of these parameters replaces a pending change. Values
    requested together take effect together.

    The caller requests, polls between two ticks, and carries out the `Effect` of both. Nothing
    here waits, except `close`.
    """

    def __init__(self, controller: Controller, preparation: Preparation | None = None) -> None:
        """Load the code of a controller; a pending change pauses a preparation."""
        self._controller = controller
        self._known: dict[tuple[str, str, bool], Code] = {}
        self._code_of(controller.values).load()
        self._preparation = preparation
        self._wanted: MutableValues = {}
        self._making: _Making | None = None

    @property
    def is_pending(self) -> bool:
        """Return True if a change has not taken effect yet."""
        return self._making is not None

    @property
    def awaited(self) -> str:
        """Return a description of the code of a pending change; '' without one."""
        return f'the compiled code of {_text(self._wanted)}' if self.is_pending else ''

    def request(self, values: Values, *, waits: bool = False) -> Effect:
        """
        Apply checked values from the next tick onwards, or prepare the code for them.

        Parameters
        ----------
        values
            Values of some parameters, by name.
        waits
            True if the caller computes no tick while a change is pending, for the text.

        Returns
        -------
        Effect
            Its text is empty if all values take effect from the next tick onwards.

        """
        active = self._controller.values
        wanted = {**self._wanted, **values}
        self._wanted = {name: v for name, v in wanted.items() if v != active[name]}
        code = self._code_of({**active, **self._wanted})
        if code.is_loaded:
            self._drop()
            return self._apply()
        # The check comes before the thread starts, which would share the interpreter.
        doing = 'loading' if code.is_on_disk else 'compiling'
        if self._making is None or self._making.code.name != code.name:
            self._drop()
            self._making = _Making(
                self._controller.mechanism,
                code,
                {**active, **self._wanted},
                self._preparation,
                is_awaited=waits,
            )
        elif not any(name in values for name in CHOOSES_CODE):
            # For the active law and for the requested one, which becomes active later.
            at_once = {n: self._wanted.pop(n) for n in values if n in self._wanted}
            self._controller.change(at_once)
            return Effect(at_once)
        meanwhile = 'the run waits' if waits else f'{self._present} continues'
        text = f'{_text(self._wanted)}: {doing}; {meanwhile} until the code is ready'
        return Effect({}, text=text)

    def poll(self) -> Effect | None:
        """Apply a pending change if its code is ready; return None if there is nothing to do."""
        making = self._making
        if making is None or making.is_alive():
            return None
        self._making = None
        if making.failure is not None:
            return self._failed(making.failure)
        text = f'{_text(self._wanted)}: ready after {making.duration:.1f} s; now active'
        effect = self._apply()
        return effect if effect.withdrawn else effect._replace(text=text)

    def close(self) -> None:
        """Cancel a pending change, and wait for the end of its thread."""
        making = self._making
        self._drop()
        if making is not None:
            making.join()

    def _code_of(self, values: Values) -> Code:
        """Return the code required by the controller with these parameter values."""
        # Creating its records takes milliseconds.
        name = LAW.of(values), SWITCHING_TERM.of(values), records.is_compensated(values)
        if name not in self._known:
            self._known[name] = code_for(self._controller.mechanism, values)
        return self._known[name]

    @property
    def _present(self) -> str:
        """Return the value that stays active while a change is pending."""
        changed = [name for name in ('law', 'switching') if name in self._wanted]
        return str(self._controller.values[changed[0] if changed else 'law'])

    def _apply(self) -> Effect:
        values, old = dict(self._wanted), self._controller.values
        if not values:
            return Effect({})
        try:
            self._controller.change(values)
        except Exception as error:
            # The constructor of a plug-in law may raise anything, before any value has changed.
            if self._controller.values is not old:
                raise
            return self._failed(reason(error))
        self._wanted = {}
        return Effect(values)

    def _failed(self, reason: str) -> Effect:
        names, text = tuple(self._wanted), f'{_text(self._wanted)}: failed: {reason}'
        present = self._present
        self._wanted = {}
        return Effect(
            {},
            withdrawn=names,
            text=f'{text}; {present} continues; correct the law, then set it again',
        )

    def _drop(self) -> None:
        if self._making is not None:
            self._making.stop()
            self._making = None


class _Making(Thread):
    """
    Thread that lets a process compile code that is not on the disk, and loads it.

    Attributes
    ----------
    code
        Code to prepare.
    failure
        Reason of a failure; None after success and until the end.
    duration
        Time in s from the start to the end.

    """

    def __init__(
        self,
        mechanism: Mechanism,
        code: Code,
        values: Values,
        preparation: Preparation | None,
        *,
        is_awaited: bool,
    ) -> None:
        """Start the thread for code of a controller with these parameter values."""
        super().__init__(name='law code', daemon=True)
        self.code = code
        self.failure: str | None = None
        self.duration = 0.0
        self._mechanism, self._preparation = mechanism, preparation
        self._is_awaited = is_awaited
        names = (*CHOOSES_CODE, COMMAND_INTERFACE.name, JOINT_LIMITS.name)
        self._values = {name: values[name] for name in names}
        self._lock = Lock()
        self._is_stopped = False
        self._process: subprocess.Popen[bytes] | None = None
        self.start()

    def run(self) -> None:
        """Compile the code if necessary, then load it."""
        start = time.monotonic()
        try:
            if not self.code.is_whole_on_disk:
                with self._preparation.paused() if self._preparation else nullcontext():
                    self.failure = self._compile()
            if self.failure is None and not self._is_stopped:
                self.code.load()
        except Exception as error:
            self.failure = reason(error)
        self.duration = time.monotonic() - start

    def stop(self) -> None:
        """End the compiling process; the thread ends soon after."""
        with self._lock:
            self._is_stopped = True
            if self._process is not None:
                self._process.kill()

    def _compile(self) -> str | None:
        """Wait for the compiling process; return the reason of a failure, None after success."""
        said = self._said(is_urgent=self._is_awaited)
        if said is None and not self._is_stopped:
            # No processor was idle. As one more ordinary process, it ends in any case.
            said = self._said(is_urgent=True)
        if said is None:
            return 'stopped'
        if said:
            return said
        if not self.code.is_whole_on_disk:
            status = self._process.returncode if self._process else None
            if status == 0:
                return 'the compiled code cannot be stored (XDG_CACHE_HOME)'
            return f'the process that compiles has ended with status {status}'
        return None

    def _said(self, *, is_urgent: bool) -> str | None:
        """Let a process compile; return its output, None if it is stopped or gets no processor."""
        with self._lock:
            if self._is_stopped:
                return None
            process = self._process = started(
                self._mechanism, self._values, is_awaited=is_urgent
            )
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            while True:
                with suppress(subprocess.TimeoutExpired):
                    process.wait(1.0)
                    return process.stdout.read().decode(errors='replace').strip()
                if not is_urgent and _is_starved(process.pid):
                    return None
        finally:
            process.kill()
            process.wait()
            process.stdout.close()
            process.stdin.close()


def _is_starved(pid: int) -> bool:
    """Return True if a process has waited for a processor, and has had it for a tenth of that."""
    try:
        ran, waited = Path(f'/proc/{pid}/schedstat').read_text(encoding='ascii').split()[:2]
    except (OSError, ValueError):
        return False  # a system without these figures
    return int(waited) > max(10 * int(ran), _STARVED * 1e9)


def _text(values: Values) -> str:
    """Return parameters with their values, first those of CHOOSES_CODE."""
    names = sorted(values, key=lambda name: (name not in CHOOSES_CODE, name))
    return ', '.join(f'{name} = {yaml_text(values[name])}' for name in names)
