# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Control laws and reaching terms by name: those of this folder, and plug-ins.

A new law or reaching term needs a file next to the others and one line here.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from masmc_ros.errors import InputError
from masmc_ros.law.adaptive.composite_adaptation import COMPOSITE_ADAPTATION
from masmc_ros.law.adaptive.concurrent_learning import CONCURRENT_LEARNING
from masmc_ros.law.adaptive.fuzzy_gain import FUZZY_GAIN
from masmc_ros.law.adaptive.fuzzy_model import FUZZY_MODEL
from masmc_ros.law.adaptive.hybrid_network import HYBRID_NETWORK
from masmc_ros.law.adaptive.rbf_sliding import RBF_SLIDING
from masmc_ros.law.command_interface import COMMAND_INTERFACE, ENABLE_STAMPED_CMD_VEL
from masmc_ros.law.declared import declared_for
from masmc_ros.law.feedback.computed_torque import COMPUTED_TORQUE
from masmc_ros.law.feedback.input_output_decoupling import INPUT_OUTPUT_DECOUPLING
from masmc_ros.law.feedback.nonlinear_feedback import NONLINEAR_FEEDBACK
from masmc_ros.law.feedback.null_space import NULL_SPACE
from masmc_ros.law.feedback.pd_gravity import PD_GRAVITY
from masmc_ros.law.feedback.pid import PID
from masmc_ros.law.law import Law
from masmc_ros.law.observing.momentum_observer import MOMENTUM_OBSERVER
from masmc_ros.law.observing.time_delay import TIME_DELAY
from masmc_ros.law.parts import (
    adaptation,
    delay_fields,
    joint_limits,
    model,
    moving_base,
    velocity_estimator,
)
from masmc_ros.law.plug_in import PlugInLaw
from masmc_ros.law.rasmc import RASMC
from masmc_ros.law.rates import RATES
from masmc_ros.law.reaching.implicit import IMPLICIT
from masmc_ros.law.reaching.saturation import SATURATION
from masmc_ros.law.reaching.sigmoid import SIGMOID
from masmc_ros.law.reaching.sign import SIGN
from masmc_ros.law.reaching.tanh import TANH
from masmc_ros.law.sliding.adaptive_gain import ADAPTIVE_GAIN
from masmc_ros.law.sliding.adaptive_super_twisting import ADAPTIVE_SUPER_TWISTING
from masmc_ros.law.sliding.barrier import BARRIER
from masmc_ros.law.sliding.decentralised_sliding import DECENTRALISED_SLIDING
from masmc_ros.law.sliding.super_twisting import SUPER_TWISTING
from masmc_ros.law.sliding.terminal import TERMINAL
from masmc_ros.law.sliding.variable_structure import VARIABLE_STRUCTURE
from masmc_ros.law.smc import SMC
from masmc_ros.params.declaration import Parameter
from masmc_ros.params.plug_ins import load_plug_in, plugged_in
from masmc_ros.robot.declaration import Mechanism

LAWS = {
    law.name: law
    for law in (
        SMC,
        RASMC,
        NONLINEAR_FEEDBACK,
        # laws that the paper cites
        COMPUTED_TORQUE,
        NULL_SPACE,
        INPUT_OUTPUT_DECOUPLING,
        RBF_SLIDING,
        DECENTRALISED_SLIDING,
        ADAPTIVE_GAIN,
        FUZZY_GAIN,
        VARIABLE_STRUCTURE,
        FUZZY_MODEL,
        HYBRID_NETWORK,
        # baselines, and recent laws
        PID,
        PD_GRAVITY,
        SUPER_TWISTING,
        ADAPTIVE_SUPER_TWISTING,
        BARRIER,
        TERMINAL,
        TIME_DELAY,
        MOMENTUM_OBSERVER,
        COMPOSITE_ADAPTATION,
        CONCURRENT_LEARNING,
    )
}
"""Built-in choices of `law`, first the laws of the paper."""

OF_RATES = RATES
"""Law of commanded rates, independent of `law`."""

REACHING = {term.name: term for term in (SIGN, SATURATION, TANH, SIGMOID, IMPLICIT)}
"""Choices of `switching`."""

SWITCHING = tuple(REACHING)

LAW = Parameter('law', 'rasmc', 'Control law', read_only=False)
"""Parameter without its choices; plug-in laws are known when a node declares it."""

SWITCHING_TERM = Parameter(
    'switching',
    'implicit',
    'Switching term: the sign, a smooth approximation of it, or implicit Euler',
    choices=SWITCHING,
    read_only=False,
)

ENTRY_POINTS = 'masmc_ros.laws'
"""Group of entry points of plug-in laws."""


def names() -> tuple[str, ...]:
    """Return the names of all laws, built in and plugged in."""
    return (*LAWS, *_own())


def _own() -> tuple[str, ...]:
    """Return the names of plug-in laws, except names of built-in laws."""
    return tuple(name for name in plugged_in(ENTRY_POINTS) if name not in LAWS)


@cache
def load(name: str) -> Law | type[PlugInLaw]:
    """
    Return a law: a compiled one, or a class in plain Python.

    Raises
    ------
    InputError
        If a plug-in law cannot be loaded.

    """
    if name in LAWS:
        return LAWS[name]
    law: Law | type[PlugInLaw] = load_plug_in(ENTRY_POINTS, 'law', name)
    if isinstance(law, Law) and law.name != name:
        raise InputError(f'law = {name}: its Law is called {law.name}, expected {name}')
    return law


def uses_switching(name: str) -> bool:
    """Return True for a law with a reaching term; InputError if a plug-in cannot be loaded."""
    law = load(name)
    return isinstance(law, Law) and law.uses_switching


def load_for(name: str, mechanism: Mechanism) -> Law | type[PlugInLaw]:
    """
    Return the law of this name for a robot.

    Raises
    ------
    InputError
        If `load` raises it, if a plug-in law has the name of a built-in one, or if the law does
        not support the robot.

    """
    if name in LAWS and name in plugged_in(ENTRY_POINTS):
        raise InputError(
            f'law = {name}: an installed package brings a law of this name, which a built-in'
            f' one has; expected another name in its entry points ({ENTRY_POINTS})'
        )
    law = load(name)
    if isinstance(law, Law) and not law.fits(mechanism):
        raise InputError(
            f'law = {name}: the robot has {len(mechanism.theta)} base inertial parameters, '
            f'expected at most {law.most_parameters}'
        )
    return law


def shared_parameters(mechanism: Mechanism) -> tuple[Parameter, ...]:
    """Return the declarations common to all laws: of the paper, reaching terms and parts."""
    return declared_for(
        mechanism,
        (
            replace(LAW, choices=names()),
            *(p for law in (SMC, RASMC) for p in law.parameters),
            SWITCHING_TERM,
            *(p for term in REACHING.values() for p in term.parameters),
            *model.PARAMETERS,
            *adaptation.PARAMETERS,
            *mechanism.law_parameters,
            *joint_limits.PARAMETERS,
            *velocity_estimator.PARAMETERS,
            moving_base.BASE_LAG,
            *delay_fields.PARAMETERS,
            COMMAND_INTERFACE,
            ENABLE_STAMPED_CMD_VEL,
        ),
    )


def parameters(mechanism: Mechanism) -> tuple[Parameter, ...]:
    """
    Return the controller's declarations: common ones, then those of all laws and plug-ins.

    Names are unique and in the order of nodes and tables.
    """
    return declared_for(
        mechanism,
        (
            *shared_parameters(mechanism),
            *(p for law in LAWS.values() for p in law.parameters),
            *(p for name in _own() for p in load(name).parameters),
        ),
    )
