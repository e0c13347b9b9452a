# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Contenders of a comparison: laws with a switching term, and controllers from elsewhere.

A controller is a Python function of (state, reference) -> torques. It becomes a law in plain
Python for this process, so it runs with the limits, the velocity estimator and the compensation
of latency of every law. docs/guides/benchmark.md has examples.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
import sys
from typing import Any, ClassVar, NamedTuple

from masmc_ros.aliases import Array
from masmc_ros.errors import InputError, suggestion, UserError
from masmc_ros.law import registry
from masmc_ros.law.law import Law
from masmc_ros.law.plug_in import TickInput
from masmc_ros.law.reaching.implicit import IMPLICIT, OBSERVER_GAIN
from masmc_ros.law.registry import SWITCHING_TERM
from masmc_ros.mistakes import place_and_text, reported
from masmc_ros.params.declaration import Parameter, Values
from masmc_ros.params.plug_ins import add_plug_in
from masmc_ros.report.measure.labels import OBSERVER
from masmc_ros.robot.declaration import Mechanism
import numpy as np


class Contender(NamedTuple):
    """
    A law with its switching term; empty: that of the scenario.

    `observes` is true if it estimates the disturbance, which laws with a reaching term lack.
    """

    law: str
    switching: str = ''
    observes: bool = False

    @property
    def label(self) -> str:
        """Return the name in tables."""
        name = f'{self.law}:{self.switching}' if self.switching else self.law
        return f'{name}{OBSERVER}' if self.observes else name

    @property
    def settings(self) -> tuple[str, ...]:
        """Return the settings that select it."""
        chosen = (f'controller.law={self.law}',)
        return (*chosen, f'controller.switching={self.switching}') if self.switching else chosen

    @property
    def is_plain(self) -> bool:
        """Return True for plain Python: no lanes, and torques of all joints only."""
        return not isinstance(registry.load(self.law), Law)


_ALL = 'all'

_BOTH = ('tanh', 'implicit')
"""Reaching terms of all laws in comparisons: a smooth and a sampled one."""


def contenders(names: str, mechanism: Mechanism, own: str) -> tuple[Contender, ...]:
    """
    Return the contenders of `--laws`: LAW or LAW:SWITCHING, separated by commas, or `all`.

    `all` is every law for this kind of robot except an earlier one by another name; laws with a
    reaching term have that of the scenario, `own`, and also `tanh` and `implicit`. Laws in plain
    Python are selected by name only. Raises InputError for an unknown name, and for a law that is
    not suitable for the robot.
    """
    if names == _ALL:
        return tuple(_every(mechanism, own))
    selected = []
    for name in map(str.strip, names.split(',')):
        law, colon, switching = name.partition(':')
        if law not in registry.names():
            raise InputError(f"--laws: '{law}' is unknown; {suggestion(law, registry.names())}")
        if colon and switching not in registry.SWITCHING:
            hint = suggestion(switching, registry.SWITCHING)
            raise InputError(f"--laws: '{switching}' in '{name}' is unknown; {hint}")
        registry.load_for(law, mechanism)
        if colon and not registry.uses_switching(law):
            raise InputError(f"--laws: '{name}': {law} has no reaching term; write {law}")
        selected.append(Contender(law, switching))
    return tuple(dict.fromkeys(selected))


def marked(chosen: Iterable[Contender], controller: Values) -> tuple[Contender, ...]:
    """Return contenders whose names show the estimate that a controller's values switch on."""
    has_gain, own = OBSERVER_GAIN.of(controller) > 0.0, SWITCHING_TERM.of(controller)
    return tuple(
        contender._replace(observes=has_gain and _is_implicit(contender, own))
        for contender in chosen
    )


def _is_implicit(contender: Contender, own: str) -> bool:
    is_switched = registry.uses_switching(contender.law)
    return is_switched and (contender.switching or own) == IMPLICIT.name


def _every(mechanism: Mechanism, own: str) -> list[Contender]:
    every, known = [], []
    for name in registry.names():
        law = registry.load(name)
        if not isinstance(law, Law) or not law.fits(mechanism) or law.formulas in known:
            continue
        known.append(law.formulas)
        every.append(Contender(name))
        if law.uses_switching:
            every += [Contender(name, switching) for switching in _BOTH if switching != own]
    return every


Function = Callable[[TickInput, Array], Any]
"""
Controller: torques (joints) in N·m for a state and a reference (3, axes).

The state has the fields of `TickInput`; the reference is x_d and its two derivatives.
"""

Controller = Function | type
"""Controller, or a class whose instance is one; each run has a separate instance."""

OPTION = '--controller'
"""Option that names a controller."""

