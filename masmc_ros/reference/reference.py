# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Interface of a trajectory type, built in or plugged in."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Protocol

from masmc_ros.params.declaration import Parameter
from masmc_ros.robot.declaration import Mechanism
import numpy as np
from numpy.typing import NDArray

Declared = tuple[Parameter, ...] | Callable[[Mechanism], tuple[Parameter, ...]]
"""Declarations of a trajectory type: parameters, or a function of the mechanism."""


class Reference(Protocol):
    """
    A type of trajectory: class attribute `parameters`, made from checked values.

    One that is for certain task axes alone has their names as its class attribute `axes`. One
    that has to know the task has a class method `of(values, mechanism)`, which makes it then.
    """

    parameters: ClassVar[Declared]

    def __init__(self, values: Mapping[str, Any]) -> None:
        """Take checked values, names without the type's prefix."""

    def sample(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (n, 3 axes) samples at times (n) in s: positions, velocities, accelerations."""
        ...


def made(kind: type[Reference], values: Mapping[str, Any], mechanism: Mechanism) -> Reference:
    """Return a trajectory of a type from checked values; InputError if it rejects them."""
    of: Callable[[Mapping[str, Any], Mechanism], Reference] | None = getattr(kind, 'of', None)
    return kind(values) if of is None else of(values, mechanism)
