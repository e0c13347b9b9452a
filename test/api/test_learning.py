# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Gymnasium environments: the states are those of simulated runs."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
from typing import Any
import warnings

import gymnasium
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.utils.env_checker import check_env, data_equivalence
from helpers.campaigns import PAPER
import masmc_ros as masmc
from masmc_ros.api.learning import ENVIRONMENT, MobileManipulator, MobileManipulators
from masmc_ros.errors import InputError
import numpy as np
import pytest

DRAW = {'plant.robot.link_2_mass': 'uniform:0.6:1.4', 'plant.disturbance.phase[2]': 'uniform:0:6'}
EFFECTS = {
    'plant.velocity_noise': 0.02, 'plant.encoder_resolution': 1e-4,
    'plant.measurement_delay': 0.002, 'plant.command_delay': 0.003, 'plant.delay_jitter': 0.5,
}  # fmt: skip


def _vector(count: int, **options: Any) -> MobileManipulators:
    envs = gymnasium.make_vec(
        ENVIRONMENT, num_envs=count, vectorization_mode='vector_entry_point', **options
    )
    assert isinstance(envs, MobileManipulators)
    return envs


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        ({'num_envs': 0}, r'num_envs = 0: expected a whole number >= 1'),
        ({'k_s9': 1.0}, r"unknown parameter 'k_s9'"),
        ({'duration': 0.0}, r'duration = 0.0: expected a length > 0 s'),
        ({'action_limit': [1.0, 2.0]}, r'action_limit = .*expected a number or 4 numbers'),
        ({'action_limit': -1.0}, r'action_limit = -1.0: .* each > 0'),
        ({'torque_weight': -1.0}, r'torque_weight = -1.0: expected a finite number >= 0'),
        ({'error_limit': np.inf}, r'error_limit = inf: expected a finite number > 0'),
        ({'draw': {'control_period': 'uniform:0.001:0.002'}}, r'path and timing are equal in all'),
        ({'draw': {'plant.seed': 'uniform:0:1'}}, r'expected integers'),
        ({'settings': {'plant.command_interface': 'velocity'}}, r'expected effort'),
        ({'settings': {'plant.physics': 'mujoco'}}, r'plant.physics = mujoco: expected rigid'),
    ],
)
def test_invalid_option_raises_one_line(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        MobileManipulators(**{'num_envs': 2, 'scenario': PAPER, **options})
    assert '\n' not in str(caught.value)


def test_action_space_has_limits_of_scenario() -> None:
    settings = {
        'plant.torque_limit': [8.0, 8.0, 0.0, 0.0],
        'controller.torque_limit': [0, 0, 20, 0],
    }
    env = MobileManipulator(PAPER, settings=settings)
    assert env.action_space.high.tolist() == [8.0, 8.0, 20.0, 50.0]
    assert env.observation_space.shape == (len(env.episodes.entries),) == (34,)


@pytest.mark.slow
def test_environment_passes_check_of_gymnasium() -> None:
    with warnings.catch_warnings():
        # It advises spaces from -1 to 1; these have units.
        warnings.simplefilter('ignore')
        check_env(gymnasium.make(ENVIRONMENT, scenario=PAPER, duration=0.05).unwrapped)


@pytest.mark.slow
@pytest.mark.parametrize('settings', [{}, EFFECTS], ids=['exact', 'effects'])
def test_torques_of_law_give_its_run_bitwise(settings: dict[str, Any]) -> None:
    run = masmc.simulate(PAPER, settings, duration=0.1)
    env = gymnasium.make(
        ENVIRONMENT, scenario=PAPER, settings=settings, duration=0.1, action_limit=1e6
    )
    robots = env.unwrapped
    assert isinstance(robots, MobileManipulator)
    observation, _ = env.reset(seed=0)
    names = 'error', 'position', 'velocity', 'reference', 'true_position', 'true_velocity', 'age'
    last = len(run.times) - 1
    for tick, torque in enumerate(run.torque):
        for name in names:
            state = robots.episodes.signal(name).ravel()
            np.testing.assert_array_equal(state, getattr(run, name)[tick], f'{name} at {tick}')
        np.testing.assert_array_equal(observation[:4], run.error[tick])
        np.testing.assert_array_equal(observation[-12:], run.reference[tick])
        observation, reward, terminated, truncated, info = env.step(torque)
        assert (terminated, truncated) == (False, tick == last)
        assert -np.inf < reward < 0.0
    point = run.metrics.of('end_effector')
    assert info['row']['end_effector_rms'] == point.rms
    assert info['row']['end_effector_max'] == point.largest
    assert info['row']['torque_variation'] == run.metrics.torque_variation


@pytest.mark.slow
def test_robots_in_lanes_equal_single_ones_bitwise() -> None:
    """Robot 1 diverges and starts again, so the robots are at different ticks."""
    options: dict[str, Any] = {
        'scenario': PAPER, 'draw': DRAW, 'settings': EFFECTS, 'duration': 0.04, 'error_limit': 0.5,
    }  # fmt: skip
    envs = _vector(3, **options)
    torques = np.random.default_rng(1).uniform(-5.0, 5.0, (60, 3, 4))
    torques[:15, 1, 3] = 50.0
    observation, _ = envs.reset(seed=7)
    seen, ends = [observation], []
    for tick, torque in enumerate(torques):
        observation, _, terminated, truncated, _ = envs.step(torque)
        seen.append(observation)
        ends += [
            (tick, int(i), bool(terminated[i])) for i in np.flatnonzero(terminated | truncated)
        ]
    assert [robot for _, robot, _ in ends if robot != 1] == [0, 2]
    first = next(tick for tick, robot, is_lost in ends if robot == 1 and is_lost)
    assert first < 40
    # Run 1 of the seed until it diverges, then run 4; robots 0 and 2 make runs 0 and 2.
    single = gymnasium.make(ENVIRONMENT, **options)
    for run, robot, start in ((0, 0, 0), (1, 1, 0), (2, 2, 0), (3, -1, 0), (4, 1, first + 2)):
        observation, info = single.reset(seed=7 if run == 0 else None)
        assert info['drawn']['run'] == run
        if robot < 0:
            continue
        for tick in range(start, min(start + 41, 60)):
            np.testing.assert_array_equal(seen[tick][robot], observation)
            observation, _, terminated, truncated, _ = single.step(torques[tick, robot])
            if terminated or truncated:
                break


@pytest.mark.slow
def test_reset_with_seed_repeats_episode() -> None:
    envs = _vector(2, scenario=PAPER, draw=DRAW, settings=EFFECTS, duration=0.05)
    torques = np.full((2, 4), 1.0)
    episodes = []
    for seed in (3, 3, 4, [3, 3]):
        observation, infos = envs.reset(seed=seed)
        steps = [observation, *(envs.step(torques)[0] for _ in range(20))]
        episodes.append((np.stack(steps), infos['drawn']['plant.robot.link_2_mass']))
    np.testing.assert_array_equal(episodes[0][0], episodes[1][0])
    assert episodes[0][1].tolist() == episodes[1][1].tolist() != episodes[2][1].tolist()
    np.testing.assert_array_equal(episodes[3][0][:, 0], episodes[3][0][:, 1])
    np.testing.assert_array_equal(episodes[3][0][:, 0], episodes[0][0][:, 0])


@pytest.mark.slow
def test_divergence_ends_episode_and_never_pays() -> None:
    envs = _vector(2, scenario=PAPER, duration=0.5, error_limit=0.5)
    envs.reset(seed=0)
    total, torques = np.zeros(2), np.zeros((2, 4))
    torques[0] = 50.0
    ended = np.zeros(2, bool)
    for _ in range(501):
        _, reward, terminated, truncated, infos = envs.step(torques)
        total += np.where(ended, 0.0, reward)
        if terminated[0] and not ended[0]:
            assert infos['row']['lost'][0]
            assert infos['row']['lost_at'][0] < 0.5
            assert np.isnan(infos['row']['end_effector_rms'][0])
        ended |= terminated | truncated
    assert ended.all()
    assert total[0] < total[1] < 0.0
    with pytest.raises(InputError, match=r'action of robot 1: .* expected finite torques'):
        envs.step(np.array([[0.0] * 4, [np.nan] * 4]))
    with pytest.raises(InputError, match=r'action: shape \(3,\); expected \(2, 4\) torques'):
        envs.step(np.zeros(3))


@pytest.mark.parametrize(
    'copied',
    [copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))],
    ids=['deepcopy', 'pickle'],
)
@pytest.mark.slow
def test_copies_of_environments_and_runs_are_equal(copied: Any) -> None:
    env = gymnasium.make(ENVIRONMENT, scenario=PAPER, settings=EFFECTS, duration=0.05)
    env.reset(seed=1)
    env.step(np.ones(4))
    other = copied(env)
    while True:
        first, second = env.step(np.ones(4)), other.step(np.ones(4))
        np.testing.assert_array_equal(first[0], second[0])
        assert first[1:4] == second[1:4]
        if first[3]:
            break
    assert first[4]['row'].keys() == second[4]['row'].keys()
    run = masmc.simulate(PAPER, duration=0.05)
    again = copied(run)
    assert again.mechanism is run.mechanism
    assert repr(again) == repr(run)
    np.testing.assert_array_equal(again.torque, run.torque)


