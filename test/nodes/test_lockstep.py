# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Nodes in lockstep: their messages are bitwise identical to the simulation's."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import signal

from helpers.log_contents import LogContents, read_log
from helpers.processes import NODES, PAPER, peer, processes, ros_arguments
from helpers.state_transforms import StateTransforms
from masmc_ros.cli.main import main
from masmc_ros.scenario.scenario import load_scenario
import pytest
from std_msgs.msg import String

OTHER = """
/**:
  ros__parameters:
    pacing: lockstep
    control_period: 0.002
    duration: 1.0
    frame_prefix: left/
    robot: {wheel_radius: 0.07, half_track: 0.2, com_offset: 0.03, arm_offset: 0.15,
            link_1_length: 0.45, link_2_length: 0.4, platform_mass: 22.0, link_2_mass: 1.6}
/**/plant:
  ros__parameters:
    wait_for: [controller, trajectory]
    initial_pose: [0.1, -0.05, 1.2]
    initial_velocity: [0.5, -0.3, 0.1, 0.2]
    torque_limit: [6.0, 6.0, 15.0, 8.0]
    disturbance: {amplitude: [1.0, 0.5, 2.0, 1.0], frequency: [2.0, 5.0, 1.0, 3.0]}
/**/controller:
  ros__parameters: {law: smc, switching: implicit, observer_gain: 0.5, model_scale: 0.8,
                    k_s1: [80.0, 90.0, 70.0, 100.0]}
"""

TICK_TOPICS = (
    'joint_states',
    'effort_commands',
    'controller/tracking_error',
    'controller/sliding_surface',
    'controller/parameter_estimate',
    'controller/raw_torque',
    'tf',
)

DECIMATED_TOPICS = ('odom', 'base_twist', 'clock')
SHOWN_TOPICS = ('robot_description', 'path/desired', 'path/actual')


def simulated(file: Path, log: Path, *settings: str) -> dict[str, list[bytes]]:
    """Return the messages of a simulation of a parameter file."""
    options = [word for setting in settings for word in ('--set', setting)]
    assert main(['simulate', str(file), '--output', str(log), *options]) == 0
    return read_log(log).messages


def settings_of(settings: dict[str, str]) -> list[str]:
    """Convert settings of `ros_arguments` to those of the simulation."""
    return [f'{name.replace("__", ".")}={value}' for name, value in settings.items()]


def check_same(live: dict[str, list[bytes]], computed: dict[str, list[bytes]]) -> None:
    """Compare all messages of the topics that a run and a simulation have in common."""
    for topic in (*TICK_TOPICS, *DECIMATED_TOPICS, *SHOWN_TOPICS):
        assert len(live[topic]) == len(computed[topic]), topic
        assert live[topic] == computed[topic], topic


def check_transforms(
    live: dict[str, list[bytes]], computed: dict[str, list[bytes]], file: Path
) -> None:
    """Compare the transforms of recorded states with the simulated ones."""
    transforms = StateTransforms(load_scenario(str(file))['plant'])
    of_states = [transforms.of_state(raw) for raw in live['joint_states']]
    assert len(of_states) == len(computed['tf'])
    assert of_states == computed['tf']


@pytest.fixture(scope='module')
def paper(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[bytes]]:
    log = tmp_path_factory.mktemp('simulated') / 'run.mcap'
    return simulated(PAPER, log, 'duration=1.5')


def of_every_node(**settings: object) -> dict[str, object]:
    """Return settings of all nodes as arguments of `ros_arguments`."""
    return {f'{node}__{name}': value for name, value in settings.items() for node in NODES}


def separate(folder: Path, duration: float, *remap: str, **settings: object) -> Path:
    """Run the paper's scenario with one process for each node; return the log."""
    log = folder / 'live.mcap'
    with processes(folder) as started:
        arguments = ros_arguments(
            PAPER,
            **of_every_node(duration=duration),
            plant__wait_for='[controller, trajectory, recorder]',
            recorder__output=log,
            **settings,
        )
        started.start_all(*arguments, *remap)
        assert set(started.wait().values()) == {0}, started.output()
    return log


def two_robots(folder: Path, **settings: str) -> Iterator[tuple[str, LogContents]]:
    """
    Run two robots at once, each in its namespace and process; yield each with its log.

    `settings` are those of every node, with {robot} for the robot's name.
    """
    with processes(folder) as started:
        for robot in ('left', 'right'):
            own = {name: value.format(robot=robot) for name, value in settings.items()}
            arguments = ros_arguments(
                PAPER,
                **of_every_node(**own),
                plant__wait_for='[controller, trajectory, recorder]',
                recorder__output=folder / f'{robot}.mcap',
            )
            started.start('composed', '--record', *arguments, '-r', f'__ns:=/{robot}')
        assert set(started.wait().values()) == {0}, started.output()
    for robot in ('left', 'right'):
        yield robot, read_log(folder / f'{robot}.mcap', f'/{robot}')


@pytest.mark.parametrize('namespace', ['', '/left'])
def test_lockstep_separate_processes_equal_simulation(
    paper: dict[str, list[bytes]], tmp_path: Path, namespace: str
) -> None:
    remap = ['-r', f'__ns:={namespace}'] if namespace else []
    live = read_log(separate(tmp_path, 1.5, *remap), namespace or '/').messages
    check_same(live, paper)
    check_transforms(live, paper, PAPER)


