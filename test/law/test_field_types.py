# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Types of settings, memory and signals: those of formulas are those of their records."""

from __future__ import annotations

from collections.abc import Iterable
import inspect
import typing

from masmc_ros.jit.field import Field
from masmc_ros.law.declared import declared_for
from masmc_ros.law.fields import Memory, Settings
from masmc_ros.law.law import Law
from masmc_ros.law.parts import delay_fields
from masmc_ros.law.parts.adaptation import REACHING_FORCE
from masmc_ros.law.registry import LAWS, OF_RATES, REACHING, shared_parameters
from masmc_ros.loop import control, records
from masmc_ros.loop.signals import SIGNALS
from masmc_ros.plant_model import plant_tick
from masmc_ros.plant_model.plant_fields import PlantMemory, PlantSettings, Signals
from masmc_ros.robot.two_link.paper_robot import TWO_LINK
import pytest

SIZES = {'axes': 'Axes', 'joints': 'Joints', 'parameters': 'Parameters'}


def type_of(field: Field) -> str:
    """Return the annotation of a field."""
    number = 'float' if field.kind == 'f8' else 'int'
    if field.size == '':
        return number
    if number == 'int':
        return 'tuple[int, ...]'
    return SIZES.get(field.size, 'Numbers') if isinstance(field.size, str) else 'Numbers'


def types_of(fields: Iterable[Field | None]) -> dict[str, str]:
    """Return the annotations of fields by name."""
    return {field.name: type_of(field) for field in fields if field is not None}


def annotations(cls: type) -> dict[str, str]:
    """Return the annotations of a class and its bases."""
    return {
        name: kind for base in cls.__mro__[:-1] for name, kind in base.__annotations__.items()
    }


def declared(law: Law | None) -> tuple[dict[str, str], dict[str, str]]:
    """Return the annotations of settings and memory by the declarations of a law, None: of all."""
    own = (*shared_parameters(TWO_LINK), *(law.parameters if law else ()))
    settings = map(records.field_of, declared_for(TWO_LINK, own))
    terms = (field for term in REACHING.values() for field in term.memory)
    memory = (*control.MEMORY, REACHING_FORCE, *(law.memory if law else ()), *terms)
    return types_of((*control.SETTINGS, *settings)), types_of(memory)


def test_field_types_of_all_laws_equal_declarations() -> None:
    assert (annotations(Settings), annotations(Memory)) == declared(None)


@pytest.mark.parametrize(
    ('cls', 'fields'),
    [
        (PlantSettings, plant_tick.SETTINGS),
        (PlantMemory, plant_tick.MEMORY),
        (Signals, SIGNALS),
    ],
    ids=lambda value: getattr(value, '__name__', ''),
)
def test_field_types_of_plant_and_signals_equal_declarations(
    cls: type, fields: tuple[Field, ...]
) -> None:
    assert annotations(cls) == types_of(fields)


def test_field_types_of_compensation_equal_declarations() -> None:
    settings, memory = declared(None)
    settings |= types_of(delay_fields.SETTINGS)
    memory |= types_of(delay_fields.MEMORY)
    assert annotations(delay_fields.CompensationSettings) == settings
    assert annotations(delay_fields.CompensationMemory) == memory


@pytest.mark.parametrize('law', [*LAWS.values(), OF_RATES], ids=lambda law: law.name)
def test_field_types_of_law_equal_declarations(law: Law) -> None:
    settings: dict[str, str] = {}
    memory: dict[str, str] = {}
    for formula in (law.torque, law.learn, law.post_update):
        hints = typing.get_type_hints(inspect.unwrap(formula))
        settings |= annotations(hints['settings'])
        memory |= annotations(hints['memory'])
    assert (settings, memory) == declared(law)