def _torque(gain: float) -> Any:
    return masmc.simulate(PAPER, duration=0.02, k_s1=gain)


@pytest.mark.slow
@pytest.mark.parametrize('method', ['fork', 'spawn'])
def test_pool_returns_runs_bitwise(method: str) -> None:
    with multiprocessing.get_context(method).Pool(2) as pool:
        runs = pool.map_async(_torque, [50.0, 100.0]).get(120)
    for gain, run in zip((50.0, 100.0), runs, strict=True):
        np.testing.assert_array_equal(run.torque, _torque(gain).torque)


@pytest.mark.slow
def test_picture_shows_robot_and_its_path() -> None:
    env = gymnasium.make(ENVIRONMENT, scenario=PAPER, duration=0.5, render_mode='rgb_array')
    env.reset(seed=0)
    first: Any = env.render()
    assert first.shape == (480, 640, 3)
    assert first.dtype == np.uint8
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 10
    np.testing.assert_array_equal(first, env.render())
    for _ in range(200):
        env.step(np.full(4, 5.0))
    assert not np.array_equal(first, env.render())
    envs = _vector(2, scenario=PAPER, duration=0.05, render_mode='rgb_array')
    envs.reset(seed=0)
    pictures: Any = envs.render()
    assert [picture.shape for picture in pictures] == [(480, 640, 3)] * 2
    assert gymnasium.make(ENVIRONMENT, scenario=PAPER, render_mode=None).render_mode is None
    with pytest.raises(InputError, match=r"render_mode = 'human': expected None or 'rgb_array'"):
        MobileManipulator(PAPER, render_mode='human')


