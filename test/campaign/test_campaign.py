# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Description of a campaign, the scenarios of its runs, and bad input."""

from __future__ import annotations

from pathlib import Path
import shlex

from masmc_ros.campaign.campaign import Campaign, campaign_of
from masmc_ros.campaign.variable import axis, draw
from masmc_ros.cli.main import main
from masmc_ros.jit.sized_records import TAG
from masmc_ros.loop.batch_simulation import BatchRecords
from masmc_ros.scenario.scenario import load_scenario
import pytest

PAPER = str(Path(__file__).parents[2] / 'config' / 'paper.yaml')

EXAMPLE = campaign_of(
    PAPER,
    ('duration=0.3',),
    axes=[axis('controller.k_s1=50:150:3'), axis('controller.law=smc,rasmc')],
    draws=[
        draw('robot.link_2_mass=uniform:0.6:1.4'),
        draw('plant.robot.platform_mass=uniform:10:20'),
        draw('plant.disturbance.phase[2]=uniform:0:6'),
    ],
    repeats=4,
    seed=5,
)


def test_runs_are_grid_times_repeats_with_same_draws_at_points() -> None:
    runs = list(EXAMPLE.runs(0, EXAMPLE.total))
    assert EXAMPLE.total == len(runs) == 24
    assert [run.number for run in runs] == list(range(24))
    points = [(run.values['controller.k_s1'], run.values['controller.law']) for run in runs[::4]]
    assert points == [(k, law) for k in (50.0, 100.0, 150.0) for law in ('smc', 'rasmc')]
    names = [d.name for d in EXAMPLE.draws]
    for start in range(0, 24, 4):
        for k in range(4):
            values = runs[start + k].values
            assert [values[n] for n in names] == [runs[k].values[n] for n in names]
    assert [run.scenario['plant']['seed'] for run in runs[:5]] == [0, 1, 2, 3, 0]


def test_records_of_batch_equal_those_of_runs_alone() -> None:
    """Plants of the first two campaigns differ in few parameters; the last draws all others."""
    robots = 'robot.link_2_mass=uniform:0.6:1.4', 'plant.robot.com_offset=uniform:0.05:0.1'
    plant = (
        'plant.disturbance.phase[2]=uniform:0:6', 'plant.torque_limit[1]=uniform:20:40',
        'plant.measurement_loss=uniform:0:0.2', 'plant.payload.mass=uniform:0:1',
        'plant.initial_pose[0]=uniform:0:1', 'plant.initial_joints[2]=uniform:0.7:0.9',
        'plant.initial_velocity[0]=uniform:0:1', 'controller.k_s1=uniform:80:120',
    )  # fmt: skip
    others = 'plant.motor_lag=uniform:0:0.01', 'plant.measurement_delay=uniform:0:0.01'
    latency = 'controller.latency=0.002', 'plant.stiction.torque=[0.1, 0.2, 0.0, 0.1]'
    for draws, settings in ((robots, ()), (plant, latency[:1]), (robots + others, latency)):
        campaign = campaign_of(PAPER, settings, draws=[draw(text) for text in draws], repeats=5)
        runs = [run.scenario for run in campaign.runs(0, 5)]
        batch = BatchRecords(runs)
        for lane, run in enumerate(runs):
            alone = BatchRecords([run])
            for name in ('_plant', '_state', '_settings', '_learned'):
                record, single = getattr(batch, name), getattr(alone, name)
                for field in single.dtype.names:
                    if TAG not in field:
                        values = record[field][..., lane:lane + 1]
                        assert values.tobytes() == single[field].tobytes(), (lane, field)


def test_part_of_runs_equals_those_of_all() -> None:
    everything = list(EXAMPLE.runs(0, 24))
    for first in range(24):
        assert list(EXAMPLE.runs(first, min(5, 24 - first))) == everything[first:first + 5]


def test_command_repeats_scenario_of_run() -> None:
    for run in EXAMPLE.runs(0, 24):
        command, file, *options = shlex.split(EXAMPLE.command(run))[1:]
        assert (command, file) == ('simulate', PAPER)
        assert set(options[::2]) == {'--set'}
        repeated = load_scenario(file, options[1::2])
        assert {node: repeated[node] for node in run.scenario.values} == run.scenario.values


def test_command_ends_with_values_of_run_and_starts_active() -> None:
    settings = (
        'plant.robot.link_2_mass=1.0',
        'robot.link_2_mass=2.0',
        'controller.approach_on_start=true',
        'controller.active_on_start=false',
    )
    campaign = campaign_of(PAPER, settings, axes=[axis('plant.robot.link_2_mass=1.0,3.0')])
    options = shlex.split(campaign.command(next(campaign.runs(0, 1))))[4::2]
    repeated = load_scenario(PAPER, options)
    assert repeated['plant']['robot.link_2_mass'] == 1.0
    assert repeated['controller']['robot.link_2_mass'] == 2.0
    assert not repeated['controller']['approach_on_start']
    assert repeated['controller']['active_on_start']


