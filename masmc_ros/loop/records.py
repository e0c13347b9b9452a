# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Records of compiled code, built from the declarations of laws, plant and parameters."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
import hashlib
import inspect
import math
from pathlib import Path

from masmc_ros.aliases import Records
from masmc_ros.errors import InputError
from masmc_ros.jit.field import Field, field_of
from masmc_ros.jit.record import AT_RUN_TIME, fill, new_record
from masmc_ros.jit.sized_records import SHARED
from masmc_ros.law.command_interface import (
    by_velocity,
    COMMAND_INTERFACE,
    COMMAND_INTERFACES,
    EFFORT,
    takes_rates,
)
from masmc_ros.law.declared import Declared, declared_for
from masmc_ros.law.fields import Memory, Settings
from masmc_ros.law.law import Law
from masmc_ros.law.parts import delay_compensation, delay_fields, joint_limits
from masmc_ros.law.parts.model import MODEL_SCALE, PAYLOAD_COM, PAYLOAD_INERTIA, PAYLOAD_MASS
from masmc_ros.law.parts.moving_base import BY_TORQUE, BY_VELOCITY
from masmc_ros.law.registry import parameters, REACHING, shared_parameters
from masmc_ros.loop.signals import SIGNALS, TRACKED
from masmc_ros.params.declaration import Parameter, Values
from masmc_ros.plant_model import joint_effects
from masmc_ros.plant_model.plant_fields import PlantMemory, PlantSettings
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.robot import Robot
import numpy as np
from numpy.typing import NDArray


def law_settings(
    mechanism: Mechanism,
    law: Law,
    switching: str,
    lanes: int = 1,
    *,
    is_hybrid: bool = False,
    compensated: bool = False,
    limited: bool = False,
) -> Records:
    """
    Return the settings of a law, all zero: shared parameters and those of the law.

    `is_hybrid`: the base follows velocities, and the arm torques. `compensated`: latency is
    compensated. `limited`: joint limits are enforced.
    """
    shared = _fields_of(mechanism, shared_parameters(mechanism))
    own = _fields_of(mechanism, law.parameters)
    further = (
        *(joint_limits.LimitSettings if limited else ()),
        *(delay_fields.CompensationSettings if compensated else ()),
    )
    first = (*further, *Settings, *shared)
    tags = {
        'mechanism': mechanism.tag,
        'base': BY_VELOCITY if is_hybrid else BY_TORQUE,
        'compensation': delay_compensation.ON if compensated else delay_compensation.OFF,
        'limits': joint_limits.ON if limited else joint_limits.OFF,
        **_shared(first),
        'law': law_tag(law),
        'switching': switching if law.uses_switching else '',
    }
    return new_record((*first, *own), mechanism.sizes, lanes, tags, is_constant=True)


def _fields_of(mechanism: Mechanism, declared: Iterable[Declared]) -> list[Field]:
    fields = map(field_of, declared_for(mechanism, declared))
    return [field for field in fields if field is not None]


def _shared(first: Iterable[Field]) -> dict[str, str]:
    """Return the tag of a record whose first fields do not depend on the law."""
    return {SHARED: str(len({field.name for field in first}))}


def write_law(
    settings: Records,
    robot: Robot,
    period: float,
    values: Values,
    lane: int | None = None,
) -> None:
    """Write the settings of a law that are not parameters: nominal robot and control period."""
    fill(settings, 'geometry', robot.geometry, lane)
    fill(settings, 'nominal', nominal_theta(robot, values), lane)
    fill(settings, 'period', period, lane)
    fill(settings, 'takes_rates', takes_rates(values), lane)
    fill(settings, 'by_velocity', by_velocity(values, robot.mechanism), lane)
    fill(settings, 'group', robot.mechanism.group_of_joints, lane)
    if is_limited(values, robot.mechanism):
        kept = joint_limits.kept_limits(robot.mechanism)
        for field, limit in zip(joint_limits.LimitSettings, kept, strict=True):
            fill(settings, field.name, limit, lane)


def nominal_theta(robot: Robot, values: Values) -> NDArray[np.float64]:
    """
    Return theta (parameters) of the nominal model: the scaled robot, and the announced payload.

    Raises InputError if the type of robot has no payload.
    """
    scaled = replace(robot, theta=MODEL_SCALE.of(values) * robot.theta)
    if PAYLOAD_MASS.of(values) == 0.0:
        return scaled.theta
    centre, inertia = np.array(PAYLOAD_COM.of(values)), np.array(PAYLOAD_INERTIA.of(values))
    return scaled.theta_with_payload(PAYLOAD_MASS.of(values), centre, inertia)


def law_tag(law: Law) -> str:
    """Return the tag of the compiled code of a law: its name, and a digest of a plug-in."""
    return f'{law.name} {_digest(law)}'.rstrip()


def law_memory(
    mechanism: Mechanism,
    law: Law,
    lanes: int = 1,
    *,
    compensated: bool = False,
    limited: bool = False,
) -> Records:
    """Return the initial memory of a law; see `law_settings`."""
    shared = _memory_fields(compensated=compensated, limited=limited)
    return new_record((*shared, *law.memory), mechanism.sizes, lanes, _shared(shared))


