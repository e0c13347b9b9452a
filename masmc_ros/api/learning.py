# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Gymnasium environments of the simulated robots, for learned controllers.

The import of this module registers `ENVIRONMENT`; that of `masmc_ros` does not import Gymnasium.
docs/guides/learning.md describes observation, action, reward and episodes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gymnasium import Env, register
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from masmc_ros.api.episodes import Episodes, Reward
from masmc_ros.numerics.aliases import Array
import numpy as np
from numpy.typing import NDArray

ENVIRONMENT = 'masmc/MobileManipulator-v0'
"""Name of the environment."""

Flags = NDArray[np.bool_]


class MobileManipulator(Env[Array, Array]):
    """
    One robot, computed alone.

    Attributes
    ----------
    episodes
        robot with its current episode; `episodes.entries` has the names of an observation.

    """

    # Gymnasium declares no class variable.
    metadata: dict[str, Any] = {'render_modes': []}  # noqa: RUF012

    def __init__(
        self,
        scenario: str = 'paper',
        *,
        draw: Mapping[str, str] | None = None,
        settings: Mapping[str, Any] | None = None,
        action_limit: float | Sequence[float] | None = None,
        error_weight: float = Reward.error_weight,
        torque_weight: float = Reward.torque_weight,
        error_limit: float = Reward.error_limit,
        **values: Any,
    ) -> None:
        """
        Initialise the environment.

        Parameters
        ----------
        scenario
            parameter file, or name of an installed one.
        draw
            distributions by name, drawn at each reset:
            `{'plant.robot.link_2_mass': 'uniform:0.6:1.4'}`.
        settings, values
            as in `masmc_ros.simulate`.
        action_limit
            largest magnitude of the torques in N·m, or one for each joint; None: that of the
            scenario.
        error_weight, torque_weight, error_limit
            see `Reward`.

        Raises
        ------
        InputError
            If a name is unknown or a value out of range.

        """
        self.episodes = Episodes(
            1,
            scenario,
            draw=draw,
            settings=settings,
            action_limit=action_limit,
            reward=Reward(error_weight, torque_weight, error_limit),
            values=values,
        )
        self.observation_space, self.action_space = _spaces(self.episodes)
        self._is_seeded = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Start the next episode; with a seed the first one of it."""
        super().reset(seed=seed)
        if seed is not None or not self._is_seeded:
            self.episodes.seed(_seed(self) if seed is None else seed)
            self._is_seeded = True
        observations, infos = self.episodes.reset()
        return observations[0], infos[0]

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Hold torques (joints) in N·m for one control period."""
        done = self.episodes.step(np.asarray(action)[None])
        return (
            done.observation[0],
            float(done.reward[0]),
            bool(done.terminated[0]),
            bool(done.truncated[0]),
            done.infos.get(0, {}),
        )


class MobileManipulators(VectorEnv[Array, Array, NDArray[Any]]):
    """
    Several robots, computed side by side.

    Attributes
    ----------
    episodes
        robots with their current episodes.

    """

    # Gymnasium declares no class variable.
    metadata: dict[str, Any] = {  # noqa: RUF012
        'render_modes': [],
        'autoreset_mode': AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        scenario: str = 'paper',
        *,
        draw: Mapping[str, str] | None = None,
        settings: Mapping[str, Any] | None = None,
        action_limit: float | Sequence[float] | None = None,
        error_weight: float = Reward.error_weight,
        torque_weight: float = Reward.torque_weight,
        error_limit: float = Reward.error_limit,
        **values: Any,
    ) -> None:
        """Initialise `num_envs` robots; see `MobileManipulator` for the arguments."""
        self.episodes = Episodes(
            num_envs,
            scenario,
            draw=draw,
            settings=settings,
            action_limit=action_limit,
            reward=Reward(error_weight, torque_weight, error_limit),
            values=values,
        )
        self.num_envs = num_envs
        self.single_observation_space, self.single_action_space = _spaces(self.episodes)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._is_seeded = False

    def reset(
        self,
        *,
        seed: int | Sequence[int] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Array, dict[str, Any]]:
        """Start the next episode of all robots; with a seed the first ones of it."""
        super().reset(seed=seed if isinstance(seed, int) else None)
        if seed is not None or not self._is_seeded:
            self.episodes.seed(_seed(self) if seed is None else seed)
            self._is_seeded = True
        observations, infos = self.episodes.reset()
        return observations, self._together(infos)

    def step(self, actions: Array) -> tuple[Array, Array, Flags, Flags, dict[str, Any]]:
        """Hold torques (robots, joints) in N·m for one control period; see `Episodes.step`."""
        done = self.episodes.step(actions)
        infos = self._together(done.infos)
        return done.observation, done.reward, done.terminated, done.truncated, infos

    def _together(self, infos: Mapping[int, dict[str, Any]]) -> dict[str, Any]:
        together: dict[str, Any] = {}
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


def _seed(environment: Env[Any, Any] | VectorEnv[Any, Any, Any]) -> int:
    """Return a seed from the generator of an environment, which is random without a seed."""
    return int(environment.np_random.integers(2**32))


register(
    ENVIRONMENT,
    entry_point=f'{__name__}:{MobileManipulator.__name__}',
    vector_entry_point=f'{__name__}:{MobileManipulators.__name__}',
)