TOPICS = 'topics:'
"""Start of the option for a controller in another process; the name of its row follows."""

_LOST = 10.0
"""Norm of the task error in m or rad beyond which a controller that fails has lost the path."""


class MistakeOfControllerError(UserError):
    """Error in the code of a controller, which must not count as a lost run."""


class _ForeignLaw:
    """Law in plain Python around a controller; derived classes name it."""

    parameters: tuple[Parameter, ...] = ()
    name: ClassVar[str]
    controller: ClassVar[tuple[Controller]]
    """Controller, in a tuple because a function in a class would become a method."""

    def __init__(self) -> None:
        """Initialise the law as at the start of a run."""
        (controller,) = self.controller
        try:
            self._act = controller() if isinstance(controller, type) else controller
        except Exception as error:
            raise self._mistake(place_and_text(error)) from error

    def step(self, tick: TickInput) -> tuple[Array, Array]:
        """
        Return the torques of the controller, and the estimate unmodified.

        Raises MistakeOfControllerError for an error and for a result of another shape. If the
        robot is far from the path, an error is an InputError: a run that diverged.
        """
        try:
            with np.errstate(all='ignore'):
                result = self._act(tick, tick.reference)
                torque = np.asarray(result, np.float64)
        except MistakeOfControllerError:
            raise
        except Exception as error:
            if not np.linalg.norm(tick.error) < _LOST:
                raise InputError(f'{OPTION} {self.name}: {error}') from error
            raise self._mistake(place_and_text(error)) from error
        if torque.shape != tick.commanded.shape:
            raise self._mistake(
                f'its result has the shape {torque.shape}, expected {tick.commanded.shape}: a '
                'torque in N·m for each joint'
            )
        return torque, tick.estimate

    def _mistake(self, text: str) -> MistakeOfControllerError:
        return MistakeOfControllerError(f'{OPTION} {self.name}: {text}')


def loaded_controllers(texts: Sequence[str]) -> dict[str, Controller]:
    """
    Return the controllers of several options by name.

    Raises InputError as `loaded`, and for two controllers of one name.
    """
    controllers: dict[str, Controller] = {}
    for text in texts:
        name, controller = loaded(text)
        if name in controllers:
            raise InputError(f"{OPTION} '{text}': another controller has the name '{name}'")
        controllers[name] = controller
    return controllers


def loaded(text: str) -> tuple[str, Controller]:
    """
    Return name and controller of FILE.py:NAME, the form of the option.

    Modules next to the file can be imported by it. Raises InputError with one line if there is
    no such file or name, or if its code fails.
    """
    file, _, name = text.rpartition(':')
    path = Path(file)
    if path.suffix != '.py' or not name.isidentifier():
        raise InputError(
            f"{OPTION} '{text}': expected FILE.py:NAME, a function or a class, or {TOPICS}NAME,"
            ' a node'
        )
    if not path.is_file():
        raise InputError(f"{OPTION} '{text}': there is no file {path}")
    spec = spec_from_file_location(path.stem, path.resolve())
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    folder = str(path.resolve().parent)
    if folder not in sys.path:
        sys.path.append(folder)
    with reported(f"{OPTION} '{text}'", (), str(path)):
        spec.loader.exec_module(module)
    controller = getattr(module, name, None)
    if not callable(controller):
        known = [n for n, v in vars(module).items() if callable(v) and not n.startswith('_')]
        raise InputError(
            f"{OPTION} '{text}': {path} has no function or class '{name}';"
            f' {suggestion(name, known)}'
        )
    return name, controller


def enter(name: str, controller: Controller) -> None:
    """
    Make a controller selectable as `law` in this process; a previous one is replaced.

    Raises InputError if a law has the name.
    """
    known = registry.load(name) if name in registry.names() else None
    if known is not None and not is_foreign(known):
        raise InputError(f"{OPTION} '{name}': a law has this name; expected another one")
    law = type(name, (_ForeignLaw,), {
        'name': name, 'controller': (controller,), '__doc__': controller.__doc__,
    })  # fmt: skip
    add_plug_in(registry.ENTRY_POINTS, name, law)
    registry.load.cache_clear()


def is_foreign(law: object) -> bool:
    """Return True for the law of a controller from elsewhere."""
    return isinstance(law, type) and issubclass(law, _ForeignLaw)


def summary_of(name: str) -> str:
    """Return what a law or a controller is: one line, empty if it is unknown."""
    law = registry.load(name)
    if isinstance(law, Law):
        return law.summary
    lines: Sequence[str] = (law.__doc__ or '').strip().splitlines()
    return lines[0] if lines else ''
