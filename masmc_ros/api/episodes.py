# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Episodes of robots that a policy drives by torques: observations, rewards and ends.

This module does not need Gymnasium, whose interface is in `api.learning`. Several robots are
computed in blocks of `LANES` parallel runs, so code is compiled for one robot and for a block.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
import math
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from masmc_ros.aliases import Array, Flags
from masmc_ros.api.scenario import load, Scenario, whole
from masmc_ros.campaign.campaign import Campaign, campaign_of, MOST_RUNS
from masmc_ros.campaign.runs import CPU, LANES, metric_columns
from masmc_ros.campaign.variable import draw as parsed_draw
from masmc_ros.campaign.variable import Variable
from masmc_ros.errors import InputError
from masmc_ros.law.command_interface import by_velocity, COMMAND_INTERFACE
from masmc_ros.loop.driven_robots import DrivenRobots
from masmc_ros.loop.plant_parameters import PHYSICS, RIGID, SEED, TORQUE_LIMIT
from masmc_ros.loop.timing import Timing
from masmc_ros.native.device import device_option, DeviceRobots
from masmc_ros.params.declaration import Values
from masmc_ros.reference.trajectory import Trajectory
from masmc_ros.report.measure.reduced import metrics_of_lane, ReducedWindow, SETTLING
from masmc_ros.robot.declaration import Mechanism
from masmc_ros.robot.robot import Robot, robot_of
import numpy as np
from numpy.typing import ArrayLike, NDArray

DEFAULT_TORQUE = 50.0
"""Bound of an action in N·m for a joint whose torque the scenario does not limit."""

_OF_ALL = ('control_period', 'duration', 'integrator_step')
"""Parameters of the plant that are equal in all episodes."""

_SEEDS = 2**32

_Number = TypeVar('_Number', bound=np.generic)

Infos = dict[int, dict[str, object]]
"""Information by the number of the robot."""


class Entry(NamedTuple):
    """Entry of an observation; task axes and the base pose are in the frame `odom`."""

    name: str
    unit: str


class Step(NamedTuple):
    """Result of a step of all robots, with a row or an entry for each."""

    observation: Array
    reward: Array
    terminated: Flags
    truncated: Flags
    infos: Infos


@dataclass(frozen=True)
class Reward:
    """
    Weights of the reward, and the error at which an episode ends.

    Attributes
    ----------
    error_weight
        Weight of the squared norm of the true task error, 1/m² (1/rad² for rotations).
    torque_weight
        Weight of the squared norm of the change of the torques, 1/(N·m)².
    error_limit
        Norm of the true task error above which a robot has diverged.

    """

    error_weight: float = 1.0
    torque_weight: float = 1e-6
    error_limit: float = 10.0

    def __post_init__(self) -> None:
        """Raise InputError for a value out of range."""
        for name, least in (('error_weight', '>='), ('torque_weight', '>='), ('error_limit', '>')):
            value = getattr(self, name)
            is_number = isinstance(value, int | float) and math.isfinite(value)
            if not is_number or value < 0.0 or (least == '>' and value == 0.0):
                raise InputError(f'{name} = {value!r}: expected a finite number {least} 0')


