# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The columns of an exported run: a row a state."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

from masmc_ros.log.read.reader import Run
from masmc_ros.messages.names import DERIVATIVES
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
_Part = tuple[Floats, NDArray[np.bool_]]


class Column(NamedTuple):
    """A column; its name ends with its unit, `per` for a stroke."""

    quantity: str
    unit: str

    @property
    def name(self) -> str:
        """Return what stands above it."""
        return f'{self.quantity}_{self.unit}'


def _unit(text: str) -> str:
    """Return a unit as names of columns have it: kg_m2 for kg·m²."""
    return text.replace('·', '_').replace('²', '2').replace('/', '_per_')


def columns_of(run: Run) -> tuple[Column, ...]:
    """Return the columns of a run: those of torques, of rates, or of both where both were sent."""
    mechanism = run.mechanism
    units = [each.unit for each in mechanism.positions]
    axes = [axis.name for axis in mechanism.axes]
    torques, rates = _sent(run)
    joints = run.joint_names
    driven = joints[len(mechanism.base):]
    twist = [
        Column(f'command_{each.name.replace(" ", "_")}', _unit(each.unit))
        for each in mechanism.twist
    ]
    rated = driven[len(twist):]
    derivatives = (('position', 'm'), ('velocity', 'm_per_s'), ('acceleration', 'm_per_s2'))
    return (
        Column('time', 's'),
        *(Column(f'position_{j}', unit) for j, unit in zip(joints, units, strict=True)),
        *(Column(f'velocity_{j}', f'{u}_per_s') for j, u in zip(joints, units, strict=True)),
        *(Column(f'applied_effort_{joint}', 'N_m') for joint in driven),
        *((Column(f'command_{joint}', 'N_m') for joint in driven) if torques else ()),
        # What drives are told that take no torques.
        *((*twist, *(Column(f'command_{j}', 'rad_per_s') for j in rated)) if rates else ()),
        *(Column(f'reference_{d}_{a}', unit) for (d, unit), a in product(derivatives, axes)),
        *(Column(f'error_{axis}', 'm') for axis in axes),
        *(Column(f'surface_{axis}', 'm_per_s') for axis in axes),
        *(Column(f'estimate_{each.name}', _unit(each.unit)) for each in mechanism.theta),
        # What a law asked for, before its torques were limited.
        *((Column(f'raw_torque_{joint}', 'N_m') for joint in driven) if torques else ()),
    )


def _sent(run: Run) -> tuple[bool, bool]:
    """Return whether a run has columns of torques and columns of rates."""
    return not run.commands_rates, bool(len(run.cmd_vel) or len(run.arm_rates))


def table_of(run: Run) -> tuple[Floats, NDArray[np.bool_]]:
    """
    Return the numbers of a run (n, len(columns_of(run))), and which of them the log has.

    What was sent at other times than the states stands with the last state before it; of
    several there, the last counts.
    """
    states = np.column_stack((run.times, run.position, run.velocity, run.applied_effort))
    reference = run.reference
    mechanism = run.mechanism
    axes, joints, twist = map(len, (mechanism.axes, mechanism.joints, mechanism.twist))
    if reference is None:
        reference = np.full((len(run.times), DERIVATIVES * axes), np.nan)

    def at_states(times: Floats | None, sent: Floats | None, width: int) -> _Part:
        return _at_states(run.times, times, sent, width)

    torques, rates = _sent(run)
    parts = [(states, ~np.isnan(states))]
    if torques:
        parts.append(at_states(run.torque_times, run.torque, joints))
    if rates:
        parts.append(at_states(run.cmd_vel_times, run.cmd_vel, twist))
        parts.append(at_states(run.arm_rate_times, run.arm_rates, joints - twist))
    parts += (
        (reference, ~np.isnan(reference)),
        at_states(run.tracking_error_times, run.tracking_error, axes),
        at_states(run.sliding_surface_times, run.sliding_surface, axes),
        at_states(
            run.parameter_estimate_times, run.parameter_estimate, len(mechanism.theta)
        ),
    )
    if torques:
        parts.append(at_states(run.raw_torque_times, run.raw_torque, joints))
    values, known = zip(*parts, strict=True)
    return np.hstack(values), np.hstack(known)


def _at_states(states: Floats, times: Floats | None, sent: Floats | None, width: int) -> _Part:
    """Return what was sent (m, width) in the rows of the states (n), and which rows have it."""
    values = np.zeros((len(states), width))
    known = np.zeros((len(states), width), bool)
    if times is not None and sent is not None:
        rows = np.searchsorted(states, times, side='right') - 1
        is_after = rows >= 0
        values[rows[is_after]] = sent[is_after]
        known[rows[is_after]] = True
    return values, known
