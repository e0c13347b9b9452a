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

"""
What a tree's formulas need that does not change while it moves, as one vector of numbers.

Records keep it as a mechanism's lengths; `unpacked` makes arrays of it again.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from masmc_ros.numerics.compiled import kernel
from masmc_ros.robot.tree.dynamics import Tree
import numpy as np
from numpy.typing import ArrayLike, NDArray


class TreeModel(NamedTuple):
    """A tree, how its wheels drive it, and its task."""

    tree: Tree
    wheel_rates: Any
    """(m, m) rates of the wheels from those of the base, m = 0, 2 or 3 by its kind."""
    base_rates: Any
    """(m, m) the inverse."""
    tip: int
    """Body of the frame that has a task."""
    tip_rotation: Any
    """(9) of the frame in the body's."""
    tip_offset: Any
    """(3) in m."""
    mobility: Any
    """(n) how much each velocity moves for the task: inverse weights."""
    posture: Any
    """(n) what the joints' positions tend to where the task leaves them free, in rad or m."""
    posture_gain: float
    """How fast they do, in 1/s."""
    damping: float
    """Rate kappa in 1/s at which velocities that the task does not see go to their reference."""
    least_pivot: float
    """Of J W^-1 J', below which the task is singular and its inverse damped."""


_SCALARS = 6

ONE = (0.0,)
"""One lane: records are taken lane by lane."""


def packed(
    tree: Tree,
    wheel_rates: ArrayLike,
    tip: tuple[int, Sequence[float], Sequence[float]],
    mobility: ArrayLike,
    posture: ArrayLike,
    posture_gain: float,
    damping: float,
    least_pivot: float,
) -> NDArray[np.float64]:
    """Return the vector that `unpacked` takes; arguments as the fields of `TreeModel`."""
    wheels = np.asarray(wheel_rates, dtype=np.float64).reshape(tree.base, tree.base)
    body, rotation, offset = tip
    parts: tuple[Any, ...] = (
        (len(tree.parent), tree.base, body, posture_gain, damping, least_pivot),
        tree.parent, tree.kind, tree.axis, tree.rotation, tree.offset, tree.armature,
        wheels, np.linalg.inv(wheels) if len(wheels) else wheels,
        rotation, offset, mobility, posture,
    )  # fmt: skip
    return np.concatenate([np.asarray(part, dtype=np.float64).ravel() for part in parts])


@kernel
def unpacked(lengths: Any, lane: int) -> TreeModel:
    """Return the model that a record's field (numbers, lanes) holds in a lane."""
    flat = np.empty(len(lengths))
    for i in range(len(lengths)):
        flat[i] = lengths[i, lane]
    bodies, base = int(flat[0]), int(flat[1])
    size = base + bodies - 1
    parent, kind = np.empty(bodies, np.int64), np.empty(bodies, np.int64)
    at = _SCALARS
    for i in range(bodies):
        parent[i] = int(flat[at + i])
        kind[i] = int(flat[at + bodies + i])
    at += 2 * bodies
    axis = flat[at:at + 3 * bodies].reshape((bodies, 3, 1))
    at += 3 * bodies
    rotation = flat[at:at + 9 * bodies].reshape((bodies, 9, 1))
    at += 9 * bodies
    offset = flat[at:at + 3 * bodies].reshape((bodies, 3, 1))
    at += 3 * bodies
    armature = flat[at:at + size * size].reshape((size, size))
    at += size * size
    wheel_rates = flat[at:at + base * base].reshape((base, base))
    at += base * base
    base_rates = flat[at:at + base * base].reshape((base, base))
    at += base * base
    return TreeModel(
        Tree(base, parent, kind, axis, rotation, offset, armature, ONE),
        wheel_rates,
        base_rates,
        int(flat[2]),
        flat[at:at + 9],
        flat[at + 9:at + 12],
        flat[at + 12:at + 12 + size],
        flat[at + 12 + size:at + 12 + 2 * size],
        flat[3],
        flat[4],
        flat[5],
    )