class Episodes:
    """
    Episodes of several robots, each from a run of a campaign.

    Attributes
    ----------
    entries
        Entries of an observation.
    action_limit
        (joints) largest magnitudes of the torques in N·m.
    steps
        Steps of an episode that does not diverge: the ticks of the run.
    is_seeded
        True if a seed has selected the runs.
    path
        Reference (steps + 1, 3 * axes) of each tick.

    """

    def __init__(
        self,
        count: int,
        scenario: str | Path | Scenario,
        *,
        draw: Mapping[str, str] | None = None,
        settings: Values | None = None,
        action_limit: float | Sequence[float] | None = None,
        error_weight: float = Reward.error_weight,
        torque_weight: float = Reward.torque_weight,
        error_limit: float = Reward.error_limit,
        max_episode_steps: int | None = None,
        device: str = CPU,
        **values: object,
    ) -> None:
        """
        Initialise robots that have not started.

        Parameters
        ----------
        count
            Number of robots.
        scenario, settings, values
            As in `masmc_ros.load`.
        draw
            Distributions by name, drawn at each reset:
            `{'plant.robot.link_2_mass': 'uniform:0.6:1.4'}`.
        action_limit
            Largest magnitude of the torques in N·m, or one for each joint; None: that of the
            scenario, see `_action_limit`.
        error_weight, torque_weight, error_limit
            See `Reward`.
        max_episode_steps
            Steps after which an episode is truncated, without a row of metrics if the run is
            longer; None: the ticks of the run.
        device
            `cpu`, or `cuda` for a GPU.

        Raises
        ------
        InputError
            if a name is unknown or a value out of range, if the device is missing, or if its
            memory does not suffice.

        """
        count = whole('num_envs', count, 1)
        loaded = load(scenario, settings, **values)
        self._campaign = campaign_of(
            loaded.file,
            loaded.settings,
            draws=[parsed_draw(f'{name}={text}') for name, text in (draw or {}).items()],
            repeats=MOST_RUNS,
        )
        for variable in self._campaign.variables:
            _check_variable(variable)
        base = self._campaign.scenario
        timing = _checked_timing(base.plant)
        assert timing.last is not None
        robot = robot_of(base.trajectory)
        mechanism = robot.mechanism
        self.steps = timing.last + 1
        self._last_step = self.steps
        if max_episode_steps is not None:
            chosen = whole('max_episode_steps', max_episode_steps, 1)
            self._last_step = min(self.steps, chosen)
        self.entries = _entries(mechanism)
        self.action_limit = _action_limit(action_limit, base, mechanism)
        self.count = count
        self._period = timing.period
        self._reward = Reward(error_weight, torque_weight, error_limit)
        self._window = ReducedWindow.of(timing)
        path = Trajectory(base.trajectory, timing.period, robot).sample(0, self.steps + 1)
        self.path = path
        open_device = device_option(device)
        of_block = partial(DeviceRobots, open_device) if open_device else DrivenRobots
        lanes = count if open_device or count == 1 else LANES
        window = self._window.first, self._window.after
        self._blocks = [
            of_block(base, lanes, path=path, window=window, settling=SETTLING)
            for _ in range(-(-count // lanes))
        ]
        self._lanes = lanes
        self.is_seeded = False
        self._seed = np.zeros(count, np.int64)
        self._run = np.arange(count)
        self._stride = np.full(count, count)
        self._plants: dict[int, Values] = {}
        self._campaigns: dict[int, Campaign] = {}
        self._drawn: Infos = {}
        self._has_ended = np.ones(count, bool)
        self._previous = np.zeros((count, mechanism.sizes['joints']))
        self._observation = np.zeros((count, len(self.entries)))

    def seed(self, seed: int | Sequence[int], chosen: Flags | None = None) -> None:
        """
        Choose the runs of the next episodes, of all robots or of `chosen` ones.

        With one seed, robot i starts with run i of the seed; its next episode is run i + count,
        and so on. With a sequence, each robot has runs 0, 1, ... of its own seed. Raises
        InputError for a seed out of range.
        """
        if isinstance(seed, int | np.integer):
            seeds, runs, stride = [seed] * self.count, np.arange(self.count), self.count
        else:
            seeds, runs, stride = list(seed), np.zeros(self.count, np.int64), 1
            if len(seeds) != self.count:
                raise InputError(f'seed: {len(seeds)} numbers; expected {self.count}, or one')
        for number in seeds:
            is_whole = isinstance(number, int | np.integer) and not isinstance(number, bool)
            if not is_whole or not 0 <= number < _SEEDS:
                raise InputError(f'seed = {number!r}: expected a whole number >= 0 and < 2**32')
        self.is_seeded = True
        robots = np.ones(self.count, bool) if chosen is None else chosen
        self._seed[robots] = np.array(seeds, np.int64)[robots]
        self._run[robots], self._stride[robots] = runs[robots], stride
        self._campaigns.clear()

    def reset(self, chosen: Flags | None = None) -> tuple[Array, Infos]:
        """Start the next episode of all or of `chosen` robots; return observations and runs."""
        starts = np.ones(self.count, bool) if chosen is None else chosen
        infos = self._start(starts)
        before = self._observation
        self._observe()
        self._observation[~starts] = before[~starts]
        return self._observation.copy(), infos

    def step(self, actions: ArrayLike) -> Step:
        """
        Hold torques (robots, joints) in N·m for one control period, within the action limits.

        A robot whose episode has ended starts the next one; its action has no effect, and its
        reward is 0. Raises InputError for an action that is not finite.
        """
        torque = np.clip(self._checked(actions), -self.action_limit, self.action_limit)
        starts = self._has_ended.copy()
        moves = ~starts
        ticks = np.concatenate([block.tick for block in self._blocks])[:self.count]
        for block, first in self._numbered_blocks():
            chosen = slice(first, first + self._lanes)
            if moves[chosen].any():
                block.step(self._padded(torque[chosen]), self._padded(moves[chosen]))
        change = torque - self._previous
        self._previous = torque
        infos = self._start(starts)
        before = self._observation
        self._observe()
        with np.errstate(over='ignore', invalid='ignore'):
            square = (self._of_robots('tracked', 'true_error') ** 2).sum(axis=1)
            cost = self._reward.error_weight * square
            cost += self._reward.torque_weight * (change**2).sum(axis=1)
            is_lost = moves & ~(self._is_finite() & (square <= self._reward.error_limit**2))
        terminated = is_lost
        truncated = moves & ~is_lost & (ticks + 1 == self._last_step)
        # The remaining steps count with the error limit, so divergence is never an advantage.
        worst = self._reward.error_weight * self._reward.error_limit**2
        cost[is_lost] = worst * (self.steps - ticks[is_lost])
        cost[starts] = 0.0
        # Libraries for learning do not accept an observation that is not finite.
        is_void = is_lost & ~np.isfinite(self._observation).all(axis=1)
        self._observation[is_void] = before[is_void]
        self._has_ended = terminated | truncated
        has_row = terminated | (truncated & (ticks + 1 == self.steps))
        for robot in np.flatnonzero(has_row).tolist():
            infos[robot] = {'row': self._row(robot, is_lost=bool(is_lost[robot]))}
        return Step(self._observation.copy(), -cost, terminated, truncated, infos)

    def signal(self, name: str) -> Array:
        """Return a signal of `loop.signals.SIGNALS` (robots, components) of the current ticks."""
        return self._of_robots('signals', name)

    def close(self) -> None:
        """Release the memory of the robots."""
        self._blocks.clear()

    def robot(self, number: int) -> Robot:
        """Return a robot in its current episode."""
        return robot_of(self._plants[number])

    def _start(self, starts: Flags) -> Infos:
        """Start the next episodes of some robots; return their runs."""
        runs: dict[int, dict[int, Any]] = {}
        infos: Infos = {}
        for robot in np.flatnonzero(starts).tolist():
            number, seed = int(self._run[robot]), int(self._seed[robot])
            if seed not in self._campaigns:
                self._campaigns[seed] = self._of_seed(seed)
            (run,) = self._campaigns[seed].runs(number, 1)
            runs.setdefault(robot // self._lanes, {})[robot % self._lanes] = run.scenario
            self._plants[robot] = run.scenario.plant
            row = {'run': number, 'seed': SEED.of(run.scenario.plant), **run.values}
            self._drawn[robot] = row
            infos[robot] = {'drawn': row}
        for block, chosen in runs.items():
            self._blocks[block].start(chosen)
        self._run[starts] += self._stride[starts]
        self._has_ended[starts] = False
        self._previous[starts] = 0.0
        return infos

    def _of_seed(self, seed: int) -> Campaign:
        plant = self._campaign.scenario.plant
        # Episodes of different seeds have different noise, also without drawn parameters.
        plant = {**plant, 'seed': (SEED.of(plant) + seed) % _SEEDS}
        scenario = self._campaign.scenario.with_nodes({'plant': plant})
        return replace(self._campaign, seed=seed, scenario=scenario)

    def _row(self, robot: int, *, is_lost: bool) -> dict[str, object]:
        """Return the row of a campaign for the episode that has ended."""
        block, lane = self._blocks[robot // self._lanes], robot % self._lanes
        metrics = metrics_of_lane(block.reduction(), lane, self._window, block.mechanism)
        # They are not kept, because copies and other processes cannot have them.
        columns = metric_columns(block.mechanism)
        values: dict[str, float | None] = dict.fromkeys(column.name for column in columns)
        if not (is_lost or isinstance(metrics, float)):
            values = {column.name: column.value(metrics) for column in columns}
        return {
            **self._drawn[robot],
            **{name: math.nan if value is None else value for name, value in values.items()},
            'lost': is_lost,
            'lost_at': float(block.tick[lane] * self._period) if is_lost else math.nan,
        }

    def _observe(self) -> None:
        parts = (
            self.signal('error'),
            self._of_robots('tracked', 'velocity_error'),
            self.signal('position'),
            self.signal('velocity'),
            self.signal('reference'),
        )
        self._observation = np.concatenate(parts, axis=1)

    def _is_finite(self) -> Flags:
        true = [self.signal(name) for name in ('true_position', 'true_velocity')]
        finite: Flags = np.isfinite(
            np.concatenate([self._observation, *true], axis=1)
        ).all(axis=1)
        return finite

    def _of_robots(self, record: str, field: str) -> NDArray[Any]:
        """Return a field of all blocks as (robots, components)."""
        arrays = [block.values(record, field) for block in self._blocks]
        joined = arrays[0] if len(arrays) == 1 else np.concatenate(arrays)
        return joined[: self.count].copy()

    def _numbered_blocks(self) -> list[tuple[DrivenRobots, int]]:
        return [(block, i * self._lanes) for i, block in enumerate(self._blocks)]

    def _padded(self, values: NDArray[_Number]) -> NDArray[_Number]:
        """Return an array of robots with zeros for the unused lanes of a block."""
        missing = self._lanes - len(values)
        if not missing:
            return values
        return np.concatenate([values, np.zeros((missing, *values.shape[1:]), values.dtype)])

    def _checked(self, actions: ArrayLike) -> Array:
        expected = self.count, len(self.action_limit)
        torque = np.asarray(actions, np.float64)
        if torque.shape != expected:
            raise InputError(f'action: shape {torque.shape}; expected {expected} torques in N·m')
        if not np.isfinite(torque).all():
            robot = int(np.argmin(np.isfinite(torque).all(axis=1)))
            raise InputError(f'action of robot {robot}: {torque[robot].tolist()}; expected finite '
                             'torques in N·m')  # fmt: skip
        return torque


def _check_variable(variable: Variable) -> None:
    """Raise InputError for a draw of a parameter that is equal in all episodes."""
    name = variable.parameter.name
    is_path = 'trajectory' in variable.readers and not name.startswith('robot.')
    if is_path or name in _OF_ALL:
        raise InputError(
            f'--draw {variable.name}: path and timing are equal in all episodes; expected a '
            'parameter of the robot, or of the plant'
        )


def _checked_timing(plant: Values) -> Timing:
    """Return the control grid; raise InputError for a plant that torques cannot drive."""
    if PHYSICS.of(plant) != RIGID:
        raise InputError(f'plant.physics = {PHYSICS.of(plant)}: expected {RIGID} for episodes')
    if by_velocity(plant, robot_of(plant).mechanism).any():
        raise InputError(
            f'plant.command_interface = {COMMAND_INTERFACE.of(plant)}: expected effort, because '
            'actions are torques'
        )
    timing = Timing.from_values(plant)
    if timing.last is None:
        raise InputError('duration = 0.0: expected a length > 0 s for an episode')
    return timing


def _entries(mechanism: Mechanism) -> tuple[Entry, ...]:
    """Return the entries of an observation."""
    axes = [(axis.name, axis.unit) for axis in mechanism.axes]
    positions = [(position.name, position.unit) for position in mechanism.positions]
    return tuple(
        Entry(f'{part}_{name}', f'{unit}{per}')
        for part, per, named in (
            ('error', '', axes),
            ('velocity_error', '/s', axes),
            ('position', '', positions),
            ('velocity', '/s', positions),
            ('reference', '', axes),
            ('reference_velocity', '/s', axes),
            ('reference_acceleration', '/s²', axes),
        )
        for name, unit in named
    )


def _action_limit(
    limit: float | Sequence[float] | None, scenario: Scenario, mechanism: Mechanism
) -> Array:
    """
    Return the largest torques (joints) in N·m.

    Without `limit`, each joint has the `torque_limit` of the plant. If that is 0, it has the
    limit of the controller, and `DEFAULT_TORQUE` if that is 0 as well.
    """
    joints = mechanism.sizes['joints']
    if limit is None:
        known = [np.broadcast_to(TORQUE_LIMIT.of(values), joints)
                 for values in (scenario.plant, scenario.controller)]  # fmt: skip
        chosen = np.where(known[0] > 0.0, known[0], known[1])
        return np.where(chosen > 0.0, chosen, DEFAULT_TORQUE)
    try:
        limits = np.asarray(limit, np.float64)
    except (TypeError, ValueError):
        limits = np.array(math.nan)
    is_valid = limits.shape in ((), (1,), (joints,)) and np.isfinite(limits).all()
    if not is_valid or not (limits > 0.0).all():
        raise InputError(
            f'action_limit = {limit!r}: expected a number or {joints} numbers in N·m, each > 0'
        )
    return np.broadcast_to(limits, joints).copy()