@pytest.mark.slow
def test_vector_environment_truncates_at_max_episode_steps() -> None:
    envs = _vector(3, scenario=PAPER, duration=0.05, max_episode_steps=10)
    envs.reset(seed=0)
    for tick in range(10):
        _, _, _, truncated, infos = envs.step(np.zeros((3, 4)))
        assert truncated.tolist() == [tick == 9] * 3
    assert 'row' not in infos
    _, reward, _, truncated, infos = envs.step(np.zeros((3, 4)))
    assert infos['drawn']['run'].tolist() == [3, 4, 5]
    assert not truncated.any()
    assert not reward.any()


@pytest.mark.parametrize('mode', ['sync', 'async'])
@pytest.mark.slow
def test_vector_environment_equals_vector_of_single_ones(mode: str) -> None:
    """Observations, rewards, ends and infos are equal, also after the ends of episodes."""
    options: dict[str, Any] = {'scenario': PAPER, 'settings': EFFECTS, 'duration': 0.02}
    envs = _vector(2, **options)
    others = gymnasium.make_vec(ENVIRONMENT, num_envs=2, vectorization_mode=mode, **options)
    try:
        assert envs.single_action_space == others.single_action_space
        assert envs.observation_space == others.observation_space
        assert data_equivalence(envs.reset(seed=[3, 4]), others.reset(seed=[3, 4]), exact=True)
        ends = 0
        for torques in np.random.default_rng(1).uniform(-5.0, 5.0, (45, 2, 4)):
            step, other = envs.step(torques), others.step(torques)
            assert data_equivalence(step[:4], other[:4], exact=True)
            # A row contains NaN, which data_equivalence takes for unequal.
            np.testing.assert_equal(step[4], other[4])
            ends += int(step[3].sum())
        assert ends == 4
    finally:
        others.close()


@pytest.mark.slow
def test_reset_mask_restarts_chosen_robots_only() -> None:
    envs, same = (_vector(3, scenario=PAPER, settings=EFFECTS, duration=0.05) for _ in range(2))
    with pytest.raises(ResetNeeded, match='all robots in the first reset'):
        envs.reset(options={'reset_mask': np.array([True, False, False])})
    start, _ = envs.reset(seed=np.int64(4))
    same.reset(seed=4)
    for _ in range(10):
        before = envs.step(np.ones((3, 4)))[0]
        same.step(np.ones((3, 4)))
    after, infos = envs.reset(
        seed=[4, 8, 9], options={'reset_mask': np.array([True, False, False])}
    )
    np.testing.assert_array_equal(after[1:], before[1:])
    np.testing.assert_array_equal(after[0], start[0])
    assert infos['_drawn'].tolist() == [True, False, False]
    observation = envs.step(np.ones((3, 4)))[0]
    np.testing.assert_array_equal(observation[1:], same.step(np.ones((3, 4)))[0][1:])
    with pytest.raises(InputError, match=r'reset_mask = \[1\]: expected 3 booleans'):
        envs.reset(options={'reset_mask': [1]})


@pytest.mark.parametrize('kind', [MobileManipulator, MobileManipulators])
def test_step_before_reset_and_after_close_raise(kind: Any) -> None:
    env = kind(scenario=PAPER, duration=0.05)
    action = np.zeros(env.action_space.shape)
    with pytest.raises(ResetNeeded, match='step: no episode has started'):
        env.step(action)
    env.close()
    env.close()
    for use in (lambda: env.step(action), env.reset):
        with pytest.raises(ClosedEnvironmentError, match='the environment is closed'):
            use()
