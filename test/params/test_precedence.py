# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Precedence of values: files in order, then the command line; a later value replaces all."""

from __future__ import annotations

from itertools import permutations
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from masmc_ros.errors import InputError
from masmc_ros.params.file import node_values, read
from masmc_ros.scenario.scenario import load_scenario
import pytest

ROOT = Path(__file__).resolve().parents[2]
CONFIG = ROOT / 'config'
VALUES = {'2.0': 2.0, '[1.0, 2.0, 3.0, 4.0]': [1.0, 2.0, 3.0, 4.0], '7': 7, '[]': None}


def block(text: str, key: str = '/**/controller') -> str:
    return f'{key}:\n  ros__parameters:\n    k_s1: {text}\n'


def written(folder: Path, *texts: str) -> list[Path]:
    paths = [folder / f'{number}.yaml' for number in range(len(texts))]
    for path, text in zip(paths, texts, strict=True):
        path.write_text(text)
    return paths


def of_files(*paths: Path) -> Any:
    return node_values(map(read, paths), {}, 'controller').values['k_s1']


@pytest.mark.parametrize('texts', permutations(VALUES, 3), ids=' '.join)
def test_precedence_files_of_any_types_last_applies(
    texts: tuple[str, ...], tmp_path: Path
) -> None:
    paths = written(tmp_path, *map(block, texts))
    assert of_files(*paths) == VALUES[texts[-1]]
    (joined,) = written(tmp_path, ''.join(map(block, texts)))
    assert of_files(joined) == VALUES[texts[-1]]


@pytest.mark.parametrize('keys', permutations(['/**', '/**/controller', 'controller'], 2))
def test_precedence_blocks_of_any_key_last_applies(keys: tuple[str, str], tmp_path: Path) -> None:
    first, second = block('2.0', keys[0]), block('[1.0, 2.0, 3.0, 4.0]', keys[1])
    last = VALUES['[1.0, 2.0, 3.0, 4.0]']
    assert of_files(*written(tmp_path, first, second)) == last
    assert of_files(*written(tmp_path, first + second)) == last
    # The first key is repeated after the other one.
    assert of_files(*written(tmp_path, second + first + second)) == last
    assert of_files(*written(tmp_path, second, first, second)) == last


def test_precedence_repeated_name_has_place_of_last_value(tmp_path: Path) -> None:
    one, two = written(tmp_path, block('2.0'), block('3.0') + block('4.0'))
    places = node_values([read(one), read(two)], {}, 'controller').places
    assert places == {'k_s1': f'{two}:6: '}


def test_precedence_settings_replace_files_and_are_not_shared(tmp_path: Path) -> None:
    paths = written(tmp_path, block('2.0', '/**'))
    by_file = node_values(map(read, paths), {}, 'controller')
    assert by_file.shared == {'k_s1'}
    by_setting = node_values(map(read, paths), {'k_s1': [5.0]}, 'controller')
    assert by_setting.values == {'k_s1': [5.0]}
    assert not by_setting.shared
    assert not by_setting.places


@given(st.lists(st.tuples(st.sampled_from(['/**', '/**/controller']), st.sampled_from([*VALUES]))))
def test_precedence_joined_blocks_equal_separate_files(
    tmp_path_factory: pytest.TempPathFactory, blocks: list[tuple[str, str]]
) -> None:
    folder = tmp_path_factory.getbasetemp()
    texts = [block(text, key) for key, text in blocks]
    (joined,) = written(folder, ''.join(texts))
    together = node_values([read(joined)], {}, 'controller').values
    apart = node_values(map(read, written(folder, *texts)), {}, 'controller').values
    assert together == apart


def test_precedence_realtime_after_paper_limits_torque(tmp_path: Path) -> None:
    """The arrays of config/realtime.yaml replace the numbers of config/paper.yaml."""
    files = [CONFIG / 'paper.yaml', CONFIG / 'realtime.yaml']
    values = node_values(map(read, files), {}, 'controller').values
    assert values['torque_limit'] == [8.0, 8.0, 20.0, 10.0]
    (joined,) = written(tmp_path, ''.join(file.read_text() for file in files))
    scenario = load_scenario(str(joined))
    for node in ('plant', 'controller'):
        assert scenario[node]['torque_limit'] == (8.0, 8.0, 20.0, 10.0)
        assert scenario[node]['pacing'] == 'realtime'
    reverse = node_values(map(read, reversed(files)), {}, 'controller').values
    assert reverse['torque_limit'] == 0.0


def test_precedence_replaced_value_is_not_checked(tmp_path: Path) -> None:
    (path,) = written(tmp_path, block('-1.0') + '/**:\n  ros__parameters:\n    duration: x\n')
    settings = ('controller.k_s1=[5, 6, 7, 8]', 'duration=1')
    assert load_scenario(str(path), settings)['controller']['k_s1'] == (5.0, 6.0, 7.0, 8.0)
    with pytest.raises(InputError, match=r'k_s1 = -1\.0'):
        load_scenario(str(path), settings[1:])


def test_precedence_integer_setting_of_robot_is_accepted() -> None:
    scenario = load_scenario(str(CONFIG / 'paper.yaml'), ['robot.link_2_mass=1'])
    assert scenario['plant']['robot.link_2_mass'] == 1.0