def test_shared_parameter_applies_to_all_nodes() -> None:
    run = next(EXAMPLE.runs(3, 1))
    plant, controller = run.scenario['plant'], run.scenario['controller']
    assert plant['robot.link_2_mass'] == controller['robot.link_2_mass'] != 1.07
    assert plant['robot.platform_mass'] != controller['robot.platform_mass'] == 17.25


def test_description_as_text_is_complete() -> None:
    again = Campaign.from_text(EXAMPLE.text)
    assert again.text == EXAMPLE.text
    assert again.key == EXAMPLE.key
    assert list(again.runs(0, 24)) == list(EXAMPLE.runs(0, 24))


def test_key_depends_on_every_part_of_description() -> None:
    keys = {
        campaign_of(PAPER, settings, repeats=repeats, seed=seed).key
        for settings in ((), ('controller.k_s1=80.0',))
        for repeats in (1, 2)
        for seed in (0, 1)
    }
    assert len(keys) == 8


@pytest.mark.parametrize(
    ('arguments', 'line'),
    [
        (['sweep', '--vary', 'controller.k_s9=1:2:3'], "controller has no parameter 'k_s9'"),
        (['sweep', '--vary', 'k_s1=1:2:3'], 'write NODE.parameter, here controller.k_s1'),
        (['sweep', '--vary', 'controller.k_s1=2:1:3'], 'empty range'),
        (['sweep', '--vary', 'controller.k_s1=-1,2'], 'k_s1 = -1: expected'),
        (['sweep', '--vary', 'controller.k_s1=1,2', '--vary', 'controller.k_s1=3,4'],
         'controller.k_s1: varies twice'),
        (['sweep', '--vary', 'controller.k_s1[0]=1,2', '--vary', 'controller.k_s1=3,4'],
         'controller.k_s1[0], controller.k_s1: the same parameter varies twice'),
        (['sweep', '--vary', 'controller.k_s1[0]=1,2', '--vary', 'controller.k_s1[00]=3,4'],
         'varies twice'),
        (['monte-carlo', '--draw', 'plant.robot.link_2_mass=uniform:1:2',
          '--draw', 'robot.link_2_mass=uniform:1:2'], 'the same parameter varies twice'),
        (['sweep', '--vary', 'controller.law=smc,smcc'], 'law = smcc: expected one of'),
        (['sweep', '--vary', 'trajectory.start_time=0,5'], 'path starts with the robot'),
        (['sweep', '--vary', 'robot.mechanism=two_link'], 'same type of robot'),
        (['sweep', '--vary', 'plant.wait_for=a,b'], 'wait_for is a text'),
        (['sweep', '--vary', 'plant.initial_joints[4]=1,2'], 'expected an index < 4'),
        (['sweep', '--vary', 'controller.law[0]=smc'], 'expected no index'),
        (['sweep', '--vary', 'controller.k_s1=1,2', '--runs', str(2**40)],
         '2199023255552 runs; expected at most'),
        (['sweep', '--vary', 'plant.seed=1,2', '--runs', '2'], 'already differs'),
        (['sweep', '--vary', 'controller.k_s1=1,2', '--metric', 'rms'], "'rms' is unknown"),
        (['monte-carlo', '--draw', 'robot.link_2_mass=uniform:-0.1:1'],
         'it can draw -0.1, and robot.link_2_mass is a number >'),
        (['monte-carlo', '--draw', 'robot.link_2_mass=normal:1:0.1'], 'it can draw -inf'),
        (['monte-carlo', '--draw', 'robot.link_2_mass=unifrom:1:2'], 'unknown distribution'),
        (['monte-carlo', '--draw', 'plant.seed=uniform:1:2'], 'expected integers'),
        (['monte-carlo', '--draw', 'controller.k_s1=integers:1:2'],
         'expected another distribution'),
        (['monte-carlo', '--draw', 'controller.k_s1=uniform:1:2', '--runs', '0'],
         "'0': expected a whole number >= 1"),
    ],
)  # fmt: skip
def test_bad_input_prints_one_line_and_writes_nothing(
    arguments: list[str], line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command, *options = arguments
    assert main([command, PAPER, *options, '--output', str(tmp_path / 'out')]) == 2
    error_text = capsys.readouterr().err
    assert line in error_text
    assert error_text.count('\n') == 1
    assert not (tmp_path / 'out').exists()
