# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Type aliases of numbers, vectors and arrays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Numbers = tuple[float, ...]
"""
Vector in a formula: one number per joint, task axis or inertial parameter.

Compiled code has a tuple if the length is constant, and a vector of `jit.vectors` for robots
described by a URDF.
"""

Axes = Annotated[Numbers, 'axes']
"""Vector of a formula with one number per task axis."""

Joints = Annotated[Numbers, 'joints']
"""Vector of a formula with one number per driven joint, or per velocity of the mechanism."""

Parameters = Annotated[Numbers, 'parameters']
"""Vector of a formula with one number per base inertial parameter."""

BasePose = Annotated[Numbers, 'base']
"""Vector of a formula with one number per coordinate of the base pose."""

Positions = Annotated[Numbers, 'positions']
"""Vector of a formula with the base pose, then one number per joint."""

Columns = tuple[Numbers, ...]
"""Matrix in a formula, as a tuple of its columns."""

Array = NDArray[np.float64]
"""Array of numbers with any shape, outside of compiled code or as the argument of a kernel."""

Stamps = NDArray[np.int64]
"""Array of times in nanoseconds."""

Integers = NDArray[np.int64]
"""Array of whole numbers with any shape."""

Indices = NDArray[np.intp]
"""Array of indices into another array."""

Bytes = NDArray[np.uint8]
"""Bytes of a message."""

Flags = NDArray[np.bool_]
"""Array of truth values with any shape."""

AnyArray = NDArray[np.generic]
"""Array whose numbers can have any type."""

Function = Callable[..., Any]
"""Function or formula with any arguments."""

AnyFunction = TypeVar('AnyFunction', bound=Function)
"""Function whose decorator keeps its type."""

Record = np.void
"""One record with all of its lanes, an entry of `Records` (`jit.record`)."""

Records = NDArray[np.void]
"""Array of records; settings, memory and signals are arrays of one record."""
