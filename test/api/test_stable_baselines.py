# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Stable-Baselines3 accepts the environment, and trains on several of them."""

from __future__ import annotations

from typing import Any
import warnings

import gymnasium
from gymnasium.wrappers import RescaleAction
from helpers.campaigns import PAPER
from masmc_ros.api.learning import ENVIRONMENT
import numpy as np
import pytest

pytestmark = pytest.mark.slow
OPTIONS = {'scenario': PAPER, 'duration': 0.5, 'control_period': 0.01, 'action_limit': 5.0}
STEPS = 51
"""Ticks of a run of 0.5 s."""


@pytest.fixture
def baselines() -> Any:
    """Return the package; its import takes seconds, so only these tests import it."""
    package = pytest.importorskip('stable_baselines3')
    # Tests run in several processes.
    pytest.importorskip('torch').set_num_threads(1)
    return package


def test_environment_passes_check_of_baselines(baselines: Any) -> None:
    from stable_baselines3.common.env_checker import check_env

    env = gymnasium.make(ENVIRONMENT, scenario=PAPER, duration=0.05)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter('always')
        check_env(env.unwrapped)
    texts = [str(warning.message) for warning in caught if warning.category is UserWarning]
    # Torques have a unit, and states of doubles are those of a run.
    advice = 'symmetric and normalized Box action space', 'action space has dtype float64'
    assert len(texts) == 2, texts
    assert all(part in text for part, text in zip(advice, texts, strict=True)), texts


def test_ppo_trains_on_several_environments(baselines: Any) -> None:
    from stable_baselines3.common.env_util import make_vec_env

    envs = make_vec_env(
        ENVIRONMENT,
        n_envs=2,
        seed=0,
        env_kwargs=OPTIONS,
        wrapper_class=RescaleAction,
        wrapper_kwargs={'min_action': -1.0, 'max_action': 1.0},
    )
    model = baselines.PPO(
        'MlpPolicy',
        envs,
        n_steps=5 * STEPS,
        batch_size=STEPS,
        seed=0,
        device='cpu',
        policy_kwargs={'net_arch': [32]},
    )
    before = {name: value.clone() for name, value in model.policy.named_parameters()}
    model.learn(2 * 10 * STEPS)
    assert model.num_timesteps == 20 * STEPS
    episodes = list(model.ep_info_buffer)
    assert [episode['l'] for episode in episodes] == [STEPS] * 20
    assert all(-10.0 * STEPS < episode['r'] < 0.0 for episode in episodes)
    for name, value in model.policy.named_parameters():
        assert value.isfinite().all(), name
        assert not value.equal(before[name]), name
    observation = envs.reset()
    action, _ = model.predict(observation, deterministic=True)
    assert action.shape == (2, 4)
    assert np.abs(action).max() <= 1.0
    observation, reward, ended, _ = envs.step(action)
    assert observation.shape == (2, 34)
    assert np.isfinite(reward).all()
    assert not ended.any()
    envs.close()