def of_tick_before(
    law: Law, *, compensated: bool = False, limited: bool = False
) -> tuple[str, ...]:
    """Return the names of memory fields from the previous tick: their initial value is NaN."""
    fields = (*_memory_fields(compensated=compensated, limited=limited), *law.memory)
    return tuple(field.name for field in fields if math.isnan(field.initial))


def _memory_fields(*, compensated: bool, limited: bool = False) -> tuple[Field, ...]:
    """Return the memory that all laws share."""
    terms = (field for term in REACHING.values() for field in term.memory)
    # In front: Numba would accept a record with more fields at its end as one without them.
    further = (
        *(joint_limits.LimitMemory if limited else ()),
        *(delay_fields.CompensationMemory if compensated else ()),
    )
    return (*further, *Memory, *terms)


def is_limited(values: Values, mechanism: Mechanism) -> bool:
    """
    Return True if a controller with these parameter values keeps the limits of the joints.

    Raises InputError for commanded velocities, and for a robot without any limit.
    """
    name, enforce = joint_limits.CHOICE.name, joint_limits.ENFORCE
    if values[name] != enforce:
        return False
    interface = COMMAND_INTERFACE.of(values)
    if interface != COMMAND_INTERFACES[EFFORT]:
        raise InputError(
            f'{name} = {enforce}: expected {joint_limits.IGNORE} with {COMMAND_INTERFACE.name} '
            f'{interface}, because only torques are changed, or effort'
        )
    if not any(np.isfinite(limit).any() for limit in joint_limits.kept_limits(mechanism)):
        raise InputError(
            f'{name} = {enforce}: no joint has a limit; expected robot.speed_limits, a URDF with '
            f'limits, or {joint_limits.IGNORE}'
        )
    return True


def is_compensated(values: Values) -> bool:
    """
    Return True if a controller with these parameter values compensates latency.

    Raises InputError for commanded velocities of all joints, whose motion is not predicted.
    """
    is_on = delay_fields.is_compensated(values)
    if is_on and takes_rates(values):
        *names, last = delay_fields.ENABLING
        raise InputError(
            f'command_interface = velocity: expected {", ".join(names)} and {last} 0, because '
            'only torques are compensated, or effort or hybrid'
        )
    return is_on


def plant_settings(
    mechanism: Mechanism, lanes: int = 1, *, has_effects: bool = False
) -> Records:
    """
    Return the settings of a plant, all zero.

    `has_effects`: motors lag, joints stick or are elastic in a lane.
    """
    has_effects |= AT_RUN_TIME in mechanism.sizes
    tags = {
        'mechanism': mechanism.tag,
        'effects': joint_effects.ON if has_effects else joint_effects.OFF,
    }
    return new_record((*PlantSettings,), mechanism.sizes, lanes, tags, is_constant=True)


def plant_memory(mechanism: Mechanism, lanes: int = 1) -> Records:
    """Return the memory of a plant."""
    return new_record((*PlantMemory,), mechanism.sizes, lanes)


def signals(mechanism: Mechanism, lanes: int = 1) -> Records:
    """Return the signals of a tick."""
    return new_record(SIGNALS, mechanism.sizes, lanes)


def tracked(mechanism: Mechanism, lanes: int = 1) -> Records:
    """Return the record of `TRACKED`."""
    return new_record(TRACKED, mechanism.sizes, lanes)


def read_by(
    settings: Records, mechanism: Mechanism, declared: Iterable[Parameter] | None = None
) -> tuple[tuple[Parameter, str], ...]:
    """
    Return the parameters with a field in the settings of a law, and the names of the fields.

    `declared` are the parameters; None for those of all installed laws.
    """
    declared = parameters(mechanism) if declared is None else declared
    fields = ((parameter, field_of(parameter)) for parameter in declared)
    names = settings.dtype.names or ()
    return tuple(
        (parameter, field.name) for parameter, field in fields if field and field.name in names
    )


def write_parameters(
    settings: Records,
    read: tuple[tuple[Parameter, str], ...],
    values: Values,
    lane: int | None = None,
) -> None:
    """
    Write checked parameter values into the settings of a law.

    Parameters
    ----------
    settings
        Records of the settings.
    read
        Parameters with a field in the settings, as returned by `read_by`.
    values
        Checked values by parameter name.
    lane
        Lane to write; None: all.

    """
    for parameter, field in read:
        value = values[parameter.name]
        if parameter.kind == 'string':
            value = parameter.known_choices().index(value)
        fill(settings, field, value, lane)


def _digest(law: Law) -> str:
    """Return a digest of the source of a plug-in law; '' for a law of this package."""
    path = inspect.getsourcefile(getattr(law.torque, 'py_func', law.torque))
    if path is None or Path(path).is_relative_to(Path(__file__).parents[1]):
        return ''
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()[:12]
