# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Lifecycle of the controller: states and transitions of a ROS 2 managed node.

Numbers and labels are those of lifecycle_msgs. The supervisor's mode determines the state, so
services and faults change it as well.
"""

from __future__ import annotations

from typing import NamedTuple

from masmc_ros.control.supervisor import Supervisor


class LifecycleState(NamedTuple):
    """Primary state of a managed node, with its number and label in lifecycle_msgs."""

    number: int
    label: str


UNCONFIGURED = LifecycleState(1, 'unconfigured')
INACTIVE = LifecycleState(2, 'inactive')
ACTIVE = LifecycleState(3, 'active')
FINALIZED = LifecycleState(4, 'finalized')
STATES = (UNCONFIGURED, INACTIVE, ACTIVE, FINALIZED)


class Transition(NamedTuple):
    """Transition between two states, with its number and label in lifecycle_msgs."""

    number: int
    label: str
    start: LifecycleState
    goal: LifecycleState


TRANSITIONS = (
    Transition(1, 'configure', UNCONFIGURED, INACTIVE),
    # The controller starts configured. Lifecycle managers configure every node first.
    Transition(1, 'configure', INACTIVE, INACTIVE),
    Transition(2, 'cleanup', INACTIVE, UNCONFIGURED),
    Transition(3, 'activate', INACTIVE, ACTIVE),
    Transition(4, 'deactivate', ACTIVE, INACTIVE),
    Transition(5, 'shutdown', UNCONFIGURED, FINALIZED),
    Transition(6, 'shutdown', INACTIVE, FINALIZED),
    Transition(7, 'shutdown', ACTIVE, FINALIZED),
)


def state_of(supervisor: Supervisor) -> LifecycleState:
    """
    Return the lifecycle state of a mode.

    A passing fault is `active`: it ends without a request, and `deactivate` must prevent that.
    """
    if supervisor.is_shut_down:
        return FINALIZED
    if not supervisor.is_configured:
        return UNCONFIGURED
    is_passing = supervisor.is_fault and not supervisor.is_latched
    return ACTIVE if supervisor.is_active or is_passing else INACTIVE


def transitions_from(state: LifecycleState) -> tuple[Transition, ...]:
    """Return the transitions that are available in a state."""
    return tuple(transition for transition in TRANSITIONS if transition.start == state)


def find_transition(state: LifecycleState, number: int, label: str) -> Transition | None:
    """
    Return a transition that is available in a state; None if there is no such transition.

    A label takes precedence over the number, which is 0 in requests with a label only.
    """
    for transition in transitions_from(state):
        if transition.label == label if label else transition.number == number:
            return transition
    return None
