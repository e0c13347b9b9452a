# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Gymnasium environments of the simulated robots, for learned controllers.

The import of this module registers `ENVIRONMENT`; that of `masmc_ros` does not import Gymnasium.
docs/guides/learning.md describes observation, action, reward and episodes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gymnasium import Env, register
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from masmc_ros.aliases import AnyArray, Array, Flags
from masmc_ros.api.episodes import Episodes, Infos
from masmc_ros.api.scenario import Scenario
import numpy as np

ENVIRONMENT = 'masmc/MobileManipulator-v0'
"""Name of the environment."""


class MobileManipulator(Env[Array, Array]):
    """
    One robot, computed alone.

    Attributes
    ----------
    episodes
        Robot with its current episode; `episodes.entries` has the names of an observation.

    """

    # Gymnasium declares no class variable.
    metadata: dict[str, object] = {'render_modes': []}  # noqa: RUF012

    def __init__(self, scenario: str | Path | Scenario = 'paper', **options: Any) -> None:
        """Initialise the environment; see `Episodes` for the options and errors."""
        self.episodes = Episodes(1, scenario, **options)
        self.observation_space, self.action_space = _spaces(self.episodes)

    def reset(
        self, *, seed: int | None = None, options: dict[str, object] | None = None
    ) -> tuple[Array, dict[str, object]]:
        """Start the next episode; with a seed, its first episode."""
        super().reset(seed=seed)
        observations, infos = _reset(self, seed)
        return observations[0], infos[0]

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, object]]:
        """Hold torques (joints) in N·m for one control period."""
        done = self.episodes.step(np.asarray(action)[None])
        return (
            done.observation[0],
            float(done.reward[0]),
            bool(done.terminated[0]),
            bool(done.truncated[0]),
            done.infos.get(0, {}),
        )


class MobileManipulators(VectorEnv[Array, Array, AnyArray]):
    """
    Several robots, computed in parallel runs of one array.

    Attributes
    ----------
    episodes
        Robots with their current episodes.

    """

    # Gymnasium declares no class variable.
    metadata: dict[str, object] = {  # noqa: RUF012
        'render_modes': [],
        'autoreset_mode': AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self, num_envs: int = 1, scenario: str | Path | Scenario = 'paper', **options: Any
    ) -> None:
        """Initialise `num_envs` robots; see `Episodes` for the options and errors."""
        self.episodes = Episodes(num_envs, scenario, **options)
        self.num_envs = num_envs
        self.single_observation_space, self.single_action_space = _spaces(self.episodes)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self,
        *,
        seed: int | Sequence[int] | None = None,
        options: dict[str, object] | None = None,
    ) -> tuple[Array, dict[str, object]]:
        """Start the next episode of all robots; with a seed, its first episodes."""
        super().reset(seed=seed if isinstance(seed, int) else None)
        observations, infos = _reset(self, seed)
        return observations, self._together(infos)

    def step(self, actions: Array) -> tuple[Array, Array, Flags, Flags, dict[str, object]]:
        """Hold torques (robots, joints) in N·m for one control period; see `Episodes.step`."""
        done = self.episodes.step(actions)
        infos = self._together(done.infos)
        return done.observation, done.reward, done.terminated, done.truncated, infos

    def _together(self, infos: Mapping[int, dict[str, object]]) -> dict[str, object]:
        together: dict[str, object] = {}
        for robot, info in infos.items():
            together = self._add_info(together, info, robot)
        return together


def _spaces(episodes: Episodes) -> tuple[Box[Any], Box[Any]]:
    """Return the spaces of the observations and actions of one robot."""
    limit = episodes.action_limit
    return (
        Box(-np.inf, np.inf, (len(episodes.entries),), np.float64),
        Box(-limit, limit, dtype=np.float64),
    )


def _reset(
    environment: MobileManipulator | MobileManipulators, seed: int | Sequence[int] | None
) -> tuple[Array, Infos]:
    """Start the next episodes; the first call without a seed draws a random one."""
    episodes = environment.episodes
    if seed is not None or not episodes.is_seeded:
        episodes.seed(int(environment.np_random.integers(2**32)) if seed is None else seed)
    return episodes.reset()


register(
    ENVIRONMENT,
    entry_point=f'{__name__}:{MobileManipulator.__name__}',
    vector_entry_point=f'{__name__}:{MobileManipulators.__name__}',
)
