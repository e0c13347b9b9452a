# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Gymnasium environments of the simulated robots, for learned controllers.

The import of this module registers `ENVIRONMENT`; that of `masmc_ros` does not import Gymnasium.
docs/guides/learning.md describes observation, action, reward and episodes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import index
from pathlib import Path
from typing import Any

from gymnasium import Env, register
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from masmc_ros.aliases import AnyArray, Array, Bytes, Flags
from masmc_ros.api.episodes import Episodes, Infos, Step
from masmc_ros.api.scenario import Scenario
from masmc_ros.errors import InputError
import numpy as np

ENVIRONMENT = 'masmc/MobileManipulator-v0'
"""Name of the environment."""


RGB_ARRAY = 'rgb_array'
"""Mode that renders pictures as arrays."""


class Camera:
    """Paths of robots in their current episodes, and pictures of them."""

    def __init__(self, episodes: Episodes) -> None:
        """Initialise the paths, which are empty."""
        self._episodes = episodes
        self._positions: list[list[Array]] = [[] for _ in range(episodes.count)]

    def note(self, starts: Flags) -> None:
        """Add the true positions of the tick to the paths; (robots) flags restart paths."""
        true = self._episodes.signal('true_position')
        for positions, position, is_new in zip(self._positions, true, starts, strict=True):
            if is_new:
                positions.clear()
            if np.isfinite(position).all():
                positions.append(position)

    def picture(self, number: int) -> Bytes:
        """Return a picture (480, 640, 3) of a robot."""
        # matplotlib takes time to import.
        from masmc_ros.report.draw.path_figures import frame

        if not self._positions[number]:
            raise ResetNeeded('render: no episode has started; expected a reset before it')
        robot, driven = self._episodes.robot(number), np.array(self._positions[number])
        desired = self._episodes.path[:, :len(robot.mechanism.axes)]
        return frame(robot, driven[-1], desired, robot.task_positions(driven))


class MobileManipulator(Env[Array, Array]):
    """
    One robot, computed alone.

    Attributes
    ----------
    episodes
        Robot with its current episode; `episodes.entries` has the names of an observation.

    """

    # Gymnasium declares no class variable.
    metadata: dict[str, object] = {  # noqa: RUF012
        'render_modes': [RGB_ARRAY],
        'render_fps': 25,
    }

    def __init__(
        self,
        scenario: str | Path | Scenario = 'paper',
        *,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        """
        Initialise the environment.

        Parameters
        ----------
        scenario, options
            See `Episodes`, also for the errors.
        render_mode
            RGB_ARRAY or None.

        """
        self.render_mode = _checked_mode(render_mode)
        self.episodes = Episodes(1, scenario, **options)
        self._camera = Camera(self.episodes)
        self._is_closed = False
        self.observation_space, self.action_space = _spaces(self.episodes)

    def reset(
        self, *, seed: int | None = None, options: dict[str, object] | None = None
    ) -> tuple[Array, dict[str, object]]:
        """Start the next episode; with a seed, its first episode."""
        _check_open(self._is_closed)
        seed = None if seed is None else index(seed)
        super().reset(seed=seed)
        observations, infos = _reset(self, seed, None)
        return observations[0], infos[0]

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, object]]:
        """
        Hold torques (joints) in N·m for one control period.

        After the end of an episode, the next step starts the next one, with reward 0.
        """
        _check_open(self._is_closed)
        done = _step(self, np.asarray(action)[None])
        return (
            done.observation[0],
            float(done.reward[0]),
            bool(done.terminated[0]),
            bool(done.truncated[0]),
            done.infos.get(0, {}),
        )

    # Gymnasium declares a type of its own.
    def render(self) -> Any:
        """Return a picture (480, 640, 3) of the robot and its path; None without a mode."""
        return self._camera.picture(0) if self.render_mode else None

    def close(self) -> None:
        """End the use of the environment."""
        self._is_closed = True
        self.episodes.close()


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
        'render_modes': [RGB_ARRAY],
        'render_fps': 25,
        'autoreset_mode': AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        scenario: str | Path | Scenario = 'paper',
        *,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        """
        Initialise the robots.

        Parameters
        ----------
        num_envs
            Number of robots.
        scenario, options
            See `Episodes`, also for the errors.
        render_mode
            RGB_ARRAY or None.

        """
        self.render_mode = _checked_mode(render_mode)
        self.episodes = Episodes(num_envs, scenario, **options)
        self._camera = Camera(self.episodes)
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
        """
        Start the next episode of all robots; with a seed, its first episodes.

        `options={'reset_mask': flags}` (robots) starts that of some robots; the others continue.
        """
        _check_open(self.closed)
        seed = index(seed) if isinstance(seed, int | np.integer) else seed
        super().reset(seed=seed if isinstance(seed, int) else None)
        observations, infos = _reset(self, seed, self._mask(options))
        return observations, self._together(infos)

    def step(self, actions: Array) -> tuple[Array, Array, Flags, Flags, dict[str, object]]:
        """Hold torques (robots, joints) in N·m for one control period; see `Episodes.step`."""
        _check_open(self.closed)
        done = _step(self, actions)
        infos = self._together(done.infos)
        return done.observation, done.reward, done.terminated, done.truncated, infos

    # Gymnasium declares a type of its own.
    def render(self) -> Any:
        """Return a picture (480, 640, 3) of each robot and its path; None without a mode."""
        if not self.render_mode:
            return None
        return tuple(self._camera.picture(robot) for robot in range(self.num_envs))

    def close_extras(self, **kwargs: object) -> None:
        """Release the memory of the robots."""
        self.episodes.close()

    def _mask(self, options: Mapping[str, object] | None) -> Flags | None:
        if not options or 'reset_mask' not in options:
            return None
        mask = np.asarray(options['reset_mask'])
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
            raise InputError(
                f'reset_mask = {mask.tolist()}: expected {self.num_envs} booleans, at least one '
                'of them true'
            )
        if not (mask.all() or self.episodes.is_seeded):
            raise ResetNeeded('reset_mask: expected all robots in the first reset')
        return mask

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
    environment: MobileManipulator | MobileManipulators,
    seed: int | Sequence[int] | None,
    chosen: Flags | None,
) -> tuple[Array, Infos]:
    """Start the next episodes; the first call without a seed draws a random one."""
    episodes = environment.episodes
    if seed is not None or not episodes.is_seeded:
        drawn = int(environment.np_random.integers(2**32)) if seed is None else seed
        episodes.seed(drawn, chosen)
    result = episodes.reset(chosen)
    if environment.render_mode:
        environment._camera.note(np.ones(episodes.count, bool) if chosen is None else chosen)
    return result


def _step(environment: MobileManipulator | MobileManipulators, actions: Array) -> Step:
    episodes = environment.episodes
    if not episodes.is_seeded:
        raise ResetNeeded('step: no episode has started; expected a reset before it')
    done = episodes.step(actions)
    if environment.render_mode:
        starts = np.zeros(episodes.count, bool)
        starts[[robot for robot, info in done.infos.items() if 'drawn' in info]] = True
        environment._camera.note(starts)
    return done


def _check_open(is_closed: bool) -> None:
    if is_closed:
        raise ClosedEnvironmentError('the environment is closed; expected a new one')


def _checked_mode(mode: str | None) -> str | None:
    if mode not in (None, RGB_ARRAY):
        raise InputError(f'render_mode = {mode!r}: expected None or {RGB_ARRAY!r}')
    return mode


register(
    ENVIRONMENT,
    entry_point=f'{__name__}:{MobileManipulator.__name__}',
    vector_entry_point=f'{__name__}:{MobileManipulators.__name__}',
)
