# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Types of settings, memory and signals in formulas, compared with those of their records."""

from __future__ import annotations

from collections.abc import Iterable
import inspect
import typing

from masmc_ros.jit.field import Field
from masmc_ros.law.declared import declared_for
from masmc_ros.law.fields import Memory, Settings, SharedParameters
from masmc_ros.law.law import Law
from masmc_ros.law.registry import LAWS, OF_RATES, shared_parameters
from masmc_ros.loop import records
from masmc_ros.loop.signals import SIGNALS
from masmc_ros.plant_model.plant_fields import Signals
from masmc_ros.robot.formula_types import MechanismParameters
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


def annotations(*classes: type) -> dict[str, str]:
    """Return the annotations of classes and their bases."""
    return {
        name: kind
        for cls in classes
        for base in cls.__mro__[:-1]
        for name, kind in inspect.get_annotations(base).items()
    }


def test_field_types_of_shared_parameters_equal_declarations() -> None:
    declared = map(records.field_of, shared_parameters(TWO_LINK))
    assert annotations(SharedParameters, MechanismParameters) == types_of(declared)


def test_field_types_of_signals_equal_declarations() -> None:
    assert annotations(Signals) == types_of(SIGNALS)


@pytest.mark.parametrize('law', [*LAWS.values(), OF_RATES], ids=lambda law: law.name)
def test_field_types_of_law_equal_fields_of_its_records(law: Law) -> None:
    """A law whose formulas read a class that it does not declare would fail here."""
    settings: dict[str, str] = {}
    memory: dict[str, str] = {}
    for formula in (law.torque, law.learn, law.post_update):
        hints = typing.get_type_hints(inspect.unwrap(formula))
        settings |= annotations(hints['settings'])
        memory |= annotations(hints['memory'])
    own = declared_for(TWO_LINK, (*shared_parameters(TWO_LINK), *law.parameters))
    assert settings == types_of((*Settings, *map(records.field_of, own)))
    assert memory == types_of((*Memory, *law.memory))
