# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Signals of a tick, exchanged between plant, controller, log and report.

A run is an array of records of these signals, one per tick; a node has one record. Signals with
a label have a topic, and therefore appear in logs, reports and exports.
"""

from __future__ import annotations

from dataclasses import dataclass

from masmc_ros.jit.field import Field
import numpy as np
from numpy.typing import NDArray

EACH = '*'
"""Placeholder in the unit of a signal: the unit of its axis or parameter."""


@dataclass(frozen=True)
class Signal(Field):
    """A field of the record of a tick; its unit is '1' for pure numbers."""

    of_plant: bool = False
    """True if the plant writes it, and not the controller."""
    label: str = ''
    """Label of its messages and of their topic; empty without a topic."""
    of_torques: bool = False
    """True if it is defined only when torques are commanded."""
    title: str = ''
    """Title of its plot in the report; empty if it is part of another plot."""
    symbol: str = ''
    """Symbol of a component in that plot."""

    def unit_of(self, unit: str) -> str:
        """Return the unit of a component whose axis or parameter has this unit."""
        return self.unit.replace(EACH, unit)


SIGNALS = (
    Signal('position', 'positions', 'Positions as measured', 'm, rad', of_plant=True),
    Signal('velocity', 'positions', 'Velocities as measured', 'm/s, rad/s', of_plant=True),
    Signal('true_position', 'positions', 'Positions as they are', 'm, rad', of_plant=True),
    Signal('true_velocity', 'positions', 'Velocities as they are', 'm/s, rad/s', of_plant=True),
    Signal('applied', 'joints', 'Torque over the interval that ended', 'N·m', of_plant=True),
    Signal('age', description='Age of the measured state in control periods', unit='1', kind='i8',
           of_plant=True),
    Signal('reference', 'desired', 'x_d, then xdot_d, then xddot_d of the task', 'm'),
    Signal('torque', 'joints', 'Torque commanded', 'N·m'),
    Signal('rates', 'joints', 'Velocities commanded in place of a torque', 'm/s, rad/s'),
    Signal('error', 'axes', 'e = x - x_d', EACH, label='tracking_error'),
    Signal('surface', 'axes', 's = ė + σ e', f'{EACH}/s', label='sliding_surface',
           title='Sliding surface', symbol='s'),
    Signal('estimate', 'parameters', 'θ̂ in the torque', EACH, label='parameter_estimate',
           title='Estimates of the base inertial parameters', symbol='estimate'),
    Signal('raw_torque', 'joints', 'requested torque, before the limits of `effort_commands`',
           'N·m', label='raw_torque', of_torques=True),
    Signal('singular', description='1 if the task is close to singular', unit='1', kind='i8'),
)
"""All signals; the published ones are in the order of topics, columns and plots."""

TRACKED = (
    Field('velocity_error', 'axes', 'Task velocity as measured, less the desired one'),
    Field('true_error', 'axes', 'Error of the true position on the true robot'),
)
"""Tracking of the reference by a robot that is driven from outside; see `track_reference`."""

OF_PLANT = tuple(signal.name for signal in SIGNALS if signal.of_plant)
"""Names of the signals that the plant writes."""

CONTROLLER_INPUTS = ('position', 'velocity', 'reference')
"""Names of the signals that the controller reads."""

PUBLISHED = tuple(signal for signal in SIGNALS if signal.label)
"""Signals that the controller publishes, one topic each."""

CONTACT = (
    Signal('slip_along', description='slip in the rolling direction', unit='m/s'),
    Signal('slip_across', description='slip along the axle', unit='m/s'),
    Signal('normal_force', description='normal force', unit='N'),
    Signal('friction', description='friction', unit='N'),
)
"""Signals of each wheel in contact with the ground."""


def inputs(signals: NDArray[np.void]) -> tuple[NDArray[np.float64], ...]:
    """Return views of the signals (1) of one robot that the controller reads."""
    return tuple(signals[name][0, :, 0] for name in CONTROLLER_INPUTS)


def largest_slip(contact: NDArray[np.float64]) -> float:
    """Return the largest slip of a wheel in m/s, for contact signals (..., n)."""
    contacts = contact.reshape(-1, len(CONTACT))
    return float(np.hypot(contacts[:, 0], contacts[:, 1]).max(initial=0.0))


def least_normal_force(contact: NDArray[np.float64]) -> float:
    """Return the smallest normal force on a wheel in N, for contact signals (..., n)."""
    return float(contact.reshape(-1, len(CONTACT))[:, 2].min())