@pytest.mark.slow
def test_lockstep_with_latency_equals_simulation(tmp_path: Path) -> None:
    settings = {
        'plant__measurement_delay': '0.005',
        'controller__latency': '0.005',
        'controller__law': 'smc',
        'controller__switching': 'implicit',
    }
    live = read_log(separate(tmp_path, 1.0, **settings)).messages
    options = settings_of(settings)
    check_same(live, simulated(PAPER, tmp_path / 'run.mcap', 'duration=1.0', *options))


def test_lockstep_other_robot_law_period_equal_simulation(tmp_path: Path) -> None:
    file = tmp_path / 'other.yaml'
    file.write_text(OTHER)
    log = tmp_path / 'live.mcap'
    with processes(tmp_path) as started:
        arguments = ros_arguments(
            file, plant__wait_for='[controller, trajectory, recorder]', recorder__output=log
        )
        started.start_all(*arguments)
        assert set(started.wait().values()) == {0}, started.output()
    live, computed = read_log(log).messages, simulated(file, tmp_path / 'simulated.mcap')
    check_same(live, computed)
    check_transforms(live, computed, file)
    assert b'left/base_link' in computed['tf'][0]
    for topic in ('odom', 'path/desired', 'path/actual'):
        assert all(b'left/odom' in raw for raw in live[topic]), topic


def test_lockstep_composed_equals_simulation(
    paper: dict[str, list[bytes]], tmp_path: Path
) -> None:
    log = tmp_path / 'live.mcap'
    with processes(tmp_path) as started:
        arguments = ros_arguments(
            PAPER,
            **{f'{node}__duration': 1.5 for node in NODES},
            plant__wait_for='[controller, trajectory, recorder]',
            recorder__output=log,
        )
        started.start('composed', '--record', *arguments)
        assert started.wait() == {'composed': 0}, started.output()
    check_same(read_log(log).messages, paper)


def check_restarted_controller(
    folder: Path, commands: tuple[str, ...], **settings: str
) -> None:
    """
    Kill and restart the controller of a run: states and commands equal the simulation's.

    `settings` are those of `ros_arguments`; `commands` are the topics that answer states.
    """
    log = folder / 'live.mcap'
    with processes(folder) as started, peer(started.domain) as tester:
        arguments = ros_arguments(
            PAPER,
            # Without an end: the run must not end before the controller is killed.
            **{f'{node}__duration': 0.0 for node in NODES},
            # Discovery can take seconds; the run must not start before its observer is known.
            plant__wait_for='[controller, trajectory, recorder, peer]',
            recorder__output=log,
            **settings,
        )
        stamps = tester.watch_time()
        running = started.start_all(*arguments)
        tester.until(lambda: stamps[-1] >= 1_000_000_000)
        running['controller'].signal(signal.SIGKILL)
        running['controller'].wait()
        parameters = tester.collect(String, 'controller/parameters')
        started.start('controller', *arguments)
        tester.until(lambda: parameters, 'the new controller')
        restart_stamp = stamps[-1]
        tester.until(lambda: stamps[-1] >= restart_stamp + 3_000_000_000, 'three more seconds')
        started.signal(signal.SIGINT)
        assert set(started.wait().values()) == {0}, started.output()
    live = read_log(log)
    last = live.stamps('joint_states')[-1]
    assert last is not None
    computed = simulated(
        PAPER,
        folder / 'simulated.mcap',
        f'duration={last * 1e-9:.3f}',
        *settings_of(settings),
    )
    assert live.messages['joint_states'] == computed['joint_states']
    for topic in commands:
        # The new controller answers recent states again, with the same commands. The last
        # state may have no answer. The last command of the killed one may be missing in the log.
        answers = computed[topic]
        assert set(live.messages[topic]) <= set(answers), topic
        assert len(set(answers[:-1]) - set(live.messages[topic])) <= 1, topic


@pytest.mark.slow
def test_lockstep_controller_restarted_run_continues(tmp_path: Path) -> None:
    """The law smc has no state; therefore a new controller continues the run identically."""
    check_restarted_controller(tmp_path, ('effort_commands',), controller__law='smc')


@pytest.mark.slow
def test_lockstep_two_robots_in_namespaces_independent(
    paper: dict[str, list[bytes]], tmp_path: Path
) -> None:
    for _, log in two_robots(tmp_path, duration='1.5'):
        # Each robot has separate topics, clock and frames.
        for topic in ('joint_states', 'clock', 'tf'):
            assert log.messages[topic] == paper[topic], topic


@pytest.mark.slow
def test_lockstep_two_robots_share_tf_log_has_own_frames(tmp_path: Path) -> None:
    """Both robots publish on /tf; a log contains the frames of its own robot only."""
    for robot, log in two_robots(tmp_path, duration='0.5', frame_prefix='{robot}/'):
        assert '/tf' in {channel.topic for channel in log.summary.channels.values()}
        frames = f'{robot}/base_link'.encode()
        assert len([raw for raw in log.messages['tf'] if frames in raw]) == 501
        assert len(log.messages['tf']) == 501
