# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Dry run of a law before its compilation: mistakes in one line with their place.

The errors of the compiler are pages long. A few ticks of the law in plain Python find most of the
mistakes earlier: unknown names, wrong sizes, missing results. Its lanes know the declared
fields and their sizes. A successful dry run is noted next to the compiled code, so each source of
a law runs dry once per machine.
"""

from __future__ import annotations

from masmc_ros.errors import InputError
from masmc_ros.jit.checked_lane import (
    check_decorators,
    check_vector,
    CheckedLane,
    function_of,
    run_dry_once,
)
from masmc_ros.jit.compiled import interpreted
from masmc_ros.jit.lanes import Lane, lane_of
from masmc_ros.jit.sources import files_of
from masmc_ros.law.declared import declared_for
from masmc_ros.law.law import Law
from masmc_ros.law.registry import parameters, REACHING
from masmc_ros.law.tick import tick_of
from masmc_ros.loop import records
from masmc_ros.mistakes import place_and_text
from masmc_ros.robot import mechanism as formulas
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.robot import Robot
import numpy as np

_PERIOD = 1e-3

_TICKS = 3
"""Number of ticks; the second one has a previous tick, the third a negative velocity."""


def check(law: Law, mechanism: Mechanism, switching: str) -> None:
    """
    Run a law dry, unless it has been run in these sources for this type of robot.

    Parameters
    ----------
    law
        Law, built in or of another package.
    mechanism
        Type of robot.
    switching
        Name of the reaching term.

    Raises
    ------
    InputError
        If the law has a mistake; the message names file and line.

    """
    tags = records.law_tag(law), mechanism.tag, switching if law.uses_switching else ''
    sources = files_of(law.formulas) | files_of(mechanism.formulas)
    if law.uses_switching:
        sources |= files_of(REACHING[switching].formulas)
    run_dry_once(lambda: run_dry(law, mechanism, switching), sources, *tags)


def run_dry(law: Law, mechanism: Mechanism, switching: str) -> None:
    """Run a law in plain Python for some ticks; arguments and errors are those of `check`."""
    term = REACHING[switching] if law.uses_switching else None
    own = [formula for part in (law, term) if part for formula in vars(part.formulas).values()]
    codes = [function_of(formula).__code__ for formula in own]
    files = {code.co_filename for code in codes}
    try:
        check_decorators(own, files)
        with interpreted(), np.errstate(all='ignore'):
            _run(law, mechanism, switching)
    except Exception as error:  # of formulas with any mistake
        start = f'{codes[0].co_filename}:{codes[0].co_firstlineno}'
        raise InputError(f'law = {law.name}: {place_and_text(error, files, start)}') from error


def _robot(mechanism: Mechanism) -> Robot:
    """Return a robot of a type with the defaults of its parameters."""
    own = {p.name.removeprefix('robot.'): p.default for p in mechanism.parameters}
    lengths, theta = mechanism.formulas.constants(own)
    return Robot(mechanism, own, np.array(lengths), np.array(theta))


def _run(law: Law, mechanism: Mechanism, switching: str) -> None:
    robot = _robot(mechanism)
    settings = records.law_settings(mechanism, law, switching)
    memory, signals = records.law_memory(mechanism, law), records.signals(mechanism)
    declared = declared_for(mechanism, (*parameters(mechanism), *law.parameters))
    values = {parameter.name: parameter.default for parameter in declared}
    records.write_law(settings, robot, _PERIOD, values)
    records.write_parameters(settings, records.read_by(settings, mechanism, declared), values)
    memory['estimate'][0, :, 0] = robot.theta
    signals['position'][0, :, 0] = np.linspace(0.1, 0.9, signals['position'].shape[1])
    row, plain = lane_of(signals[0], 0), lane_of(settings[0], 0)
    gains = CheckedLane(settings[0], 'settings')
    state = CheckedLane(memory[0], 'memory', is_writable=True)
    joints, axes = mechanism.sizes['joints'], mechanism.sizes['axes']
    model = formulas.model_of(plain)
    posture = formulas.posture(model, row.position)
    for k in range(_TICKS):
        signals['velocity'][0, :, 0] = 0.1 * (-1) ** k
        rates, reference = row.velocity[-joints:], row.reference
        desired = reference[:axes], reference[axes:2 * axes], reference[2 * axes:]
        v = formulas.motion(model, rates)
        before = Lane(memory[0], 0)
        carried = before.drift, before.velocity_command
        tick = tick_of(plain, posture, v, row.position, row.velocity, desired, *carried)
        raw = law.torque(gains, tick, state)
        check_vector('torque', raw, joints, per='one per joint')
        for torque in (raw, tuple(0.5 * value for value in raw)):
            law.learn(gains, tick, state, raw, torque)
        law.post_update(gains, state)
