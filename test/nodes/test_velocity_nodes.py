# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Velocity interface of nodes: lockstep, real time, invalid messages, mismatched settings."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
import math
from pathlib import Path
import signal
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped, Vector3
from helpers.live_run import live_run, LiveRun
from helpers.log_contents import read_log
from helpers.processes import PAPER, peer, processes, ros_arguments
from helpers.robots import task_positions
from masmc_ros.cli.main import main
from masmc_ros.log.read.reader import read_run
from masmc_ros.messages.commands import ArmVelocityCdr
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.platform_messages import TwistCdr, TwistStampedCdr
from masmc_ros.messages.reference_window import ReferenceWindow
from masmc_ros.reference.windows import ReferenceWindows
from masmc_ros.report.measure.parameters import run_robot
from masmc_ros.robot.robot import robot_of
from masmc_ros.scenario.scenario import load_scenario
import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, Trigger
from test_faults import check_rejected, counts_at_least, GARBAGE
from test_lockstep import (
    check_restarted_controller,
    DECIMATED_TOPICS,
    separate,
    settings_of,
    SHOWN_TOPICS,
    simulated,
    TICK_TOPICS,
)

TOPICS = (
    'cmd_vel',
    'arm_velocity_commands',
    *(topic for topic in (*TICK_TOPICS, *DECIMATED_TOPICS, *SHOWN_TOPICS)
      if topic not in ('effort_commands', 'controller/raw_torque')),
)
RATES = {'plant__command_interface': 'velocity', 'controller__command_interface': 'velocity'}
SECOND = 500
"""Number of ticks per second of a run in real time."""

STAMPED = {f'{node}__enable_stamped_cmd_vel': 'true' for node in ('plant', 'controller')}

ANOTHER = """
/**:
  ros__parameters:
    pacing: lockstep
    control_period: 0.002
    duration: 1.0
    frame_prefix: left/
    robot: {half_track: 0.2, com_offset: 0.03}
/**/plant:
  ros__parameters:
    wait_for: [controller]
    command_interface: velocity
    enable_stamped_cmd_vel: true
    torque_limit: [8.0, 8.0, 20.0, 10.0]
    velocity_noise: 0.01
    encoder_resolution: 0.001
    robot: {wheel_radius: 0.07}
/**/controller:
  ros__parameters:
    command_interface: velocity
    enable_stamped_cmd_vel: true
    velocity_source: estimated
    sigma: [3.0, 3.0, 2.0, 2.0]
"""


def check_recomputed(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Check that recomputing a recorded run is bitwise identical."""
    capsys.readouterr()
    assert main(['simulate', str(log)]) == 0
    assert 'are bitwise identical' in capsys.readouterr().out.splitlines()[-1]


@pytest.mark.parametrize('stamped', [{}, STAMPED], ids=['Twist', 'TwistStamped'])
def test_velocity_interface_lockstep_equals_simulation(
    stamped: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = {**RATES, **stamped}
    log = separate(tmp_path, 1.0, **settings)
    contents = read_log(log)
    computed = simulated(
        PAPER, tmp_path / 'simulated.mcap', 'duration=1.0', *settings_of(settings)
    )
    for topic in TOPICS:
        assert contents.messages[topic] == computed[topic], topic
    assert len(computed['cmd_vel']) == len(computed['arm_velocity_commands']) == 1001
    assert not contents.messages['effort_commands']
    assert 'effort_commands' not in computed
    check_recomputed(log, capsys)
    check_recomputed(tmp_path / 'simulated.mcap', capsys)


@pytest.mark.slow
def test_velocity_interface_other_wheels_equals_simulation(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The base uses its own wheel radius, which differs from the controller's."""
    file, log = tmp_path / 'other.yaml', tmp_path / 'live.mcap'
    file.write_text(ANOTHER)
    with processes(tmp_path) as started:
        arguments = ros_arguments(
            file, plant__wait_for='[controller, trajectory, recorder]', recorder__output=log
        )
        started.start('composed', '--record', *arguments)
        assert started.wait() == {'composed': 0}, started.output()
    live, computed = read_log(log).messages, simulated(file, tmp_path / 'simulated.mcap')
    for topic in TOPICS:
        assert live[topic] == computed[topic], topic
    assert b'left/base_link' in live['cmd_vel'][0]
    check_recomputed(log, capsys)


class Watched:
    """Run in real time, with commanded and measured joint velocities."""

    def __init__(self, run: LiveRun, *, is_stamped: bool) -> None:
        self.run = run
        self.type = TwistStamped if is_stamped else Twist
        self._twist: Any = TwistStampedCdr() if is_stamped else TwistCdr()
        self._arm, self._state = ArmVelocityCdr(), JointStateCdr()
        self.rates = np.full(4, np.nan)
        self.motion = np.full(4, np.nan)
        self._geometry = robot_of(load_scenario(str(PAPER), ())['plant']).geometry
        self._windows = ReferenceWindows(4)
        self._errors: deque[np.ndarray] = deque(maxlen=SECOND)
        run.tester.subscribe(Float64MultiArray, 'reference', self._on_reference, raw=True)
        run.tester.subscribe(self.type, 'cmd_vel', self._on_twist, raw=True)
        run.tester.subscribe(
            Float64MultiArray, 'arm_velocity_commands', self._on_arm, raw=True
        )
        run.tester.subscribe(JointState, 'joint_states', self._on_state, raw=True)

    def follows(self) -> bool:
        """Return True if the robot was on the path during the last second."""
        return len(self._errors) == SECOND and rms(np.array(self._errors)) < 0.04

    def wait_for_rest(self) -> None:
        """Wait until the commanded velocities are zero and the joints almost stand still."""
        self.run.tester.until(lambda: not self.rates.any(), f'zero velocities, not {self.rates}')
        self.wait_for_standstill()

    def wait_for_standstill(self) -> None:
        """Wait until the drives hold the joints against the disturbance."""
        self.run.tester.until(lambda: np.abs(self.motion).max() < 0.05, f'rest, {self.motion}')

    def _on_twist(self, raw: bytes) -> None:
        if self._twist.load(raw):
            self.rates[:2] = self._twist.linear[0], self._twist.angular[2]

    def _on_arm(self, raw: bytes) -> None:
        # Commands of the test have another layout than the controller's.
        if self._arm.load(raw):
            self.run.commands += 1
            self.rates[2:] = self._arm.data

    def _on_state(self, raw: bytes) -> None:
        assert self._state.load(raw)
        self.motion = self._state.velocity[3:].copy()
        reference = self._windows.at(self._state.stamp_ns)
        if reference is not None:
            reached = task_positions(self._geometry, self._state.position[None])[0]
            self._errors.append(reached - reference[:4])

    def _on_reference(self, raw: bytes) -> None:
        window = ReferenceWindow.from_bytes(raw)
        assert window is not None
        assert window.stamp_ns is not None
        self._windows.add(window.stamp_ns, window.period, window.samples.reshape(-1, 12))


def rms(errors: np.ndarray) -> float:
    """Return the root mean square of the norms of errors (N, 4)."""
    return float(np.sqrt((errors**2).sum(axis=1).mean()))


@contextmanager
def watched(folder: Path, *, is_stamped: bool) -> Iterator[Watched]:
    """Yield a started run in real time."""
    stamped = str(is_stamped).lower()
    settings = {
        'command_interface': 'velocity',
        'plant__command_interface': 'velocity',
        'enable_stamped_cmd_vel': stamped,
        'plant__enable_stamped_cmd_vel': stamped,
    }
    with live_run(folder, **settings) as run:
        watched_run = Watched(run, is_stamped=is_stamped)
        run.wait_for_progress()
        yield watched_run


@pytest.mark.slow
@pytest.mark.parametrize('is_stamped', [False, True], ids=['Twist', 'TwistStamped'])
def test_velocity_interface_real_time_follows_path_and_stops(
    is_stamped: bool, tmp_path: Path
) -> None:
    with watched(tmp_path, is_stamped=is_stamped) as watched_run:
        run, tester = watched_run.run, watched_run.run.tester
        start = run.stamp
        tester.until(lambda: run.stamp > start + 5e9 and watched_run.follows(), 'the path')
        followed = run.stamp * 1e-9
        tester.until(watched_run.rates.any, 'rates')

        assert tester.call(
            Trigger, '/controller/emergency_stop', Trigger.Request()
        ).success
        watched_run.wait_for_rest()
        tester.call(SetBool, '/controller/enable', SetBool.Request(data=True))
        run.wait_for_progress()

        run.nodes['controller'].signal(signal.SIGKILL)
        run.nodes['controller'].wait()
        for topic in ('cmd_vel', 'arm_velocity_commands'):
            # The two commands may time out at different ticks.
            stopped = f'no command on {topic} for 0.2 s; the drives hold until one comes'
            tester.until(lambda line=stopped: run.nodes['plant'].logged('WARN', line), stopped)
        watched_run.wait_for_standstill()
        run.start('controller')
        run.wait_for_progress()
        run.end()
    logged = read_run(run.log)
    assert logged.commands_rates
    assert len(logged.cmd_vel) > 1000
    assert len(logged.arm_rates) > 1000
    robot = run_robot(logged)
    assert robot is not None
    assert logged.reference is not None
    error = task_positions(robot.geometry, logged.position) - logged.reference[:, :4]
    assert rms(error[np.flatnonzero(logged.times < followed)[-SECOND:]]) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize('is_stamped', [False, True], ids=['Twist', 'TwistStamped'])
def test_velocity_interface_invalid_messages_rejected(is_stamped: bool, tmp_path: Path) -> None:
    with watched(tmp_path, is_stamped=is_stamped) as watched_run:
        run = watched_run.run
        twists = run.tester.publisher(watched_run.type, 'cmd_vel')
        arms = run.tester.publisher(Float64MultiArray, 'arm_velocity_commands')
        run.injected.add(nan_for_the_arm())
        for bad, reason in (
            (twist_of(run, is_stamped, linear=Vector3(x=math.nan)), 'linear.x = nan: expected'),
            (twist_of(run, is_stamped, angular=Vector3(y=math.inf)), 'angular.y = inf: expected'),
            (GARBAGE, '8 bytes that are no'),
        ):
            check_rejection(run, twists, 'cmd_vel', bad, reason)
        for bad, reason in (
            (Float64MultiArray(data=[0.0] * 4), '4 numbers; expected 2'),
            (Float64MultiArray(data=[]), '0 numbers; expected 2'),
            (Float64MultiArray(data=[0.0, math.nan]), "'arm_joint_2' is not"),
            (nan_for_the_arm(), "the rate of 'arm_joint_2' is not a finite number"),
            (GARBAGE, '8 bytes that are no'),
        ):
            check_rejection(run, arms, 'arm_velocity_commands', bad, reason)
        for topic, count in (('cmd_vel', 3), ('arm_velocity_commands', 5)):
            counts_at_least(run, 'plant', f'{topic} rejected', count)
        run.wait_for_progress()
        run.end()
    assert read_log(run.log).types['cmd_vel'].endswith(watched_run.type.__name__)


def check_rejection(run: LiveRun, publisher: Any, topic: str, bad: Any, reason: str) -> None:
    """Send an invalid message until the plant rejects it for this reason."""
    key = 'plant', topic, type(publisher)
    check_rejected(run, {key: publisher}, {key: (lambda _: bad, reason)})


def twist_of(run: LiveRun, is_stamped: bool, **parts: Vector3) -> Any:
    """Return a twist, optionally stamped with the time of the current state."""
    if not is_stamped:
        return Twist(**parts)
    message = TwistStamped(twist=Twist(**parts))
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(run.stamp, 10**9)
    return message


def nan_for_the_arm() -> bytes:
    """Return a command in the controller's own layout with a NaN."""
    command = ArmVelocityCdr()
    command.data[1] = math.nan
    return command.to_bytes()


DISAGREEMENTS = {
    'interface': (
        {'plant__command_interface': 'velocity'},
        'controller: it sends effort_commands, and with command_interface velocity the plant'
        ' uses cmd_vel and arm_velocity_commands',
        'command_interface = effort, and the plant has velocity',
    ),
    'the other way round': (
        {'controller__command_interface': 'velocity'},
        'controller: it sends cmd_vel and arm_velocity_commands, and with command_interface'
        ' effort the plant uses effort_commands',
        'command_interface = velocity, and the plant has effort',
    ),
    'type': (
        {**RATES, 'controller__enable_stamped_cmd_vel': 'true'},
        'controller: its cmd_vel is geometry_msgs/msg/TwistStamped, and with'
        ' enable_stamped_cmd_vel false the plant uses geometry_msgs/msg/Twist',
        'enable_stamped_cmd_vel = true, and the plant has false',
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ('settings', 'plant_says', 'controller_says'), DISAGREEMENTS.values(), ids=DISAGREEMENTS
)
def test_nodes_different_interfaces_both_report(
    settings: dict[str, str], plant_says: str, controller_says: str, tmp_path: Path
) -> None:
    with processes(tmp_path) as started, peer(started.domain) as tester:
        arguments = ros_arguments(PAPER, plant__wait_for='[controller]', **settings)
        running = started.start_all(*arguments, nodes=('plant', 'controller'))
        tester.until(lambda: running['plant'].logged('INFO', plant_says), plant_says)
        tester.until(
            lambda: running['controller'].logged('ERROR', controller_says), controller_says
        )
        started.signal(signal.SIGINT)
        assert set(started.wait().values()) == {0}, started.output()


@pytest.mark.slow
def test_velocity_interface_controller_restarted_continues(tmp_path: Path) -> None:
    """A stamped twist names its state; therefore it cannot answer another state."""
    topics = ('cmd_vel', 'arm_velocity_commands')
    check_restarted_controller(tmp_path, topics, **RATES, **STAMPED)
